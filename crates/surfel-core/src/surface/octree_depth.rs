//! The depth of the cells of octrees.

use crate::error::Error;

/// The depth of an octree's cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum OctreeDepth {
    /// Cells as fine as the points, and coarser ones where a pixel is larger.
    #[default]
    Auto,
    /// All cells have this number of levels above them.
    Levels(u32),
}

impl OctreeDepth {
    /// The greatest number of levels.
    pub const MAX_LEVELS: u32 = 16;
}

impl std::fmt::Display for OctreeDepth {
    fn fmt(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Auto => formatter.write_str("auto"),
            Self::Levels(levels) => write!(formatter, "{levels}"),
        }
    }
}

impl std::str::FromStr for OctreeDepth {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let levels = text.parse().ok().filter(|levels| (1..=Self::MAX_LEVELS).contains(levels));
        levels.map(Self::Levels).ok_or_else(|| Error::Setting {
            name: "octree depth",
            found: text.to_owned(),
            expected: "auto or a number of levels from 1 to 16",
        })
    }
}

//! Sources of point colours, their names and their colours in hexadecimal.

use crate::error::{Error, Result};
use crate::points::{PointCloud, Values};
use std::fmt;
use std::str::FromStr;

/// The column or value that the colours of points show.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// The colours of the file.
    Rgb,
    /// Intensity, mapped to colours.
    Intensity,
    /// Height along [`Coloring::up`](super::Coloring::up), mapped to colours.
    Elevation,
    /// Classification, in the usual colours of the classes.
    Class,
    /// Direction of the normal as (n + 1) / 2.
    Normal,
    /// Distance from each hit to the nearest point, mapped to colours. A point itself has the first colour.
    Support,
    /// One sRGB-encoded colour.
    Constant([u8; 3]),
    /// Another column, by its name, mapped to colours.
    Column(String),
}

impl ColorSource {
    /// True if the values of the source are names of things rather than amounts, so that no value lies between two
    /// others: classes and whole numbers.
    pub fn is_categorical(&self, cloud: &PointCloud) -> bool {
        match self {
            Self::Class => true,
            Self::Column(name) => {
                matches!(cloud.scalar(name), Some(Values::U8(_) | Values::U16(_) | Values::I32(_)))
            }
            _ => false,
        }
    }

    /// True if `cloud` has the column that the source needs.
    pub fn is_available_in(&self, cloud: &PointCloud) -> bool {
        match self {
            Self::Rgb => cloud.colors.is_some(),
            Self::Intensity => cloud.intensity.is_some(),
            Self::Class => cloud.classification.is_some(),
            Self::Normal => cloud.normals.is_some(),
            Self::Elevation | Self::Support | Self::Constant(_) => true,
            Self::Column(name) => cloud.scalar(name).is_some(),
        }
    }

    /// Returns the error for a cloud without the column that the source needs.
    pub(super) fn missing_from(&self, cloud: &PointCloud) -> Error {
        let mut known: Vec<&str> = vec!["elevation", "support", "#RRGGBB"];
        let columns = [
            ("rgb", Self::Rgb),
            ("intensity", Self::Intensity),
            ("class", Self::Class),
            ("normal", Self::Normal),
        ];
        known.extend(
            columns.iter().filter(|(_, color)| color.is_available_in(cloud)).map(|(name, _)| *name),
        );
        known.extend(cloud.scalars.iter().map(|scalar| scalar.name.as_str()));
        let kind = "column of this cloud";
        Error::UnknownName { kind, found: self.to_string(), known: known.join(", ") }
    }
}

impl fmt::Display for ColorSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rgb => f.write_str("rgb"),
            Self::Intensity => f.write_str("intensity"),
            Self::Elevation => f.write_str("elevation"),
            Self::Class => f.write_str("class"),
            Self::Normal => f.write_str("normal"),
            Self::Support => f.write_str("support"),
            Self::Constant([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
            Self::Column(name) => f.write_str(name),
        }
    }
}

impl FromStr for ColorSource {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let invalid = || Error::Setting {
            name: "color",
            found: text.to_owned(),
            expected: "rgb, intensity, elevation, class, normal, support, #RRGGBB or the name of a column",
        };
        match text.trim() {
            "" => Err(invalid()),
            "rgb" | "RGB" => Ok(Self::Rgb),
            "intensity" => Ok(Self::Intensity),
            "elevation" => Ok(Self::Elevation),
            "class" | "classification" => Ok(Self::Class),
            "normal" | "normals" => Ok(Self::Normal),
            "support" => Ok(Self::Support),
            color if color.starts_with('#') => {
                parse_hex(color).map(Self::Constant).ok_or_else(invalid)
            }
            name => Ok(Self::Column(name.to_owned())),
        }
    }
}

/// Parses `#RRGGBB` or `#RGB`; `None` if `text` is neither.
pub fn parse_hex(text: &str) -> Option<[u8; 3]> {
    let digits: Vec<u8> = text
        .strip_prefix('#')?
        .chars()
        .map(|digit| digit.to_digit(16).map(|digit| digit as u8))
        .collect::<Option<_>>()?;
    match digits[..] {
        [r, g, b] => Some([17 * r, 17 * g, 17 * b]),
        [r1, r0, g1, g0, b1, b0] => Some([16 * r1 + r0, 16 * g1 + g0, 16 * b1 + b0]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    //! Sources are parsed from their names and displayed by them.

    use super::*;

    #[test]
    fn sources_are_parsed_and_displayed_by_name() {
        for text in
            ["rgb", "intensity", "elevation", "class", "normal", "support", "#0a141e", "gps_time"]
        {
            assert_eq!(text.parse::<ColorSource>().unwrap().to_string(), text);
        }
        assert_eq!("#fff".parse::<ColorSource>().unwrap(), ColorSource::Constant([255; 3]));
        for text in ["", "#12345", "#ggg", "#éé"] {
            assert!(text.parse::<ColorSource>().is_err());
        }
    }
}

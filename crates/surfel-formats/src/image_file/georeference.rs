//! The place of a plan: its pixels in world coordinates, and the coordinate system.

/// The place of a plan: a picture without perspective, seen from straight above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Georeference {
    /// World coordinates of the upper left corner of the upper left pixel.
    pub corner: [f64; 2],
    /// From a pixel to the one at its right, in world coordinates.
    pub right: [f64; 2],
    /// From a pixel to the one below, in world coordinates.
    pub down: [f64; 2],
    /// The coordinate system, if it has a code.
    pub epsg: Option<EpsgCodes>,
    /// True if the coordinates are degrees of longitude and latitude.
    pub is_geographic: bool,
}

/// Codes of a coordinate system in the EPSG registry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EpsgCodes {
    /// The projected or geographic system.
    pub horizontal: u16,
    /// The system of heights.
    pub vertical: Option<u16>,
}

impl Georeference {
    /// Returns the world coordinates of a position in the picture, in pixels from its upper left corner.
    pub fn world(&self, x: f64, y: f64) -> [f64; 2] {
        [0, 1].map(|axis| self.corner[axis] + x * self.right[axis] + y * self.down[axis])
    }

    /// Returns true if north is up: rows go east, columns south.
    pub fn is_north_up(&self) -> bool {
        self.right[1] == 0.0 && self.down[0] == 0.0 && 0.0 < self.right[0] && self.down[1] < 0.0
    }

    /// Returns the text of a world file: the steps to the right and down, and the centre of the upper left pixel.
    pub fn world_file(&self) -> String {
        let center = self.world(0.5, 0.5);
        let [[a, d], [b, e], [c, f]] = [self.right, self.down, center];
        [a, d, b, e, c, f].map(|number| format!("{number}\n")).concat()
    }
}

/// Returns the extension of the world file of pictures with this extension: the first and last letter, and w.
pub fn world_file_extension(extension: &str) -> String {
    let mut letters = extension.chars();
    match (letters.next(), letters.next_back()) {
        (Some(first), Some(last)) => format!("{first}{last}w"),
        _ => "wld".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    //! World files as other programs read them.

    use super::*;

    #[test]
    fn a_world_file_names_the_centre_of_the_first_pixel() {
        let plan = Georeference {
            corner: [500_000.0, 4_100_000.0],
            right: [0.5, 0.0],
            down: [0.0, -0.5],
            epsg: None,
            is_geographic: false,
        };
        assert_eq!(plan.world_file(), "0.5\n0\n0\n-0.5\n500000.25\n4099999.75\n");
        assert!(plan.is_north_up());
        assert!(!Georeference { right: [0.0, 0.5], down: [0.5, 0.0], ..plan }.is_north_up());
        let names = ["png", "jpg", "jpeg", "tif", "webp", ""].map(world_file_extension);
        assert_eq!(names, ["pgw", "jgw", "jgw", "tfw", "wpw", "wld"]);
    }
}

//! Point data record formats by the fields that they have.

/// The fields that some point formats have and others lack. Waveforms are not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PointFields {
    /// True for the layout of LAS 1.4: up to 15 returns, 256 classes and finer scan angles. It always has times.
    pub is_extended: bool,
    /// True for GPS times.
    pub has_gps_time: bool,
    /// True for colours.
    pub has_color: bool,
    /// True for near infrared, which only extended formats with colours have.
    pub has_nir: bool,
}

impl PointFields {
    /// Returns the fields of a point format.
    pub fn of_format(format: u8) -> Self {
        Self {
            is_extended: 6 <= format,
            has_gps_time: !matches!(format, 0 | 2),
            has_color: matches!(format, 2 | 3 | 5 | 7 | 8 | 10),
            has_nir: matches!(format, 8 | 10),
        }
    }

    /// Returns the smallest point format with these fields.
    pub fn format(self) -> u8 {
        match (self.is_extended || self.has_nir, self.has_gps_time, self.has_color) {
            (true, _, _) if self.has_nir => 8,
            (true, _, has_color) => 6 + u8::from(has_color),
            (false, has_gps_time, has_color) => u8::from(has_gps_time) + 2 * u8::from(has_color),
        }
    }

    /// Returns the fields of both, in the larger layout.
    pub fn union(self, other: Self) -> Self {
        Self {
            is_extended: self.is_extended || other.is_extended,
            has_gps_time: self.has_gps_time || other.has_gps_time,
            has_color: self.has_color || other.has_color,
            has_nir: self.has_nir || other.has_nir,
        }
    }

    /// Returns the fields that both have, in the larger layout.
    pub fn intersection(self, other: Self) -> Self {
        Self {
            is_extended: self.is_extended || other.is_extended,
            has_gps_time: self.has_gps_time && other.has_gps_time,
            has_color: self.has_color && other.has_color,
            has_nir: self.has_nir && other.has_nir,
        }
    }

    /// Returns the minor version of LAS 1 that has the format, at least `minor_version`.
    pub fn minor_version(self, minor_version: u8) -> u8 {
        match (self.is_extended, self.has_color) {
            (true, _) => 4,
            (false, true) => minor_version.clamp(2, 4),
            (false, false) => minor_version.min(4),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Formats and their fields.

    use super::*;

    #[test]
    fn formats_follow_from_their_fields() {
        for format in [0, 1, 2, 3, 6, 7, 8] {
            assert_eq!(PointFields::of_format(format).format(), format);
        }
        let without_waveforms = [(4, 1), (5, 3), (9, 6), (10, 8)];
        for (format, expected) in without_waveforms {
            assert_eq!(PointFields::of_format(format).format(), expected);
        }
        let [legacy, extended] = [3, 8].map(PointFields::of_format);
        assert_eq!(
            (legacy.union(extended).format(), legacy.intersection(extended).format()),
            (8, 7)
        );
        assert_eq!((legacy.minor_version(0), extended.minor_version(1)), (2, 4));
    }
}

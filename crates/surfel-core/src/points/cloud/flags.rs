//! Flags of points, as LAS has them: set by scanners and by those who edit clouds.

/// Name of the scalar column that is 1 for points that are deleted but still in the file.
pub const WITHHELD: &str = "withheld";

/// Names of all scalar columns of flags. Where a cloud lacks one, it is 0 for all points.
pub const FLAGS: [&str; 7] = [
    "synthetic",
    "key_point",
    WITHHELD,
    "overlap",
    "scanner_channel",
    "scan_direction_flag",
    "edge_of_flight_line",
];

/// Returns true if a scalar column of this name holds flags; case does not matter.
pub fn is_flag(name: &str) -> bool {
    FLAGS.iter().any(|flag| flag.eq_ignore_ascii_case(name))
}

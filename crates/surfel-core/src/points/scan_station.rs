//! Stations: the places from which the scans of a cloud were measured.

use crate::math::DVec3;

/// Name of the scalar column that holds the index of each point's station.
pub const STATION: &str = "station";

/// A scan of a cloud, and the place of its scanner.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanStation {
    /// Name of the scan.
    pub name: String,
    /// World position of the scanner, if the file states it.
    pub position: Option<DVec3>,
}

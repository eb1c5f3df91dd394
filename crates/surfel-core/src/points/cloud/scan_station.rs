//! Stations: the places from which the scans of a cloud were measured.

use crate::math::{DQuat, DVec3};

/// Name of the scalar column that holds the index of each point's station.
pub const STATION: &str = "station";

/// Name of the scalar column that holds the row of each point in the grid of its scan, as in E57 files.
pub const ROW_INDEX: &str = "row_index";
/// Name of the scalar column that holds the column of each point in the grid of its scan.
pub const COLUMN_INDEX: &str = "column_index";

/// A scan of a cloud, and the place of its scanner.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanStation {
    /// Name of the scan.
    pub name: String,
    /// World position of the scanner, if the file states it.
    pub position: Option<DVec3>,
    /// Rotation from the scanner's axes to those of the world.
    pub rotation: DQuat,
    /// Numbers of rows and columns of the scan's grid, if it has one.
    pub grid: Option<[u64; 2]>,
}

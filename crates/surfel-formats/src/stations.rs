//! The stations of scans that a file holds one after the other.

use surfel_core::points::{PointCloud, STATION, Scalar, ScanStation, Values};

/// Maximum number of stations: as many as the column `station` can tell apart.
pub(crate) const MAX_STATIONS: usize = 1 << 16;

/// Sets the stations of a cloud that consists of scans of `n_scan_points` points each. A column of the file that has the
/// name of their indices is dropped, as it would be taken for them.
pub(crate) fn set_stations(
    cloud: &mut PointCloud,
    stations: Vec<ScanStation>,
    n_scan_points: &[usize],
) {
    cloud.scalars.retain(|scalar| !scalar.name.eq_ignore_ascii_case(STATION));
    if 1 < stations.len() {
        let scans = n_scan_points.iter().enumerate();
        let column = scans.flat_map(|(scan, n)| std::iter::repeat_n(scan as u16, *n)).collect();
        cloud.scalars.push(Scalar { name: STATION.into(), values: Values::U16(column) });
    }
    cloud.stations = stations;
}

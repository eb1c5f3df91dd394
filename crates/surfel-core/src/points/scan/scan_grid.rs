//! Grids of scans: the rays of a scanner in rows and columns, with the point that each measured.

use crate::error::Result;
use crate::math::{DQuat, DVec3, Vec3};
use crate::points::cloud::point_cloud::ScanOfPoint;
use crate::points::{COLUMN_INDEX, PointCloud, ROW_INDEX, Values, is_valid_position};
use crate::progress::Progress;
use rayon::prelude::*;

/// Marks a ray without a point.
pub const NO_POINT: u32 = u32::MAX;
/// Maximum number of rays for each point of a scan, and further ones: indices that claim a larger grid are no grid.
const MAX_RAYS_PER_POINT: usize = 16;
const MAX_FURTHER_RAYS: usize = 4096;

/// The grid of the rays of one scan, as far as they have points.
pub struct ScanGrid {
    /// Position of the scanner, relative to the origin of the cloud.
    pub station: Vec3,
    /// Rotation from the scanner's axes to those of the world.
    pub rotation: DQuat,
    /// Number of rows.
    pub n_rows: usize,
    /// Number of columns.
    pub n_columns: usize,
    /// Indices of the points row by row, [`NO_POINT`] where there is none.
    points: Vec<u32>,
}

/// The grids of the scans of a cloud.
pub struct ScanGrids {
    /// Grids by the index of their station; none for a scan without a grid.
    pub scans: Vec<Option<ScanGrid>>,
}

/// The extent of a grid's indices, and the number of its points.
#[derive(Clone, Copy)]
struct Extent {
    first: [u32; 2],
    last: [u32; 2],
    n_points: usize,
}

impl ScanGrids {
    /// Returns the grids of the scans whose station is known; `None` if there are none.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(cloud: &PointCloud, progress: &dyn Progress) -> Result<Option<Self>> {
        let columns = [cloud.scalar(ROW_INDEX), cloud.scalar(COLUMN_INDEX)];
        let ([Some(rows), Some(columns)], Some(scan_of)) = (columns, cloud.scan_of_point()) else {
            return Ok(None);
        };
        let indices = [rows, columns];
        let extents = extents(cloud, indices, &scan_of, progress)?;
        let grid = |(station, extent): (&crate::points::ScanStation, Extent)| {
            let position = (station.position? - cloud.origin).as_vec3();
            ScanGrid::empty(position, station.rotation, &extent)
        };
        let mut scans: Vec<Option<ScanGrid>> =
            cloud.stations.iter().zip(extents.iter().copied()).map(grid).collect();
        for point in 0..cloud.len() {
            check_each(point, progress)?;
            let Some(cell) = cell(cloud, indices, point) else { continue };
            let scan = scan_of.get(point);
            if let (Some(Some(grid)), Some(extent)) = (scans.get_mut(scan), extents.get(scan)) {
                let [row, column] = [0, 1].map(|axis| (cell[axis] - extent.first[axis]) as usize);
                let slot = &mut grid.points[row * grid.n_columns + column];
                // Several returns of a ray are in their order.
                *slot = (*slot).min(point as u32);
            }
        }
        Ok(scans.iter().any(Option::is_some).then_some(Self { scans }))
    }
}

impl ScanGrid {
    /// Returns a grid without points; `None` if its indices claim too many rays.
    fn empty(station: Vec3, rotation: DQuat, extent: &Extent) -> Option<Self> {
        let size = [0, 1].map(|axis| extent.last[axis].checked_sub(extent.first[axis]));
        let [n_rows, n_columns] = [size[0]? as usize + 1, size[1]? as usize + 1];
        let n_rays = n_rows.checked_mul(n_columns)?;
        let max_rays = MAX_RAYS_PER_POINT.checked_mul(extent.n_points)?;
        if max_rays.checked_add(MAX_FURTHER_RAYS)? < n_rays {
            return None;
        }
        let points = vec![NO_POINT; n_rays];
        Some(Self { station, rotation, n_rows, n_columns, points })
    }

    /// Returns the point of a ray; `None` beyond the grid and where the ray measured nothing.
    pub fn point(&self, row: isize, column: isize) -> Option<usize> {
        let (row, column) = (usize::try_from(row).ok()?, usize::try_from(column).ok()?);
        if self.n_rows <= row || self.n_columns <= column {
            return None;
        }
        let point = self.points[row * self.n_columns + column];
        (point != NO_POINT).then_some(point as usize)
    }

    /// Returns the points with their rows and columns.
    pub fn cells(&self) -> impl Iterator<Item = ([usize; 2], usize)> {
        let cells = self.points.iter().enumerate().filter(|(_, point)| **point != NO_POINT);
        cells.map(|(i, point)| ([i / self.n_columns, i % self.n_columns], *point as usize))
    }

    /// Returns true if most points have most of their eight neighbours, as in a scan of which no points were left out.
    pub fn is_dense(&self) -> bool {
        const MIN_NEIGHBORS: usize = 4;
        let of_row = |row: usize| {
            let row = row as isize;
            let columns = 0..self.n_columns as isize;
            let columns = columns.filter(|column| self.point(row, *column).is_some());
            let n_neighbors = columns.map(|column| {
                let around = (0..9).map(|i| self.point(row + i / 3 - 1, column + i % 3 - 1));
                around.flatten().count() - 1
            });
            n_neighbors.fold((0, 0), |(n_points, n_neighbors), n| (n_points + 1, n_neighbors + n))
        };
        let add = |a: (usize, usize), b: (usize, usize)| (a.0 + b.0, a.1 + b.1);
        let rows = (0..self.n_rows).into_par_iter();
        let (n_points, n_neighbors) = rows.map(of_row).reduce(|| (0, 0), add);
        MIN_NEIGHBORS * n_points <= n_neighbors
    }

    /// Returns a position in the scanner's axes.
    pub fn measured(&self, position: Vec3) -> DVec3 {
        self.rotation.inverse() * (position - self.station).as_dvec3()
    }
}

/// Returns row and column of a point, if they are indices and the point was measured.
fn cell(cloud: &PointCloud, indices: [&Values; 2], point: usize) -> Option<[u32; 2]> {
    let [row, column] = indices.map(|values| {
        let index = values.get(point);
        (0.0..f64::from(u32::MAX)).contains(&index).then_some(index as u32)
    });
    is_valid_position(cloud.positions[point]).then_some([row?, column?])
}

/// Returns the extent of the grid of each scan.
fn extents(
    cloud: &PointCloud,
    indices: [&Values; 2],
    scan_of: &ScanOfPoint,
    progress: &dyn Progress,
) -> Result<Vec<Extent>> {
    let none = Extent { first: [u32::MAX; 2], last: [0; 2], n_points: 0 };
    let mut extents = vec![none; cloud.stations.len()];
    for point in 0..cloud.len() {
        check_each(point, progress)?;
        let Some(cell) = cell(cloud, indices, point) else { continue };
        if let Some(extent) = extents.get_mut(scan_of.get(point)) {
            for (axis, index) in cell.into_iter().enumerate() {
                extent.first[axis] = extent.first[axis].min(index);
                extent.last[axis] = extent.last[axis].max(index);
            }
            extent.n_points += 1;
        }
    }
    Ok(extents)
}

/// Checks for cancellation at some of the points.
fn check_each(point: usize, progress: &dyn Progress) -> Result<()> {
    if point.is_multiple_of(1 << 16) { progress.check() } else { Ok(()) }
}

#[cfg(test)]
pub(crate) mod tests {
    //! Grids of known size, and of broken indices.

    use super::*;
    use crate::points::{STATION, Scalar, ScanStation};
    use crate::progress::NoProgress;

    /// Returns a scan from the origin of a grid of rays 0.01 apart along +X, at the distances that `range` tells by row
    /// and column.
    pub fn scan(
        n_rows: usize,
        n_columns: usize,
        range: impl Fn(usize, usize) -> Option<f32>,
    ) -> PointCloud {
        let (mut positions, mut rows, mut columns) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..n_rows {
            for column in 0..n_columns {
                let Some(range) = range(row, column) else { continue };
                let azimuth = 0.01 * (column as f32 - 0.5 * n_columns as f32);
                let elevation = 0.01 * (row as f32 - 0.5 * n_rows as f32);
                let (level, up) = (elevation.cos(), elevation.sin());
                let direction = Vec3::new(level * azimuth.cos(), level * azimuth.sin(), up);
                positions.push(range * direction);
                rows.push(row as i32);
                columns.push(column as i32);
            }
        }
        let index = |name: &str, values| Scalar { name: name.into(), values: Values::I32(values) };
        PointCloud {
            scalars: vec![index(ROW_INDEX, rows), index(COLUMN_INDEX, columns)],
            stations: vec![ScanStation { position: Some(DVec3::ZERO), ..ScanStation::default() }],
            ..PointCloud::from_positions(positions)
        }
    }

    fn single(cloud: &PointCloud) -> Option<ScanGrid> {
        ScanGrids::new(cloud, &NoProgress).unwrap()?.scans.pop()?
    }

    #[test]
    fn each_ray_has_its_point() {
        let cloud = scan(5, 7, |row, column| (row != 2 || column != 3).then_some(4.0));
        let grid = single(&cloud).unwrap();
        assert_eq!((grid.n_rows, grid.n_columns, grid.cells().count()), (5, 7, 34));
        for ([row, column], point) in grid.cells() {
            assert_eq!(cloud.scalar(ROW_INDEX).unwrap().get(point), row as f64);
            assert_eq!(grid.point(row as isize, column as isize), Some(point));
        }
        for (row, column) in [(2, 3), (-1, 0), (0, -1), (5, 0), (0, 7)] {
            assert_eq!(grid.point(row, column), None);
        }
        assert_eq!(single(&scan(1, 1, |_, _| Some(1.0))).unwrap().cells().count(), 1);
    }

    #[test]
    fn scans_without_a_station_or_a_grid_have_none() {
        let whole = || scan(4, 4, |_, _| Some(1.0));
        let mut cloud = whole();
        cloud.stations.clear();
        assert!(single(&cloud).is_none());
        cloud = whole();
        cloud.stations.push(ScanStation::default());
        assert!(single(&cloud).is_none(), "no column tells which station is whose");
        cloud = whole();
        cloud.scalars.pop();
        assert!(single(&cloud).is_none());
        assert!(single(&scan(3, 3, |_, _| None)).is_none());
    }

    #[test]
    fn broken_indices_take_no_memory() {
        for index in [i32::MAX, -1] {
            let mut cloud = scan(4, 4, |_, _| Some(1.0));
            let Values::I32(rows) = &mut cloud.scalars[0].values else { unreachable!() };
            rows[3] = index;
            let grid = single(&cloud);
            assert_eq!(grid.map(|grid| grid.cells().count()), (index < 0).then_some(15));
        }
        let mut cloud = scan(4, 4, |_, _| Some(1.0));
        cloud.scalars[0].values = Values::F64(vec![f64::NAN; 16]);
        assert!(single(&cloud).is_none());
        cloud = scan(4, 4, |_, _| Some(1.0));
        cloud.scalars[1].values = Values::F64([vec![0.0; 15], vec![f64::MAX]].concat());
        assert_eq!(single(&cloud).unwrap().n_columns, 1);
        cloud.stations.push(cloud.stations[0].clone());
        let stations = vec![u16::MAX; 16];
        cloud.scalars.push(Scalar { name: STATION.into(), values: Values::U16(stations) });
        assert!(single(&cloud).is_none());
    }
}

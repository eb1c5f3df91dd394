//! Scans as ranges along rays: the space that a scanner saw through.

use crate::error::Result;
use crate::math::{DVec3, Vec3};
use crate::points::scan::grid_rays::GridRays;
use crate::points::scan::scan_grid::ScanGrid;
use crate::points::structure::point_shape::{PointShape, Structure};
use crate::progress::Progress;
use rayon::prelude::*;

/// Maximum distance, in rows and columns, of the rays that are looked at.
const MAX_REACH: usize = 8;
/// Ratio of the ranges of neighbouring rays from which one may have seen through a gap beside the other.
const JUMP_RATIO: f32 = 1.1;
/// Minimum cosine of a ray's angle to a disc's normal: those along a disc pass it at an uncertain place.
const MIN_RAY_COSINE: f64 = 0.15;
/// Minimum distance, in radii, from the shape that a ray passed to what it measured.
const MIN_DEPTH: f32 = 1.0;
/// Maximum height of another point of the surface over a disc, in radii.
const MAX_HEIGHT: f32 = 0.5;
/// Minimum cosine of the angle between a ray that passed a disc and a point behind it, seen from the disc's centre.
const MIN_BRIDGE_COSINE: f32 = 0.8;
/// Minimum ratio of the rays that passed before more of the surface to the rays that met it, all within a disc. Through
/// a closed surface that is seen at an angle a few rays seem to pass.
const MIN_BRIDGED: f32 = 0.25;
/// Maximum radius of a disc in distances between rays on its plane, which close the surface of a scan.
const MAX_RADIUS: f32 = 2.0;
/// Minimum cosine of the incidence that these distances grow with.
const MIN_INCIDENCE_COSINE: f32 = 0.2;

/// A scan as ranges along the rays of its grid.
pub struct SeenScan<'a> {
    grid: &'a ScanGrid,
    rays: GridRays,
    /// Range of each ray, row by row, infinite for one that measured nothing.
    ranges: Vec<f32>,
    /// True for rays with a jump of the range within reach.
    is_near_jump: Vec<bool>,
}

/// A ray that passed a shape.
pub struct FreeRay {
    /// Offset from the point to the place where it did.
    pub offset: Vec3,
    /// True if further points of the surface lie behind that place.
    pub is_bridged: bool,
}

impl<'a> SeenScan<'a> {
    /// Returns the ranges of a scan; `None` if the directions of rays without a point are not known, or if so many are
    /// absent that points were left out of the scan since.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
    pub fn new(
        grid: &'a ScanGrid,
        positions: &[Vec3],
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        progress.check()?;
        if !grid.is_dense() {
            return Ok(None);
        }
        progress.check()?;
        let Some(rays) = GridRays::new(grid, positions) else { return Ok(None) };
        progress.check()?;
        let mut ranges = vec![f32::INFINITY; grid.n_rows * grid.n_columns];
        for ([row, column], point) in grid.cells() {
            ranges[row * grid.n_columns + column] = positions[point].distance(grid.station);
        }
        progress.check()?;
        let mut is_near_jump = jumps(&ranges, grid.n_columns);
        is_near_jump.par_chunks_mut(grid.n_columns).for_each(|row| dilate(row, 1));
        progress.check()?;
        dilate(&mut is_near_jump, grid.n_columns);
        Ok(Some(Self { grid, rays, ranges, is_near_jump }))
    }

    /// Returns the distance between neighbouring rays on a surface with this normal.
    fn spacing(&self, position: Vec3, normal: Vec3) -> f32 {
        let step = self.rays.steps_rad().into_iter().fold(0.0, f64::max) as f32;
        let offset = position - self.grid.station;
        let range = offset.length();
        range * step / (offset.dot(normal) / range).abs().max(MIN_INCIDENCE_COSINE)
    }

    /// Limits the radii of the scan's discs to what closes a surface between rays: among few neighbours, as at leaves,
    /// the distance to the twelfth is far larger.
    pub fn limit_radii(&self, positions: &[Vec3], shapes: &mut [PointShape]) {
        for (_, point) in self.grid.cells() {
            let shape = &mut shapes[point];
            let limit = MAX_RADIUS * self.spacing(positions[point], shape.normal);
            if shape.structure == Structure::Surface && 0.0 < limit {
                shape.radius = shape.radius.min(limit);
            }
        }
    }

    /// Returns the rays that passed the shape of a point.
    pub fn free_rays(&self, position: Vec3, shape: &PointShape) -> Vec<FreeRay> {
        let measured = self.grid.measured(position);
        let Some(window) = self.window(measured, shape.radius) else { return Vec::new() };
        let normal = self.grid.rotation.inverse() * shape.normal.as_dvec3();
        let distance = measured.length() as f32;
        let mut rays = Vec::new();
        for (row, column) in window.clone() {
            let range = self.ranges[row * self.grid.n_columns + column];
            // Most rays of a window end at the shape's own surface.
            if range <= distance {
                continue;
            }
            let direction = self.rays.direction(row, column);
            let Some(along) = passage(measured, normal, shape, direction) else { continue };
            let offset = along * direction - measured;
            let is_free = along as f32 + MIN_DEPTH * shape.radius < range;
            if is_free && offset.length() as f32 <= shape.radius {
                rays.push(FreeRay { offset: offset.as_vec3(), is_bridged: true });
            }
        }
        if shape.is_disc() && !rays.is_empty() {
            let others = window.filter_map(|(row, column)| self.point(row, column));
            let others = others.map(|other| (other - measured).as_vec3());
            let height = |offset: &Vec3| offset.dot(normal.as_vec3()).abs();
            let others = others.filter(|offset| height(offset) < MAX_HEIGHT * shape.radius);
            find_bridged(&mut rays, &others.collect::<Vec<_>>(), shape.radius);
        }
        let world = |offset: Vec3| (self.grid.rotation * offset.as_dvec3()).as_vec3();
        rays.iter_mut().for_each(|ray| ray.offset = world(ray.offset));
        rays
    }

    /// Returns the cells of the rays near a position, if some of them may have passed it.
    fn window(
        &self,
        measured: DVec3,
        radius: f32,
    ) -> Option<impl Iterator<Item = (usize, usize)> + Clone + use<>> {
        let distance = measured.length();
        let cell = self.rays.cell(measured).map(f64::round);
        let size = [self.grid.n_rows, self.grid.n_columns];
        let is_inside = (0..2).all(|axis| 0.0 <= cell[axis] && cell[axis] < size[axis] as f64);
        if !is_inside || distance <= 0.0 {
            return None;
        }
        let [row, column] = cell.map(|index| index as usize);
        let own = row * size[1] + column;
        // A scan that saw through the point itself missed something thin.
        let is_refuted = distance as f32 + 2.0 * radius < self.ranges[own];
        if !self.is_near_jump[own] || is_refuted {
            return None;
        }
        let steps = self.rays.steps_rad();
        let level = measured.truncate().length() / distance;
        let near = |index: usize, axis: usize| {
            let cells = f64::from(radius) / (distance * steps[axis] * level.max(0.1));
            let reach = (cells.ceil() as usize).min(MAX_REACH);
            index.saturating_sub(reach)..(index + reach + 1).min(size[axis])
        };
        let (rows, columns) = (near(row, 0), near(column, 1));
        Some(rows.flat_map(move |row| columns.clone().map(move |column| (row, column))))
    }

    /// Returns the point of a ray in the scanner's axes.
    fn point(&self, row: usize, column: usize) -> Option<DVec3> {
        let range = self.ranges[row * self.grid.n_columns + column];
        range.is_finite().then(|| f64::from(range) * self.rays.direction(row, column))
    }
}

/// Finds the rays that passed between the centre of a disc and one of the other points at these offsets; none if far more
/// rays met the disc.
fn find_bridged(rays: &mut [FreeRay], others: &[Vec3], radius: f32) {
    for ray in &mut *rays {
        let length = ray.offset.length();
        ray.is_bridged = others.iter().any(|other| {
            let along = ray.offset.dot(*other);
            length * length < along && MIN_BRIDGE_COSINE * length * other.length() < along
        });
    }
    let n_met = others.iter().filter(|other| other.length() < radius).count();
    let n_bridged = rays.iter().filter(|ray| ray.is_bridged).count();
    if (n_bridged as f32) < MIN_BRIDGED * n_met as f32 {
        rays.iter_mut().for_each(|ray| ray.is_bridged = false);
    }
}

/// Returns how far from the scanner a ray passes a shape at `measured`; `None` for a ray along a disc.
fn passage(measured: DVec3, normal: DVec3, shape: &PointShape, direction: DVec3) -> Option<f64> {
    if !shape.is_disc() {
        return Some(measured.dot(direction));
    }
    let facing = direction.dot(normal);
    (MIN_RAY_COSINE <= facing.abs()).then(|| measured.dot(normal) / facing)
}

/// Returns true for rays whose right or lower neighbour measured another surface.
fn jumps(ranges: &[f32], n_columns: usize) -> Vec<bool> {
    let differ = |a: f32, b: f32| JUMP_RATIO * a.min(b) < a.max(b);
    let is_jump = |(i, range): (usize, &f32)| {
        let right = if (i + 1) % n_columns == 0 { None } else { ranges.get(i + 1) };
        let below = ranges.get(i + n_columns);
        right.into_iter().chain(below).any(|other| differ(*range, *other))
    };
    ranges.par_iter().enumerate().map(is_jump).collect()
}

/// Sets all flags within reach of one that is set, along each column of rows of `n_columns` flags.
fn dilate(flags: &mut [bool], n_columns: usize) {
    let n_rows = flags.len() / n_columns;
    let mut reached = vec![false; flags.len()];
    for is_backward in [false, true] {
        let mut last = vec![None; n_columns];
        for step in 0..n_rows {
            let row = if is_backward { n_rows - 1 - step } else { step };
            let cells = row * n_columns..(row + 1) * n_columns;
            let row = flags[cells.clone()].iter().zip(&mut reached[cells]);
            for ((is_set, is_reached), last) in row.zip(&mut last) {
                if *is_set {
                    *last = Some(step);
                }
                *is_reached |= last.is_some_and(|last| step - last <= MAX_REACH + 1);
            }
        }
    }
    flags.copy_from_slice(&reached);
}

#[cfg(test)]
mod tests {
    //! Rays beside a wall that ends, and flags near jumps.

    use super::*;
    use crate::points::scan::scan_grid::ScanGrids;
    use crate::points::scan::scan_grid::tests::scan;
    use crate::progress::NoProgress;

    fn disc(radius: f32) -> PointShape {
        PointShape { structure: Structure::Surface, normal: Vec3::X, radius }
    }

    fn grid(cloud: &crate::points::PointCloud) -> ScanGrid {
        let grids = ScanGrids::new(cloud, &NoProgress).unwrap();
        grids.unwrap().scans.pop().unwrap().unwrap()
    }

    /// Returns the free rays of the disc at a row and column of a scan.
    fn free_rays(cloud: &crate::points::PointCloud, cell: [isize; 2], radius: f32) -> Vec<FreeRay> {
        let grid = grid(cloud);
        let seen = SeenScan::new(&grid, &cloud.positions, &NoProgress).unwrap().unwrap();
        let point = grid.point(cell[0], cell[1]).unwrap();
        seen.free_rays(cloud.positions[point], &disc(radius))
    }

    /// Returns a scan of a wall at x = 4 whose rays 0.04 m apart pass where `is_open`.
    fn wall(is_open: impl Fn(usize) -> bool) -> crate::points::PointCloud {
        let range = |row: usize, column: usize| {
            let [azimuth, elevation] = [column, row].map(|index| 0.01 * (index as f32 - 30.0));
            (!is_open(column)).then(|| 4.0 / (azimuth.cos() * elevation.cos()))
        };
        scan(60, 60, range)
    }

    #[test]
    fn a_disc_is_bridged_only_if_the_surface_goes_on_behind_the_gap() {
        let gap = wall(|column| (30..32).contains(&column));
        let rays = free_rays(&gap, [30, 29], 0.17);
        assert!(rays.iter().any(|ray| ray.is_bridged));
        let nearest = rays.iter().map(|ray| ray.offset.length()).fold(f32::MAX, f32::min);
        assert!((nearest - 0.04).abs() < 0.002, "{nearest}");
        let end = wall(|column| (30..55).contains(&column));
        let rays = free_rays(&end, [30, 29], 0.17);
        assert!(!rays.is_empty() && rays.iter().all(|ray| !ray.is_bridged));
        assert!(free_rays(&end, [30, 10], 0.17).is_empty());
        assert!(free_rays(&end, [30, 29], 0.03).is_empty());
    }

    #[test]
    fn radii_are_limited_by_the_distance_between_rays() {
        let cloud = wall(|_| false);
        let grid = grid(&cloud);
        let seen = SeenScan::new(&grid, &cloud.positions, &NoProgress).unwrap().unwrap();
        let mut shapes = vec![disc(1.0); cloud.len()];
        shapes[7].structure = Structure::Line;
        shapes[8].radius = 0.01;
        seen.limit_radii(&cloud.positions, &mut shapes);
        assert_eq!((shapes[7].radius, shapes[8].radius), (1.0, 0.01));
        let middle = grid.point(30, 30).unwrap();
        assert!((shapes[middle].radius - 0.08).abs() < 0.001, "{}", shapes[middle].radius);
    }

    #[test]
    fn thinned_scans_tell_nothing() {
        let cloud = wall(|column| column % 2 == 1);
        let grid = grid(&cloud);
        assert!(SeenScan::new(&grid, &cloud.positions, &NoProgress).unwrap().is_none());
    }

    #[test]
    fn flags_are_set_within_reach() {
        for at in [0, 20, 59] {
            let mut flags = vec![false; 60];
            flags[at] = true;
            dilate(&mut flags, 1);
            let expected = |i: usize| i.abs_diff(at) <= MAX_REACH + 1;
            assert!(flags.iter().enumerate().all(|(i, flag)| *flag == expected(i)));
        }
        let mut flags = [true, false, false, false];
        dilate(&mut flags, 2);
        assert_eq!(flags, [true, false, true, false]);
    }
}

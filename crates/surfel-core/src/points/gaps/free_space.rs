//! Free space: no surface bridges what a scanner saw through.
//!
//! A ray that measured something far behind a disc, or nothing at all, passed the disc's plane where there is nothing.
//! If more of the surface lies behind that place, the disc is narrowed until it ends before the ray.

use super::seen_scan::{FreeRay, SeenScan};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
use crate::points::normals::planes::PlaneFit;
use crate::points::scan::scan_grid::ScanGrids;
use crate::points::structure::point_shape::{PointShape, Structure, is_line};
use crate::points::structure::solids::apply_structure;
use crate::progress::Progress;
use crate::words::counted;
use rayon::prelude::*;

/// Minimum ratio of a narrowed to the original radius: at less, the points of an even surface no longer overlap.
const MIN_NARROWING: f32 = 0.6;
/// Maximum distance, in radii, of the rays on both sides of a line that was widened to a surface.
const MAX_SIDE_DISTANCE: f32 = 0.5;

/// Effect of [`FreeSpace::narrow`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FreeSpaceReport {
    /// Number of shapes that are narrower now.
    pub n_narrowed: usize,
    /// Number of points that were taken for a surface and are a line.
    pub n_lines: usize,
}

impl FreeSpaceReport {
    /// Returns a line about the shapes for the user, if any changed.
    pub fn line(&self) -> Option<String> {
        let Self { n_narrowed, n_lines } = self;
        let n_changed = n_narrowed + n_lines;
        (0 < n_changed).then(|| {
            let points = counted(n_changed, "point");
            format!("scanners saw past {points}: {n_narrowed} narrowed, {n_lines} made lines")
        })
    }

    fn add(self, other: Self) -> Self {
        Self {
            n_narrowed: self.n_narrowed + other.n_narrowed,
            n_lines: self.n_lines + other.n_lines,
        }
    }
}

/// The space through which the scanners of a cloud saw.
#[derive(Default)]
pub struct FreeSpace<'a> {
    scans: Vec<SeenScan<'a>>,
}

impl<'a> FreeSpace<'a> {
    /// Returns what the scans with a grid tell about the points at `positions`.
    pub fn new(grids: &'a ScanGrids, positions: &[Vec3], progress: &dyn Progress) -> Result<Self> {
        let mut scans = Vec::new();
        for grid in grids.scans.iter().flatten() {
            scans.extend(SeenScan::new(grid, positions, progress)?);
        }
        Ok(Self { scans })
    }

    /// Narrows the shapes that reach into space through which the scanners saw. Lines that were widened to a surface,
    /// on both sides of which the scanners saw through, become lines again; `fits` are the planes of the points'
    /// nearest neighbours.
    pub fn narrow(
        &self,
        tree: &KdTree,
        fits: &[PlaneFit],
        shapes: &mut [PointShape],
        progress: &dyn Progress,
    ) -> Result<FreeSpaceReport> {
        if self.scans.is_empty() {
            return Ok(FreeSpaceReport::default());
        }
        progress.begin("free space", shapes.len() as u64);
        let n_points = shapes.len();
        let narrow = |(point, shape): (usize, &mut PointShape)| {
            if point.is_multiple_of(4096) {
                progress.check()?;
                progress.advance(4096.min(n_points - point) as u64);
            }
            let found = narrowed(&self.scans, tree, point, fits.get(point), shape);
            let is_new_line = found.structure != shape.structure;
            let is_narrowed = !is_new_line && found.radius < shape.radius;
            *shape = found;
            let n_lines = usize::from(is_new_line);
            Ok(FreeSpaceReport { n_narrowed: usize::from(is_narrowed), n_lines })
        };
        let narrowed = shapes.par_iter_mut().enumerate().map(narrow);
        let report = narrowed.try_reduce(FreeSpaceReport::default, |a, b| Ok(a.add(b)))?;
        // Not before, as a line that was widened too far is told by its width.
        self.scans.iter().for_each(|scan| scan.limit_radii(tree.positions(), shapes));
        Ok(report)
    }

    /// Returns the radius of a disc up to the nearest place where a scanner saw through it.
    pub fn free_radius(&self, position: Vec3, shape: &PointShape) -> f32 {
        let rays = self.scans.iter().flat_map(|scan| scan.free_rays(position, shape));
        nearest_bridged(rays, shape.radius)
    }
}

/// Returns the shape of a point as far as no scanner saw through it.
fn narrowed(
    scans: &[SeenScan],
    tree: &KdTree,
    point: usize,
    fit: Option<&PlaneFit>,
    shape: &PointShape,
) -> PointShape {
    let position = tree.positions()[point];
    let rays = scans.iter().flat_map(|scan| scan.free_rays(position, shape));
    let rays: Vec<FreeRay> = rays.collect();
    if rays.is_empty() {
        return *shape;
    }
    let is_widened = shape.is_disc() && fit.is_some_and(is_line);
    if is_widened && let Some(line) = as_line(&rays, tree, point, shape) {
        return line;
    }
    let radius = nearest_bridged(rays, shape.radius).max(MIN_NARROWING * shape.radius);
    PointShape { radius, ..*shape }
}

/// Returns the distance of the nearest ray beyond which the surface goes on, or `radius` if that is less.
fn nearest_bridged(rays: impl IntoIterator<Item = FreeRay>, radius: f32) -> f32 {
    let bridged = rays.into_iter().filter(|ray| ray.is_bridged);
    bridged.map(|ray| ray.offset.length()).fold(radius, f32::min)
}

/// Returns the line through a point, if scanners saw through its disc close to both sides of the line.
fn as_line(
    rays: &[FreeRay],
    tree: &KdTree,
    point: usize,
    shape: &PointShape,
) -> Option<PointShape> {
    let mut line = *shape;
    apply_structure(tree, point, shape.radius, Structure::Line, &mut line);
    let across = shape.normal.cross(line.normal);
    let is_near = |ray: &&FreeRay| ray.offset.length() < MAX_SIDE_DISTANCE * shape.radius;
    let mut sides = rays.iter().filter(is_near).map(|ray| ray.offset.dot(across));
    let has_left = sides.clone().any(|side| side < 0.0);
    (has_left && sides.any(|side| 0.0 < side)).then_some(line)
}

#[cfg(test)]
mod tests {
    //! Discs and lines that scanners saw past.

    use super::*;
    use crate::points::scan::scan_grid::tests::scan;
    use crate::points::{PointCloud, Preparation, prepare};
    use crate::progress::NoProgress;

    /// Returns a scan of a wall below two wires and a row of points above them, all at 8 m, and the number of points of
    /// the wall.
    fn wall_and_wires() -> (PointCloud, usize) {
        let is_seen = |row: usize| row < 20 || [30, 36, 45].contains(&row);
        (scan(46, 100, |row, _| is_seen(row).then_some(8.0)), 20 * 100)
    }

    /// Returns wide discs for all points, whose neighbourhoods are those of `fits`, after they were narrowed.
    fn narrowed_shapes(
        cloud: &PointCloud,
        fits: &[PlaneFit],
    ) -> (Vec<PointShape>, FreeSpaceReport) {
        let tree = KdTree::new(&cloud.positions, &NoProgress).unwrap();
        let shape = PointShape { structure: Structure::Surface, normal: Vec3::X, radius: 0.5 };
        let mut shapes = vec![shape; cloud.len()];
        let grids = ScanGrids::new(cloud, &NoProgress).unwrap();
        let free_space = grids.as_ref().map_or_else(FreeSpace::default, |grids| {
            FreeSpace::new(grids, &cloud.positions, &NoProgress).unwrap()
        });
        let report = free_space.narrow(&tree, fits, &mut shapes, &NoProgress).unwrap();
        (shapes, report)
    }

    #[test]
    fn lines_that_were_taken_for_a_surface_are_lines_again() {
        let (cloud, n_wall) = wall_and_wires();
        let plane = PlaneFit { normal: Vec3::X, variation: 0.0, width: 1.0, is_smooth: false };
        let line = PlaneFit { width: 0.01, ..plane };
        let fits = [vec![plane; n_wall], vec![line; cloud.len() - n_wall]].concat();
        let (shapes, report) = narrowed_shapes(&cloud, &fits);
        assert!(shapes[..n_wall].iter().all(|shape| shape.structure == Structure::Surface));
        let middle = n_wall + 20..n_wall + 80;
        for (point, shape) in middle.clone().zip(&shapes[middle]) {
            assert_eq!(shape.structure, Structure::Line);
            let along = Vec3::new(-cloud.positions[point].y, cloud.positions[point].x, 0.0);
            assert!(0.99 < shape.normal.dot(along.normalize()).abs(), "{point}: {shape:?}");
            assert!((0.07..0.09).contains(&shape.radius), "{point}: {shape:?}");
        }
        assert_eq!(report.n_lines, 200);
        assert_eq!(narrowed_shapes(&cloud, &vec![plane; cloud.len()]).1.n_lines, 0);
    }

    #[test]
    fn scans_without_a_grid_and_clouds_on_request_stay_as_they_are() {
        let (mut cloud, _) = wall_and_wires();
        let radii = |cloud: &PointCloud, free_space: bool| {
            let preparation = Preparation { free_space, ..Preparation::default() };
            prepare(cloud.clone(), &preparation, &NoProgress).unwrap().0.radii().to_vec()
        };
        let (with, without) = (radii(&cloud, true), radii(&cloud, false));
        assert!(with != without && with.iter().zip(&without).all(|(a, b)| a <= b));
        cloud.stations.clear();
        assert_eq!(radii(&cloud, true), without);
        let (shapes, report) = narrowed_shapes(&cloud, &[]);
        assert!(shapes.iter().all(|shape| shape.radius == 0.5));
        assert_eq!((report, report.line()), (FreeSpaceReport::default(), None));
    }
}

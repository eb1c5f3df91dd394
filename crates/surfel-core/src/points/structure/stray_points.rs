//! Stray points far from all surfaces: echoes around aerial scans, spikes of sonars, wrong features of photographs, wires.
//!
//! There may be so many of them that the median of their own radii is as large as the empty space around them, and that
//! some of them lie in a plane by chance. They are compared with the discs of the nearest surface.

use super::point_shape::{PointShape, Structure, is_line};
use super::solids::{N_LINE_NEIGHBORS, apply_structure};
use crate::error::Result;
use crate::math::{Vec3, sampled_quantile};
use crate::points::neighbors::KdTree;
use crate::points::normals::planes::fit_plane;
use crate::progress::Progress;
use rayon::prelude::*;

/// Minimum fraction of the points on surfaces of a cloud that has stray points: those of a forest all stand for themselves.
const MIN_ON_SURFACES: f32 = 0.4;
/// Fraction of the discs, from the smallest on, that a stray point is compared with: chance makes surfaces of a few stray
/// points, too.
const TRUSTED_DISCS: f64 = 0.95;
/// Maximum ratio of the radius of a ball or capsule to that of the nearest disc.
const MAX_STRAY_RATIO: f32 = 2.0;
/// Maximum ratio of the radius of a larger disc, far from all these, to that of the nearest: the spacing of a scan grows
/// with distance, but not at once.
const MAX_DISC_RATIO: f32 = 5.0;
/// Maximum ratio of the trusted discs to the median one of a cloud that is sampled evenly, as from the air. On the far
/// ground of a scanner on a tripod discs grow to far larger ones.
const MAX_SPREAD: f32 = 3.0;
/// Ratio of the distance to the nearest disc to its radius from which a point is no part of its surroundings.
const ISOLATED_RATIO: f32 = 8.0;
/// Maximum number of discs among which the nearest is searched.
const MAX_DISCS: usize = 100_000;

/// Limits the balls and capsules of stray points by the nearest disc, and makes balls and capsules of their discs.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::error::Error::Cancelled) if `progress` is cancelled.
pub fn limit_stray_points(
    all: &KdTree,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let Some(sizes) = DiscSizes::of(shapes) else { return Ok(()) };
    if !shapes.iter().any(|shape| sizes.is_wide(shape)) {
        return Ok(());
    }
    let (centers, radii) = sizes.trusted(shapes, all.positions());
    let discs = TrustedDiscs { sizes, radii, tree: KdTree::new(&centers, progress)? };
    shapes.par_iter_mut().enumerate().try_for_each(|(point, shape)| {
        if point.is_multiple_of(4096) {
            progress.check()?;
        }
        discs.limit(all, point, shape);
        Ok(())
    })
}

/// The sizes of a cloud's discs.
#[derive(Clone, Copy)]
struct DiscSizes {
    n_discs: usize,
    /// Median of the radii.
    typical: f32,
    /// Radius of the largest disc that others are compared with.
    largest: f32,
}

impl DiscSizes {
    /// Returns the sizes, or `None` if too few points lie on surfaces.
    fn of(shapes: &[PointShape]) -> Option<Self> {
        let radii: Vec<f32> = shapes.iter().filter(is_surface).map(|shape| shape.radius).collect();
        // Redundant discs have the size of their neighbours, but lie on surfaces all the same.
        let n_on_surfaces = shapes.iter().filter(|shape| shape.is_disc()).count();
        let is_enough = MIN_ON_SURFACES * shapes.len() as f32 <= n_on_surfaces as f32;
        (!radii.is_empty() && is_enough).then(|| Self {
            n_discs: radii.len(),
            typical: sampled_quantile(&radii, 0.5),
            largest: sampled_quantile(&radii, TRUSTED_DISCS),
        })
    }

    /// Returns the maximum ratio of a shape's radius to that of the nearest disc.
    fn max_ratio(&self, shape: &PointShape) -> f32 {
        let is_even = self.largest < MAX_SPREAD * self.typical;
        match shape.structure {
            Structure::Scatter | Structure::Line => MAX_STRAY_RATIO,
            Structure::Surface if is_even && self.largest < shape.radius => MAX_DISC_RATIO,
            Structure::Surface | Structure::Redundant => f32::INFINITY,
        }
    }

    /// Returns places and radii of the discs that others are compared with.
    fn trusted(&self, shapes: &[PointShape], positions: &[Vec3]) -> (Vec<Vec3>, Vec<f32>) {
        let discs = shapes.iter().zip(positions).filter(|(shape, _)| is_surface(shape));
        let discs = discs.step_by(self.n_discs.div_ceil(MAX_DISCS));
        let trusted = discs.filter(|(shape, _)| shape.radius <= self.largest);
        trusted.map(|(shape, position)| (*position, shape.radius)).unzip()
    }

    /// Returns whether a shape may be too large for its surroundings.
    fn is_wide(&self, shape: &PointShape) -> bool {
        self.max_ratio(shape) * self.typical < shape.radius
    }
}

/// Discs that others are compared with.
struct TrustedDiscs<'p> {
    sizes: DiscSizes,
    radii: Vec<f32>,
    tree: KdTree<'p>,
}

impl TrustedDiscs<'_> {
    /// Limits a shape that is too large for the nearest disc.
    fn limit(&self, all: &KdTree, point: usize, shape: &mut PointShape) {
        let Self { sizes, radii, tree } = self;
        if !sizes.is_wide(shape) {
            return;
        }
        let position = all.positions()[point];
        let nearest = tree.nearest(position, 1, None);
        let Some(disc) = nearest.first() else { return };
        let radius = radii[disc.index as usize];
        let is_isolated = ISOLATED_RATIO * radius < disc.distance_squared.sqrt();
        let is_disc = shape.structure == Structure::Surface;
        if shape.radius <= sizes.max_ratio(shape) * radius || is_disc && !is_isolated {
            return;
        }
        let limit = if is_isolated { sizes.typical } else { MAX_STRAY_RATIO * radius };
        if is_disc {
            let around = all.nearest(position, N_LINE_NEIGHBORS, Some(point as u32));
            let is_line = is_line(&fit_plane(all.positions(), point, &around));
            let structure = if is_line { Structure::Line } else { Structure::Scatter };
            apply_structure(all, point, limit, structure, shape);
        }
        shape.radius = shape.radius.min(limit);
    }
}

fn is_surface(shape: &&PointShape) -> bool {
    shape.structure == Structure::Surface
}

#[cfg(test)]
mod tests {
    //! Points and wires far over a plane.

    use super::*;
    use crate::math::Random;
    use crate::points::test_clouds::prepared;

    /// Points of a level plane of this length and width about zero.
    fn plane(n: usize, length: f32, width: f32) -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut next = || random.next_f32() - 0.5;
        (0..n).map(|_| Vec3::new(length * next(), width * next(), 0.0)).collect()
    }

    #[test]
    fn redundant_discs_are_of_surfaces() {
        let shapes = |structure, n| vec![PointShape { structure, normal: Vec3::Z, radius: 0.1 }; n];
        let scan = [
            shapes(Structure::Redundant, 60),
            shapes(Structure::Surface, 20),
            shapes(Structure::Scatter, 20),
        ];
        assert_eq!(DiscSizes::of(&scan.concat()).unwrap().n_discs, 20);
        assert!(DiscSizes::of(&scan[1..].concat()[10..]).is_none());
    }

    #[test]
    fn many_stray_points_far_apart_are_small() {
        let mut points = plane(5000, 1.0, 1.0);
        let mut random = Random::new(7, 0);
        let mut stray = || Vec3::from_array([(); 3].map(|()| 8.0 * random.next_f32() - 4.0));
        points.extend((0..200).map(|_| stray()));
        let (cloud, structures) = prepared(points);
        let n_small = cloud.radii()[5000..].iter().filter(|radius| **radius < 0.1).count();
        assert!(190 <= n_small, "{n_small}");
        assert!(!structures[5000..].iter().all(|structure| *structure == Structure::Surface));
    }

    #[test]
    fn three_wires_at_two_heights_are_thin() {
        // Over ground with points 0.4 apart: a wire of 2 points a unit on either side, and one 4 above the middle.
        let mut random = Random::new(9, 0);
        let mut noise = || 0.05 * random.next_gaussian() as f32;
        let wires = [(-6.0, 24.0), (0.0, 28.0), (6.0, 24.0)]
            .into_iter()
            .flat_map(|(y, z)| (0..200).map(move |i| Vec3::new(i as f32 / 2.0, y, z)));
        let mut points: Vec<Vec3> =
            wires.map(|point| point + Vec3::new(noise(), noise(), noise())).collect();
        let n_wires = points.len();
        points.extend(
            plane(30_000, 100.0, 40.0).iter().map(|point| *point + Vec3::new(50.0, 0.0, 0.0)),
        );
        let (cloud, structures) = prepared(points);
        let drawn = (0..n_wires).filter(|point| structures[*point] != Structure::Redundant);
        let widest = drawn.map(|point| cloud.radii()[point]).fold(0.0, f32::max);
        assert!(widest < 5.0, "{widest}");
    }
}

//! Solids: the capsules of points on lines, and the balls of scattered points.

use super::neighbors::{KdTree, Neighbor};
use super::normals::fit_plane;
use super::radius::kth_distance;
use super::structure::{PointShape, Structure, is_line};
use crate::error::Result;
use crate::math::{DVec3, SymmetricMatrix, Vec3};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours that give the direction of a line.
const N_LINE_NEIGHBORS: usize = 8;
/// Radius of a ball in distances to the second neighbour: balls of neighbours overlap a little.
const BALL_REACH: f32 = 0.6;
/// Maximum ratio of the radius of a ball or capsule to the median of its structure.
const MAX_SOLID_RATIO: f32 = 1.5;
/// Minimum number of points of a structure for a typical radius of their own.
const MIN_SOLIDS: usize = 16;
/// Minimum fraction of the points on surfaces of a cloud that has stray points: those of a forest all stand for themselves.
const MIN_ON_SURFACES: f32 = 0.5;
/// Fraction of the discs, from the smallest on, that a stray point is compared with: chance makes surfaces of a few stray
/// points, too.
const TRUSTED_DISCS: f32 = 0.98;
/// Maximum ratio of the radius of a ball or capsule to that of the nearest disc.
const MAX_STRAY_RATIO: f32 = 2.0;
/// Maximum ratio of the radius of a larger disc, far from all these, to that of the nearest: the spacing of a scan grows with
/// distance, but not at once.
const MAX_DISC_RATIO: f32 = 5.0;
/// Maximum ratio of the trusted discs to the median one of a cloud that is sampled evenly, as from the air. On the far
/// ground of a scanner on a tripod discs grow to far larger ones.
const MAX_SPREAD: f32 = 6.0;
/// Ratio of the distance to the nearest disc to its radius from which a point is no part of its surroundings.
const FAR_RATIO: f32 = 8.0;
/// Maximum number of discs among which the nearest is searched.
const MAX_DISCS: usize = 100_000;

/// Gives a point the direction and the radius of its final structure. Surface points keep what was decided.
pub fn settle(
    tree: &KdTree,
    point: usize,
    radius: f32,
    structure: Structure,
    shape: &mut PointShape,
) {
    let position = tree.positions()[point];
    match structure {
        Structure::Surface | Structure::Redundant => {}
        Structure::Line => {
            let neighbors = tree.nearest(position, N_LINE_NEIGHBORS, Some(point as u32));
            shape.normal = line_direction(tree.positions(), point, &neighbors);
            let reach = kth_distance(&neighbors, 2);
            shape.radius = if 0.0 < reach { reach } else { radius };
        }
        Structure::Scatter => {
            let neighbors = tree.nearest(position, 2, Some(point as u32));
            shape.radius = ball_radius(kth_distance(&neighbors, 2), radius);
        }
    }
    shape.structure = structure;
}

/// Returns the direction in which the neighbours extend most.
fn line_direction(positions: &[Vec3], point: usize, neighbors: &[Neighbor]) -> Vec3 {
    let center = positions[point].as_dvec3();
    let mut scatter = SymmetricMatrix::default();
    for neighbor in neighbors {
        let offset: DVec3 = positions[neighbor.index as usize].as_dvec3() - center;
        scatter.add_outer(offset, 1.0);
    }
    let (_, vectors) = scatter.eigen();
    vectors[2].as_vec3().normalize_or(Vec3::Z)
}

/// Returns the radius of a ball by the distance to the second neighbour; `radius` is that of a disc, which a stray
/// point's ball does not exceed.
pub fn ball_radius(distance: f32, radius: f32) -> f32 {
    let reach = BALL_REACH * distance;
    if 0.0 < reach { reach.min(radius) } else { radius }
}

/// Clamps the radii of stray points, which would be as large as the empty space around them. A few of them are no larger
/// than the typical radius of a surface.
pub fn clamp_solids(shapes: &mut [PointShape], structure: Structure, typical_radius: f32) {
    let solids = shapes.iter().filter(|shape| shape.structure == structure);
    let mut radii: Vec<f32> = solids.map(|shape| shape.radius).collect();
    if radii.is_empty() {
        return;
    }
    let middle = radii.len() / 2;
    let median = *radii.select_nth_unstable_by(middle, f32::total_cmp).1;
    let limit = MAX_SOLID_RATIO * median;
    let limit = if radii.len() < MIN_SOLIDS { limit.min(typical_radius) } else { limit };
    for shape in shapes.iter_mut().filter(|shape| shape.structure == structure) {
        shape.radius = shape.radius.min(limit);
    }
}

/// Limits the balls and capsules of stray points far from all surfaces by the discs of the nearest surface, and makes balls
/// and capsules of their discs: there may be so many of them that their own median is large, and that some lie in a plane, as below
/// aerial scans and around clouds of features of photographs.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::error::Error::Cancelled) if `progress` is cancelled.
pub fn limit_stray_points(
    all: &KdTree,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let positions = all.positions();
    let is_surface = |shape: &&PointShape| shape.structure == Structure::Surface;
    let mut radii: Vec<f32> = shapes.iter().filter(is_surface).map(|shape| shape.radius).collect();
    if radii.is_empty() || (radii.len() as f32) < MIN_ON_SURFACES * shapes.len() as f32 {
        return Ok(());
    }
    let middle = radii.len() / 2;
    let typical = *radii.select_nth_unstable_by(middle, f32::total_cmp).1;
    let trusted = ((TRUSTED_DISCS * radii.len() as f32) as usize).min(radii.len() - 1);
    let largest = *radii.select_nth_unstable_by(trusted, f32::total_cmp).1;
    let is_even = largest < MAX_SPREAD * typical;
    let max_ratio = |shape: &PointShape| match shape.structure {
        Structure::Scatter | Structure::Line => MAX_STRAY_RATIO,
        Structure::Surface if is_even && largest < shape.radius => MAX_DISC_RATIO,
        Structure::Surface | Structure::Redundant => f32::INFINITY,
    };
    let is_wide = |shape: &PointShape| max_ratio(shape) * typical < shape.radius;
    if !shapes.iter().any(is_wide) {
        return Ok(());
    }
    let step = radii.len().div_ceil(MAX_DISCS);
    let discs = shapes.iter().zip(positions).filter(|(shape, _)| is_surface(shape));
    let discs = discs.step_by(step).filter(|(shape, _)| shape.radius <= largest);
    let (places, radii): (Vec<Vec3>, Vec<f32>) =
        discs.map(|(shape, position)| (*position, shape.radius)).unzip();
    let tree = KdTree::new(&places, progress)?;
    shapes.par_iter_mut().enumerate().filter(|(_, shape)| is_wide(shape)).for_each(
        |(point, shape)| {
            let nearest = tree.nearest(positions[point], 1, None);
            let Some(disc) = nearest.first() else { return };
            let radius = radii[disc.index as usize];
            let is_far = FAR_RATIO * radius < disc.distance_squared.sqrt();
            let is_surface = shape.structure == Structure::Surface;
            if max_ratio(shape) * radius < shape.radius && (is_far || !is_surface) {
                shape.radius = if is_far { typical } else { MAX_STRAY_RATIO * radius };
                if is_surface {
                    let around =
                        all.nearest(positions[point], N_LINE_NEIGHBORS, Some(point as u32));
                    let is_line = is_line(&fit_plane(positions, point, &around));
                    let structure = if is_line { Structure::Line } else { Structure::Scatter };
                    settle(all, point, shape.radius, structure, shape);
                }
            }
        },
    );
    Ok(())
}

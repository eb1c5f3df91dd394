//! Solids: the capsules of points on lines, and the balls of scattered points.

use super::neighbors::{KdTree, Neighbor};
use super::radius::kth_distance;
use super::structure::{PointShape, Structure};
use crate::math::{DVec3, SymmetricMatrix, Vec3};

/// Number of neighbours that give the direction of a line.
pub const N_LINE_NEIGHBORS: usize = 8;
/// Radius of a ball in distances to the second neighbour: balls of neighbours overlap a little.
const BALL_REACH: f32 = 0.6;
/// Maximum ratio of the radius of a ball or capsule to the median of its structure.
const MAX_SOLID_RATIO: f32 = 1.5;
/// Minimum number of points of a structure for a typical radius of their own.
const MIN_SOLIDS: usize = 16;

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

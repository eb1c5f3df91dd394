//! Solids: the capsules of points on lines, and the balls of scattered points.

use super::point_shape::{PointShape, Structure};
use crate::math::{DVec3, SymmetricMatrix, Vec3, median};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::radii::radius::kth_distance;

/// Half the length of a capsule, in multiples of its thickness's radius.
pub const CAPSULE_ASPECT: f32 = 4.0;
/// Number of neighbours that give the direction of a line.
pub const N_LINE_NEIGHBORS: usize = 8;
/// Number of neighbours that give the direction and the thickness of a straight line.
pub const N_STRAIGHT_NEIGHBORS: usize = 24;
/// Maximum ratio of the deviations across and along a straight line: twigs and edges have more.
pub const MAX_STRAIGHT_WIDTH: f32 = 0.1;
/// Ratio of the radius of a round line to the standard deviation of its points across it: 1.0 where scanners measured all
/// around it, 1.6 where one scanner measured one side.
const THICKNESS_OF_DEVIATION: f32 = 1.4;
/// Radius of a ball in distances to the second neighbour: balls of neighbours overlap a little.
const BALL_REACH: f32 = 0.6;
/// Maximum ratio of the radius of a ball or capsule to the median of its structure.
const MAX_SOLID_RATIO: f32 = 1.5;
/// Maximum radius of a ball and half length of a capsule, in sizes of the cloud: views have a narrow margin around it.
const MAX_BALL_PER_SIZE: f32 = 0.02;
const MAX_CAPSULE_PER_SIZE: f32 = 0.08;
/// Minimum number of points of a structure for a typical radius of their own.
const MIN_SOLIDS: usize = 16;
/// Fraction of the points below which those of a structure may all be in places sampled far more densely than others.
const FEW_SOLIDS: f32 = 0.05;
/// Limit of the radii of so few, in typical radii of a surface.
const FEW_SOLIDS_RADIUS: f32 = 0.5;

/// Gives a point the direction and the radius of its final structure. Surface points keep what was decided.
pub fn apply_structure(
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
            let neighbors = tree.nearest(position, N_STRAIGHT_NEIGHBORS, Some(point as u32));
            let mut line = LineFit::of(tree.positions(), point, &neighbors);
            let mut reach = distance_elsewhere(&neighbors, 2);
            if line.width < MAX_STRAIGHT_WIDTH {
                reach = reach.max(CAPSULE_ASPECT * line.thickness);
            } else {
                let nearest = &neighbors[..N_LINE_NEIGHBORS.min(neighbors.len())];
                line = LineFit::of(tree.positions(), point, nearest);
            }
            shape.normal = line.direction;
            shape.radius = if 0.0 < reach { reach } else { radius };
        }
        Structure::Scatter => {
            let neighbors = tree.nearest(position, 2, Some(point as u32));
            shape.radius = ball_radius(second_distance(tree, point, &neighbors), radius);
        }
    }
    shape.structure = structure;
}

/// The line through a point and its neighbours.
pub struct LineFit {
    /// Mean offset of all of them from the point.
    pub mean: DVec3,
    /// Direction in which they extend most.
    pub direction: Vec3,
    /// Ratio of the deviations across and along it.
    pub width: f32,
    /// Radius of a round line on whose surface they would lie.
    pub thickness: f32,
}

impl LineFit {
    /// Fits the line.
    pub fn of(positions: &[Vec3], point: usize, neighbors: &[Neighbor]) -> Self {
        let center = positions[point].as_dvec3();
        let offsets = neighbors.iter().map(|other| positions[other.index as usize].as_dvec3());
        let offsets: Vec<DVec3> = offsets.map(|other| other - center).collect();
        // The point itself has no offset.
        let weight = 1.0 / (offsets.len() + 1) as f64;
        let mean = weight * offsets.iter().sum::<DVec3>();
        let mut scatter = SymmetricMatrix::default();
        offsets.iter().for_each(|offset| scatter.add_outer(*offset - mean, weight));
        scatter.add_outer(mean, weight);
        let (values, vectors) = scatter.eigen();
        let [across, along] = [values[0] + values[1], values[2]].map(|v| v.max(0.0).sqrt() as f32);
        Self {
            mean,
            direction: vectors[2].as_vec3().normalize_or(Vec3::Z),
            width: across / along.max(f32::MIN_POSITIVE),
            thickness: THICKNESS_OF_DEVIATION * across,
        }
    }
}

/// Returns the distance from a point to the second of its neighbours, which `nearest` has, or of those elsewhere if both
/// are at the point's own position.
pub fn second_distance(tree: &KdTree, point: usize, nearest: &[Neighbor]) -> f32 {
    match kth_distance(nearest, 2) {
        0.0 => {
            let position = tree.positions()[point];
            let more = tree.nearest(position, N_STRAIGHT_NEIGHBORS, Some(point as u32));
            distance_elsewhere(&more, 2)
        }
        distance => distance,
    }
}

/// Returns the distance to the k-th or else the last of the neighbours at other positions, or zero without such.
fn distance_elsewhere(neighbors: &[Neighbor], k: usize) -> f32 {
    let n_equal = neighbors.partition_point(|neighbor| neighbor.distance_squared == 0.0);
    kth_distance(&neighbors[n_equal..], k)
}

/// Returns the radius of a ball by the distance to the second neighbour; `radius` is that of a disc, which a stray
/// point's ball does not exceed.
pub fn ball_radius(distance: f32, radius: f32) -> f32 {
    let reach = BALL_REACH * distance;
    if 0.0 < reach { reach.min(radius) } else { radius }
}

/// Clamps the radii of stray points, which would be as large as the empty space around them. A few of them are no larger
/// than the typical radius of a surface. `size` is that of the cloud: the points of a few stay apart.
pub fn clamp_solids(
    shapes: &mut [PointShape],
    structure: Structure,
    typical_radius: f32,
    size: f32,
) {
    let solids = shapes.iter().filter(|shape| shape.structure == structure);
    let n_solids = solids.clone().count();
    let Some(median) = median(solids.map(|shape| shape.radius)) else { return };
    let limit = MAX_SOLID_RATIO * median;
    let limit = match n_solids {
        ..MIN_SOLIDS => limit.min(typical_radius),
        n if typical_radius.is_finite() && (n as f32) < FEW_SOLIDS * shapes.len() as f32 => {
            limit.max(FEW_SOLIDS_RADIUS * typical_radius)
        }
        _ => limit,
    };
    let limit = limit.min(limit_by_size(structure, size));
    for shape in shapes.iter_mut().filter(|shape| shape.structure == structure) {
        shape.radius = shape.radius.min(limit);
    }
}

/// Clamps the radii of the balls of stray points in a scan from one position. Its rays spread, so that balls of a crown are the
/// larger, the farther it is from the scanner. A few balls are clamped as [`clamp_solids`] does.
pub fn clamp_balls_by_range(
    shapes: &mut [PointShape],
    positions: &[Vec3],
    scanner: Vec3,
    typical_radius: f32,
    size: f32,
) {
    let range = |position: &Vec3| position.distance(scanner);
    let balls = shapes.iter().zip(positions).filter(|(shape, _)| is_ball(shape));
    let angles = || balls.clone().map(|(shape, position)| shape.radius / range(position));
    let Some(angle) = median(angles()).filter(|_| MIN_SOLIDS <= angles().count()) else {
        clamp_solids(shapes, Structure::Scatter, typical_radius, size);
        return;
    };
    let limit_by_size = limit_by_size(Structure::Scatter, size);
    for (shape, position) in shapes.iter_mut().zip(positions).filter(|(shape, _)| is_ball(shape)) {
        let limit = match range(position) {
            0.0 => limit_by_size,
            range => limit_by_size.min(MAX_SOLID_RATIO * angle * range),
        };
        shape.radius = shape.radius.min(limit);
    }
}

fn is_ball(shape: &PointShape) -> bool {
    shape.structure == Structure::Scatter
}

/// Returns the maximum radius of a ball or half length of a capsule in a cloud of this size.
fn limit_by_size(structure: Structure, size: f32) -> f32 {
    let max_per_size = match structure {
        Structure::Line => MAX_CAPSULE_PER_SIZE,
        _ => MAX_BALL_PER_SIZE,
    };
    // Equal points have no size.
    if 0.0 < size { max_per_size * size } else { f32::INFINITY }
}

#[cfg(test)]
mod tests {
    //! The sizes of straight lines and of scattered points.

    use super::*;
    use crate::math::Random;
    use crate::progress::NoProgress;

    #[test]
    fn capsules_of_a_wire_are_as_thick_as_the_wire_and_lie_along_it() {
        const THICKNESS: f32 = 0.012;
        let direction = Vec3::new(3.0, 1.0, 0.5).normalize();
        let (side, up) = direction.any_orthonormal_pair();
        let mut random = Random::new(6, 0);
        let point = |i: usize| {
            let (sin, cos) = (std::f32::consts::PI * random.next_f32()).sin_cos();
            0.02 * i as f32 * direction + THICKNESS * (cos * side + sin * up)
        };
        let positions: Vec<Vec3> = (0..500).map(point).collect();
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        for point in 50..450 {
            let mut shape =
                PointShape { structure: Structure::Surface, normal: Vec3::Z, radius: 0.1 };
            apply_structure(&tree, point, 0.1, Structure::Line, &mut shape);
            assert!(0.99 < shape.normal.dot(direction).abs(), "{shape:?}");
            let thickness = shape.radius / CAPSULE_ASPECT / THICKNESS;
            assert!((0.7..1.4).contains(&thickness), "{thickness}");
        }
    }

    #[test]
    fn solids_of_points_that_coincide_are_no_larger() {
        let line: Vec<Vec3> = (0..40).map(|i| 0.1 * i as f32 * Vec3::X).collect();
        for structure in [Structure::Line, Structure::Scatter] {
            let radius = |n_equal: usize| {
                let points: Vec<Vec3> = line.iter().flat_map(|p| vec![*p; n_equal]).collect();
                let tree = KdTree::new(&points, &NoProgress).unwrap();
                let mut shape = PointShape { structure, normal: Vec3::Z, radius: 9.0 };
                apply_structure(&tree, points.len() / 2, 9.0, structure, &mut shape);
                shape.radius
            };
            assert!((radius(4) - radius(1)).abs() < 1e-6, "{structure:?}: {}", radius(4));
        }
    }

    #[test]
    fn sparse_scattered_points_are_as_large_as_their_spacing_asks_for() {
        let shape = |structure, radius| PointShape { structure, normal: Vec3::Z, radius };
        let scattered = |n: usize, radius| vec![shape(Structure::Scatter, radius); n];
        let surface = vec![shape(Structure::Surface, 0.1); 10_000];
        let (dense, sparse) = (scattered(300, 0.004), scattered(100, 0.03));
        let mut shapes = [dense, sparse, surface].concat();
        clamp_solids(&mut shapes, Structure::Scatter, 0.1, 10.0);
        assert!(shapes[..300].iter().all(|shape| shape.radius == 0.004));
        assert!(shapes[300..400].iter().all(|shape| shape.radius == 0.03));
        // Most points of a forest are leaves, whose median tells how large they are.
        shapes.truncate(1000);
        clamp_solids(&mut shapes, Structure::Scatter, 0.1, 10.0);
        assert!(shapes[300..400].iter().all(|shape| shape.radius < 0.01));
    }

    #[test]
    fn solids_of_few_points_are_small_beside_the_cloud() {
        for structure in [Structure::Line, Structure::Scatter] {
            let shape = PointShape { structure, normal: Vec3::Z, radius: 1.0 };
            let mut shapes = vec![shape; 5];
            clamp_solids(&mut shapes, structure, f32::INFINITY, 2.0);
            assert!(shapes.iter().all(|shape| shape.radius < 0.4), "{shapes:?}");
        }
    }

    #[test]
    fn balls_of_a_scan_grow_with_their_range() {
        // A crown near the scanner, one far from it, and stray points between them.
        let scanner = Vec3::new(4.0, -3.0, 1.0);
        let at = |range: f32| scanner + range * Vec3::Y;
        let ranges = [vec![10.0; 100], vec![90.0; 100], vec![50.0; 5]].concat();
        let positions: Vec<Vec3> = ranges.iter().map(|range| at(*range)).collect();
        let radius = |range: f32| if range == 50.0 { 8.0 } else { 0.004 * range };
        let shape = |range: &f32| PointShape {
            structure: Structure::Scatter,
            normal: Vec3::Z,
            radius: radius(*range),
        };
        let mut shapes: Vec<PointShape> = ranges.iter().map(shape).collect();
        clamp_balls_by_range(&mut shapes, &positions, scanner, 0.1, 1000.0);
        assert!(shapes[..200].iter().zip(&ranges).all(|(shape, r)| shape.radius == 0.004 * r));
        assert!(shapes[200..].iter().all(|shape| (shape.radius - 0.3).abs() < 1e-5));
        clamp_balls_by_range(&mut shapes, &positions, scanner, 0.1, 10.0);
        assert!(shapes[100..].iter().all(|shape| (shape.radius - 0.2).abs() < 1e-5));
        // A few are no larger than the discs of a surface.
        clamp_balls_by_range(&mut shapes[200..], &positions[200..], scanner, 0.1, 10.0);
        assert!(shapes[200..].iter().all(|shape| shape.radius == 0.1));
    }
}

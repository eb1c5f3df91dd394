//! Points above land: low plants, whose nearest neighbours are mostly points of the ground.

use crate::math::{Vec3, hash};
use crate::points::neighbors::Neighbor;

/// Number of planes that are tried.
const N_PLANES: u64 = 24;
/// Minimum distance from a plane of the points on it, in radii of the neighbourhood.
const MIN_THICKNESS: f32 = 0.06;
/// Distance from a plane of the points on it, in deviations of the noise.
const THICKNESS_OF_NOISE: f32 = 2.5;
/// Minimum fraction of the neighbours on the plane of the ground.
const MIN_ON_GROUND: f32 = 0.4;
/// Minimum height of a plant above this plane, in distances of the points on it.
const MIN_HEIGHT: f32 = 2.0;
/// Minimum number of neighbours on a plane through a point of a roof or a wall, as a fraction of those on the ground: a
/// steep plane through a plant meets some points of the ground.
const MIN_ON_OWN_PLANE: f32 = 0.75;

/// Returns true for a point that lies above or below the plane of most of its neighbours, and on no plane with others of
/// them. `noise` is the typical deviation from planes in radii of neighbourhoods.
pub fn is_above_land(positions: &[Vec3], point: usize, neighbors: &[Neighbor], noise: f32) -> bool {
    let center = positions[point];
    let offsets: Vec<Vec3> =
        neighbors.iter().map(|neighbor| positions[neighbor.index as usize] - center).collect();
    let Some(farthest) = offsets.last() else { return false };
    let reach = farthest.length();
    let thickness = reach * MIN_THICKNESS.max(THICKNESS_OF_NOISE * noise);
    let n_neighbors = offsets.len() as u64;
    let offset = |index: u64| offsets[(index % n_neighbors) as usize];
    let fraction_on = |origin: Vec3, normal: Vec3| {
        let is_on = |offset: &&Vec3| normal.dot(**offset - origin).abs() < thickness;
        offsets.iter().filter(is_on).count() as f32 / offsets.len() as f32
    };
    // Nearly parallel sides give a plane of any tilt.
    let plane = |a: Vec3, b: Vec3| {
        let cross = a.cross(b);
        (0.05 * reach * reach < cross.length()).then(|| cross.normalize())
    };
    let (mut ground, mut own) = ((0.0, 0.0f32), 0.0f32);
    for i in 0..N_PLANES {
        let bits = hash((point as u64) << 8 | i);
        let [a, b, c] = [bits, bits >> 21, bits >> 42].map(offset);
        if let Some(normal) = plane(b - a, c - a) {
            let fraction = fraction_on(a, normal);
            if ground.0 < fraction {
                ground = (fraction, normal.dot(a).abs());
            }
        }
        if let Some(normal) = plane(a, b) {
            own = own.max(fraction_on(Vec3::ZERO, normal));
        }
    }
    MIN_ON_GROUND <= ground.0
        && MIN_HEIGHT * thickness < ground.1
        && own < MIN_ON_OWN_PLANE * ground.0
}

#[cfg(test)]
mod tests {
    //! Plants over the ground, and points of the ground, roofs and walls.

    use super::*;
    use crate::math::Random;
    use crate::points::neighbors::KdTree;
    use crate::points::{PointCloud, Preparation, Structure, prepare};
    use crate::progress::NoProgress;

    /// Returns the fraction of points of a place that lie above land, among `others`.
    fn above(own: &[Vec3], others: &[Vec3]) -> f64 {
        let points = [own, others].concat();
        let tree = KdTree::new(&points, &NoProgress).unwrap();
        let is_above = |point: &usize| {
            let neighbors = tree.nearest(points[*point], 24, Some(*point as u32));
            is_above_land(&points, *point, &neighbors, 0.02)
        };
        (0..own.len()).filter(is_above).count() as f64 / own.len() as f64
    }

    #[test]
    fn the_vote_of_the_ground_makes_no_surface_of_plants() {
        let mut random = Random::new(5, 0);
        let mut points = Vec::new();
        for i in 0..20_000 {
            let (x, y) = (100.0 * random.next_f32(), 100.0 * random.next_f32());
            // Every fifth point in a strip is part of a plant.
            let is_plant = i % 5 == 0 && 40.0 < x && x < 60.0;
            let height = random.next_f32() * if is_plant { 2.0 } else { 0.05 };
            let height = if is_plant { height + 1.0 } else { height };
            points.push(Vec3::new(x, y, height));
        }
        let is_plant: Vec<bool> = points.iter().map(|p| 0.5 < p.z).collect();
        let cloud = PointCloud::from_positions(points);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        let count = |kind: bool| {
            let of_kind = structures.iter().zip(&is_plant).filter(|(_, plant)| **plant == kind);
            let n_scattered = of_kind.clone().filter(|(s, _)| **s == Structure::Scatter).count();
            n_scattered as f64 / of_kind.count() as f64
        };
        assert!(0.9 < count(true) && count(false) < 0.02, "{} {}", count(true), count(false));
    }

    #[test]
    fn plants_lie_above_land_and_the_ground_and_roofs_do_not() {
        let mut random = Random::new(3, 0);
        let mut ground = |n: usize, size: f32, height: f32| -> Vec<Vec3> {
            let mut axis = || size * (random.next_f32() - 0.5);
            (0..n).map(|_| Vec3::new(axis(), axis(), height + 0.001 * axis())).collect()
        };
        let land = ground(10_000, 50.0, 0.0);
        let plants: Vec<Vec3> = ground(60, 45.0, 0.0)
            .into_iter()
            .enumerate()
            .map(|(i, p)| p + (0.7 + 0.01 * i as f32) * Vec3::Z)
            .collect();
        let roof = ground(400, 10.0, 4.0);
        assert!(0.9 < above(&plants, &land));
        assert!(above(&land, &plants) < 0.01);
        assert!(above(&roof, &land) < 0.01);
        assert!(!is_above_land(&land, 0, &[], 0.1));
    }
}

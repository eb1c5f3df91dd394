//! Sparse walls: an aircraft sees the walls of buildings at a grazing angle, so that their points lie far apart beside the
//! dense ones of roofs and land. Their nearest neighbours are on other surfaces, and only those of the wall itself show
//! its plane.

use super::octants::{Octants, octant};
use super::plan_cells::PlanCells;
use super::point_shape::{PointShape, Structure};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of scattered points around another among which those of its wall are sought, and of points as seen from above
/// among which those of a roof are.
const N_NEAREST: usize = 24;
/// Minimum number of them on the wall.
const MIN_ON_WALL: usize = 7;
/// Thickness of a wall, in distances to the last of the nearest.
const THICKNESS: f32 = 0.05;
/// Maximum thickness of a wall, in these distances: in thicker ones chance has many points.
const MAX_THICKNESS: f32 = 0.1;
/// Thickness of a wall in deviations of the noise.
const N_DEVIATIONS: f32 = 2.5;
/// Minimum ratio of the width of a wall to its height: that of a pole is less.
const MIN_WIDTH: f32 = 0.2;
/// Number of nearest points on the wall that a disc reaches.
const N_REACHED: usize = 6;
/// Number of nearest points on the wall that a disc at its rim reaches.
const N_REACHED_AT_RIM: usize = 2;
/// Number of successive octants without points of the wall at its rim.
const MIN_EMPTY: usize = 3;
/// Maximum radius of a disc, in typical radii.
const MAX_RADIUS: f32 = 8.0;
/// Minimum cosine between the normals of a wall at points on it, half of which have to agree.
const MIN_COSINE: f32 = 0.95;
/// Minimum number of points of a roof.
const MIN_OF_ROOF: usize = 3;
/// Minimum cosine between the normal of a roof and the vertical.
const MIN_ROOF_COSINE: f32 = 0.5;

/// Makes upright discs of the scattered points that lie on a wall with others of them, below a roof. Z points up. `noise` is
/// the typical distance of points from their surface.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn find_sparse_walls(
    positions: &[Vec3],
    noise: f32,
    typical_radius: f32,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let is_scattered = |point: &u32| shapes[*point as usize].structure == Structure::Scatter;
    let scattered: Vec<u32> = (0..positions.len() as u32).filter(is_scattered).collect();
    let candidates: Vec<Vec3> = scattered.iter().map(|point| positions[*point as usize]).collect();
    let tree = KdTree::new(&candidates, progress)?;
    let wall = |i: usize| {
        progress.check()?;
        Ok(Wall::around(&tree, i, N_DEVIATIONS * noise))
    };
    let walls = (0..candidates.len()).into_par_iter().map(wall).collect::<Result<Vec<_>>>()?;
    progress.check()?;
    let confirmed: Vec<usize> =
        (0..walls.len()).into_par_iter().filter(|i| is_confirmed(*i, &walls)).collect();
    let on_walls: Vec<Vec3> = confirmed.iter().map(|i| candidates[*i]).collect();
    let is_below = are_below_roofs(&on_walls, positions, typical_radius, shapes, progress)?;
    for (i, is_below) in confirmed.into_iter().zip(is_below) {
        if let (Some(wall), true) = (&walls[i], is_below) {
            let (normal, radius) = (wall.normal, wall.reach.min(MAX_RADIUS * typical_radius));
            let shape = PointShape { structure: Structure::Surface, normal, radius };
            shapes[scattered[i] as usize] = shape;
        }
    }
    Ok(())
}

/// The wall through a point.
struct Wall {
    normal: Vec3,
    /// Radius of the disc of the point.
    reach: f32,
    /// The other points on the wall, nearest first.
    points: Vec<u32>,
}

impl Wall {
    /// Returns the wall through a point of a tree on which most points around it lie, if these are enough and do not stand
    /// above each other.
    fn around(tree: &KdTree, point: usize, min_thickness: f32) -> Option<Self> {
        let own = tree.positions()[point];
        let nearest = tree.nearest(own, N_NEAREST, Some(point as u32));
        let offset = |neighbor: &Neighbor| tree.positions()[neighbor.index as usize] - own;
        let reach = nearest.last()?.distance_squared.sqrt();
        let thickness = min_thickness.max(THICKNESS * reach);
        if MAX_THICKNESS * reach < thickness {
            return None;
        }
        let on_wall = |normal: Vec3| {
            let is_on = move |neighbor: &&Neighbor| offset(neighbor).dot(normal).abs() <= thickness;
            nearest.iter().filter(is_on)
        };
        // Each neighbour that is far enough away as seen from above gives a direction of the wall.
        let sides = nearest.iter().map(|neighbor| offset(neighbor).with_z(0.0));
        let far = sides.filter(|side| 2.0 * thickness < side.length());
        let normals = far.map(|side| side.cross(Vec3::Z).normalize());
        let counts = normals.map(|normal| (on_wall(normal).count(), normal));
        let (n_on_wall, normal) = counts.max_by_key(|(count, _)| *count)?;
        if n_on_wall < MIN_ON_WALL {
            return None;
        }
        let along = normal.cross(Vec3::Z);
        let extent = |axis: Vec3| {
            let coordinates = on_wall(normal).map(|neighbor| offset(neighbor).dot(axis));
            let (low, high) = coordinates.fold((0.0f32, 0.0f32), |(a, b), x| (a.min(x), b.max(x)));
            high - low
        };
        if extent(along) < MIN_WIDTH * extent(Vec3::Z) {
            return None;
        }
        let mut around = Octants::default();
        for neighbor in on_wall(normal) {
            around.insert(octant(offset(neighbor).dot(along), offset(neighbor).z));
        }
        let n_reached = if around.has_gap(MIN_EMPTY) { N_REACHED_AT_RIM } else { N_REACHED };
        Some(Self {
            normal,
            reach: on_wall(normal).nth(n_reached - 1)?.distance_squared.sqrt(),
            points: on_wall(normal).map(|neighbor| neighbor.index).collect(),
        })
    }
}

/// True if at least half of the points on the wall of point `i` have a wall in the same direction.
fn is_confirmed(i: usize, walls: &[Option<Wall>]) -> bool {
    let Some(wall) = &walls[i] else { return false };
    let is_parallel = |other: &&u32| {
        let other = walls[**other as usize].as_ref();
        other.is_some_and(|other| MIN_COSINE < other.normal.dot(wall.normal).abs())
    };
    wall.points.len() <= 2 * wall.points.iter().filter(is_parallel).count()
}

/// Returns for each candidate whether a roof lies above or beside it, at most a typical radius lower.
fn are_below_roofs(
    candidates: &[Vec3],
    positions: &[Vec3],
    typical_radius: f32,
    shapes: &[PointShape],
    progress: &dyn Progress,
) -> Result<Vec<bool>> {
    let cells = PlanCells { width: MAX_RADIUS * typical_radius };
    let near = cells.points_near(positions, candidates.iter().copied());
    let plan: Vec<Vec3> = near.iter().map(|p| positions[*p as usize].with_z(0.0)).collect();
    let plan = KdTree::new(&plan, progress)?;
    let is_below = |candidate: &Vec3| {
        progress.check()?;
        let is_roof = |neighbor: &&Neighbor| {
            let point = near[neighbor.index as usize] as usize;
            shapes[point].structure == Structure::Surface
                && MIN_ROOF_COSINE < shapes[point].normal.z.abs()
                && candidate.z < positions[point].z + typical_radius
        };
        let nearest = plan.nearest(candidate.with_z(0.0), N_NEAREST, None);
        Ok(MIN_OF_ROOF <= nearest.iter().filter(is_roof).count())
    };
    candidates.par_iter().map(is_below).collect()
}

#[cfg(test)]
mod tests {
    //! A building on land, with walls of few points, and a tree.

    use super::*;
    use crate::math::Random;
    use crate::points::{PointCloud, Preparation, PreparedCloud, StructureChoice, prepare};
    use crate::progress::NoProgress;

    /// Half of the width of the building.
    const HALF: f32 = 10.0;
    /// Height of the roof.
    const HEIGHT: f32 = 16.0;
    const N_ON_WALLS: usize = 200;

    /// Prepares a building whose walls have a point every 6 square units, on land with 4 points a square unit. The points of
    /// the walls come first, those of a tree last.
    fn prepared(structure: StructureChoice) -> (PreparedCloud, Vec<Structure>) {
        let mut random = Random::new(7, 0);
        let mut noise = |size: f32| size * (random.next_f32() - 0.5);
        let mut points: Vec<Vec3> = Vec::new();
        for i in 0..N_ON_WALLS {
            let side = if i / 2 % 2 == 0 { HALF } else { -HALF } + noise(0.1);
            let (along, z) = (noise(2.0 * HALF), HEIGHT / 2.0 + noise(HEIGHT));
            let is_east = i % 2 == 0;
            points.push(if is_east {
                Vec3::new(side, along, z)
            } else {
                Vec3::new(along, side, z)
            });
        }
        for _ in 0..40_000 {
            let p = Vec3::new(noise(100.0), noise(100.0), noise(0.1));
            let is_roof = p.x.abs().max(p.y.abs()) < HALF;
            points.push(if is_roof { p.with_z(p.z + HEIGHT) } else { p });
        }
        let tree = Vec3::new(30.0, 30.0, 8.0);
        points.extend((0..1000).map(|_| tree + Vec3::new(noise(8.0), noise(8.0), noise(8.0))));
        let cloud = PointCloud::from_positions(points);
        let preparation = Preparation { structure, ..Preparation::default() };
        let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        (cloud, structures)
    }

    #[test]
    fn sparse_walls_below_roofs_are_surfaces_and_trees_are_not() {
        let (cloud, structures) = prepared(StructureChoice::Auto);
        let is_wall = |point: &usize| {
            let normal = cloud.normals()[*point];
            let facing = if point.is_multiple_of(2) { normal.x } else { normal.y };
            structures[*point] == Structure::Surface && 0.95 < facing.abs()
        };
        let n_walls = (0..N_ON_WALLS).filter(is_wall).count();
        assert!(3 * N_ON_WALLS / 4 < n_walls, "{n_walls} of {N_ON_WALLS}");
        let tree = &structures[cloud.len() - 1000..];
        let n_scattered = tree.iter().filter(|kind| **kind == Structure::Scatter).count();
        assert!(950 < n_scattered, "{n_scattered}");
    }

    #[test]
    fn walls_end_at_the_roof_and_at_the_corners() {
        let (cloud, structures) = prepared(StructureChoice::Auto);
        let is_upright = |point: &usize| {
            structures[*point] == Structure::Surface && cloud.normals()[*point].z.abs() < 0.3
        };
        let discs: Vec<usize> = (0..N_ON_WALLS).filter(is_upright).collect();
        let (mut top, mut side) = (0.0f32, 0.0f32);
        for point in &discs {
            let (position, radius) = (cloud.positions[*point], cloud.radii()[*point]);
            let along = if point.is_multiple_of(2) { position.y } else { position.x };
            top = top.max(position.z + radius - HEIGHT);
            side = side.max(along.abs() + radius - HALF);
        }
        assert!(N_ON_WALLS / 2 < discs.len() && top < 1.5 && side < 2.0, "{top} {side}");
    }

    #[test]
    fn walls_stay_scattered_where_all_points_are_to_be() {
        let (_, structures) = prepared(StructureChoice::Scatter);
        assert!(structures.iter().all(|structure| *structure == Structure::Scatter));
    }
}

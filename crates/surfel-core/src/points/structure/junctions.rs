//! Junctions and borders. Where a wall meets a floor that goes on behind it, no plane has half of a point's neighbours, and at
//! the border of a surface the nearest neighbours lie on a line by chance. Such points belong to the surface points nearby in
//! whose planes they lie.

use super::edge_planes::PLANE_THICKNESS;
use super::point_shape::{PointShape, Structure};
use super::vegetation::{MIN_VEGETATION, count_scattered};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours that are looked at.
const N_NEIGHBORS: usize = 48;
/// Number of nearest ones, whose radius thickness and noise are relative to.
const N_NEAREST: usize = 16;
/// Thickness of a plane in standard deviations of the noise.
const N_DEVIATIONS: f32 = 2.5;
/// Maximum thickness, in radii: in thicker planes chance has many points.
const MAX_THICKNESS: f32 = 0.25;
/// Minimum number of surface points nearby in whose planes a scattered point lies and whose normals agree.
const MIN_AGREEING: usize = N_NEIGHBORS / 4;
/// Minimum number of them for a point on a line. One on a scan line has neighbours on lines.
const MIN_AGREEING_ON_LINE: usize = 44;
/// Distance beyond the border of a sampling at which other points are looked for, in distances of the point on it from the
/// mean of its neighbours.
const BEYOND: f32 = 4.0;
/// Number of these points.
const N_BEYOND: usize = 8;
/// Minimum ratio of their radii to that of a point on the border.
const MIN_SPARSER: f32 = 2.0;
/// Minimum cosine between normals that agree.
const MIN_COSINE: f32 = 0.95;
/// Number of rounds: joined points join others.
const N_ROUNDS: usize = 2;

/// Joins scattered points and points on lines to the surfaces in whose planes they lie. `noise` is that of the points in radii
/// of their neighbourhoods. Leaves of clouds with much vegetation stay scattered, and so do points of very noisy clouds.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::error::Error::Cancelled) if `progress` is cancelled.
pub fn join_to_surfaces(
    tree: &KdTree,
    noise: f32,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let thickness = PLANE_THICKNESS.max(N_DEVIATIONS * noise);
    for _ in 0..N_ROUNDS {
        let normal = |point, shapes: &[PointShape]| {
            normal_at_border(tree, point, thickness.min(MAX_THICKNESS), shapes)
        };
        join(Structure::Line, shapes, progress, normal)?;
    }
    if MAX_THICKNESS < thickness {
        return Ok(());
    }
    for _ in 0..N_ROUNDS {
        if MIN_VEGETATION * shapes.len() as f32 <= count_scattered(shapes) as f32 {
            return Ok(());
        }
        let normal =
            |point, shapes: &[PointShape]| normal_at_junction(tree, point, thickness, shapes);
        join(Structure::Scatter, shapes, progress, normal)?;
    }
    Ok(())
}

/// Joins those points of a structure to a surface for which `normal` returns its normal.
fn join(
    structure: Structure,
    shapes: &mut [PointShape],
    progress: &dyn Progress,
    normal: impl Fn(usize, &[PointShape]) -> Option<Vec3> + Sync,
) -> Result<()> {
    let is_candidate = |point: &usize| shapes[*point].structure == structure;
    let candidates: Vec<usize> = (0..shapes.len()).filter(is_candidate).collect();
    let normal = |point: &usize| {
        progress.check()?;
        Ok(normal(*point, shapes))
    };
    let normals = candidates.par_iter().map(normal).collect::<Result<Vec<_>>>()?;
    for (point, normal) in candidates.into_iter().zip(normals) {
        if let Some(normal) = normal {
            shapes[point].structure = Structure::Surface;
            shapes[point].normal = normal;
        }
    }
    Ok(())
}

/// Returns the normal of the surface that a scattered point belongs to.
fn normal_at_junction(
    tree: &KdTree,
    point: usize,
    thickness: f32,
    shapes: &[PointShape],
) -> Option<Vec3> {
    let around = tree.nearest(tree.positions()[point], N_NEIGHBORS, Some(point as u32));
    let (n_agreeing, normal) =
        normal_of_surface(tree.positions(), point, &around, thickness, shapes)?;
    (MIN_AGREEING <= n_agreeing).then_some(normal)
}

/// Returns the normal of the surface at whose border a point on a line lies.
fn normal_at_border(
    tree: &KdTree,
    point: usize,
    thickness: f32,
    shapes: &[PointShape],
) -> Option<Vec3> {
    let position = tree.positions()[point];
    // Few neighbours are enough to tell most points of scan lines.
    let nearest = tree.nearest(position, N_NEAREST, Some(point as u32));
    let others = nearest.iter().map(|other| shapes[other.index as usize].structure);
    let n_others = others.filter(|other| *other != Structure::Surface).count();
    if N_NEIGHBORS - MIN_AGREEING_ON_LINE < n_others {
        return None;
    }
    let around = tree.nearest(position, N_NEIGHBORS, Some(point as u32));
    let (n_agreeing, normal) =
        normal_of_surface(tree.positions(), point, &around, thickness, shapes)?;
    let is_at_border =
        MIN_AGREEING_ON_LINE <= n_agreeing && !is_sparser_beyond(tree, point, &around, shapes);
    is_at_border.then_some(normal)
}

/// Returns true if points of a surface lie far less densely beyond a border than around the point on it: the disc of a point
/// on a line may reach them.
fn is_sparser_beyond(
    tree: &KdTree,
    point: usize,
    neighbors: &[Neighbor],
    shapes: &[PointShape],
) -> bool {
    let position = tree.positions()[point];
    let sum: Vec3 = neighbors.iter().map(|other| tree.positions()[other.index as usize]).sum();
    let outward = position - sum / neighbors.len() as f32;
    let beyond = tree.nearest(position + BEYOND * outward, N_BEYOND, Some(point as u32));
    beyond.iter().map(|other| &shapes[other.index as usize]).any(|other| {
        other.structure == Structure::Surface && MIN_SPARSER * shapes[point].radius < other.radius
    })
}

/// Returns the normal with which most surface points nearby agree, among those in whose planes the point lies, and how many
/// agree.
fn normal_of_surface(
    positions: &[Vec3],
    point: usize,
    neighbors: &[Neighbor],
    thickness: f32,
    shapes: &[PointShape],
) -> Option<(usize, Vec3)> {
    let thickness = thickness * kth_distance(neighbors, N_NEAREST);
    let normals: Vec<Vec3> = neighbors
        .iter()
        .map(|neighbor| neighbor.index as usize)
        .filter(|other| shapes[*other].structure == Structure::Surface)
        .filter(|other| {
            let height = shapes[*other].normal.dot(positions[point] - positions[*other]);
            height.abs() < thickness
        })
        .map(|other| shapes[other].normal)
        .collect();
    let agreeing = |normal: &Vec3| {
        normals.iter().filter(|other| MIN_COSINE < normal.dot(**other).abs()).count()
    };
    let counts = normals.iter().map(|normal| (agreeing(normal), *normal));
    // The first of the best is nearest.
    counts.rev().max_by_key(|(count, _)| *count)
}

#[cfg(test)]
mod tests {
    //! Walls on a floor that goes on behind them.

    use super::*;
    use crate::math::Random;
    use crate::points::test_clouds::prepared;
    use crate::points::{PointCloud, Preparation, prepare};
    use crate::progress::NoProgress;

    #[test]
    fn a_wall_that_stands_on_a_floor_is_a_surface_down_to_it() {
        let mut random = Random::new(3, 0);
        let mut next = || random.next_f32();
        let mut points: Vec<Vec3> =
            (0..8000).map(|_| Vec3::new(4.0 * next(), 2.0 * next(), 0.0)).collect();
        points.extend((0..4000).map(|_| Vec3::new(4.0 * next(), 1.0, next())));
        let mut random = Random::new(4, 0);
        let mut noise = || 0.002 * random.next_gaussian() as f32;
        points.iter_mut().for_each(|p| *p += Vec3::new(noise(), noise(), noise()));
        let cloud = PointCloud::from_positions(points);
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap_or_default();
        let n_scattered = structures.iter().filter(|one| **one == Structure::Scatter).count();
        assert!(n_scattered < 12, "{n_scattered}");
    }

    /// A border point may have neighbours on a line by chance, whose disc would reach across openings.
    #[test]
    fn few_points_at_the_borders_of_random_strips_are_on_lines() {
        let mut random = Random::new(5, 0);
        let mut anywhere = || Vec3::new(100.0 * random.next_f32(), 160.0 * random.next_f32(), 0.0);
        let mut points: Vec<Vec3> = (0..16_000).map(|_| anywhere()).collect();
        // The points are 1 apart, the strips 12 wide and the openings 8.
        points.retain(|point| point.x % 20.0 < 12.0);
        let (cloud, structures) = prepared(points);
        let discs = cloud.radii().iter().zip(&structures);
        let n_wide = discs.filter(|(r, s)| 4.0 < **r && **s == Structure::Surface).count();
        assert!(n_wide < 90, "{n_wide}");
    }
}

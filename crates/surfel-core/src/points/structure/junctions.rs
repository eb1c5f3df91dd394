//! Junctions: where a wall meets a floor that goes on behind it, no plane has half of a point's neighbours. Such points
//! belong to the surface points nearby in whose planes they lie.

use super::edge_planes::PLANE_THICKNESS;
use super::point_shape::{PointShape, Structure};
use super::vegetation::MIN_VEGETATION;
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
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
/// Minimum number of surface points nearby in whose planes a point lies and whose normals agree.
const MIN_AGREEING: usize = N_NEIGHBORS / 4;
/// Minimum cosine between normals that agree.
const MIN_COSINE: f32 = 0.95;
/// Number of rounds: joined points join others.
const N_ROUNDS: usize = 2;

/// Joins scattered points to the surfaces in whose planes they lie. `noise` is that of the points in radii of their
/// neighbourhoods. Leaves of clouds with much vegetation stay as they are, and so do very noisy clouds.
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
    if MAX_THICKNESS < thickness {
        return Ok(());
    }
    for _ in 0..N_ROUNDS {
        let is_scattered = |point: &usize| shapes[*point].structure == Structure::Scatter;
        let scattered: Vec<usize> = (0..shapes.len()).filter(is_scattered).collect();
        if MIN_VEGETATION * shapes.len() as f32 <= scattered.len() as f32 {
            return Ok(());
        }
        let normal = |point: &usize| {
            progress.check()?;
            Ok(normal_of_surface(tree, *point, thickness, shapes))
        };
        let normals = scattered.par_iter().map(normal).collect::<Result<Vec<_>>>()?;
        for (point, normal) in scattered.into_iter().zip(normals) {
            if let Some(normal) = normal {
                shapes[point].structure = Structure::Surface;
                shapes[point].normal = normal;
            }
        }
    }
    Ok(())
}

/// Returns the normal with which most surface points nearby agree, among those in whose planes the point lies.
fn normal_of_surface(
    tree: &KdTree,
    point: usize,
    thickness: f32,
    shapes: &[PointShape],
) -> Option<Vec3> {
    let positions = tree.positions();
    let neighbors = tree.nearest(positions[point], N_NEIGHBORS, Some(point as u32));
    let thickness = thickness * kth_distance(&neighbors, N_NEAREST);
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
    let best = counts.rev().max_by_key(|(count, _)| *count);
    best.filter(|(count, _)| MIN_AGREEING <= *count).map(|(_, normal)| normal)
}

#[cfg(test)]
mod tests {
    //! Walls on a floor that goes on behind them.

    use super::*;
    use crate::math::Random;
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
}

//! Scattered points of a cloud whose file states the normals of a surface: sparse points of a detailed object.

use super::point_shape::{PointShape, Structure};
use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::KdTree;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours whose normals are compared.
const N_NEIGHBORS: usize = 8;
/// Minimum cosine of the angle between normals that agree.
const MIN_COS: f32 = 0.5;
/// Maximum sine of the angle between the plane of a point and the direction to a neighbour on the same surface.
const MAX_RISE: f32 = 0.5;
/// Minimum fraction of the neighbours that agree with a point of a surface.
const MIN_AGREEING_NEIGHBORS: f32 = 0.6;
/// Minimum fraction of the scattered points for all of them to be of a surface. It is 0.9 for a head of 1,400 points, and
/// 0.3 for points that fill a volume with normals of planes through 16 neighbours.
const MIN_AGREEING_POINTS: f32 = 0.75;

/// Makes a surface of the scattered points if the normals that the file states agree with each other and with the
/// positions, around most of them. Their shapes get these normals.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn join_by_stated_normals(
    tree: &KdTree,
    normals: &[Vec3],
    structures: &mut [Structure],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let scattered: Vec<usize> =
        (0..structures.len()).filter(|point| structures[*point] == Structure::Scatter).collect();
    let agrees = |point: &usize| {
        if point.is_multiple_of(4096) {
            progress.check()?;
        }
        Ok(agrees_with_neighbors(tree, normals, *point))
    };
    let agreeing: Vec<bool> = scattered.par_iter().map(agrees).collect::<Result<_>>()?;
    let n_agreeing = agreeing.iter().filter(|agrees| **agrees).count();
    if (n_agreeing as f32) < MIN_AGREEING_POINTS * scattered.len() as f32 {
        return Ok(());
    }
    for point in scattered {
        structures[point] = Structure::Surface;
        if normals[point] != Vec3::ZERO {
            shapes[point].normal = normals[point];
        }
    }
    Ok(())
}

/// Returns true if most neighbours of a point have similar normals and lie near its plane.
fn agrees_with_neighbors(tree: &KdTree, normals: &[Vec3], point: usize) -> bool {
    let (positions, normal) = (tree.positions(), normals[point]);
    let neighbors = tree.nearest(positions[point], N_NEIGHBORS, Some(point as u32));
    let is_agreeing = |other: usize| {
        let offset = positions[other] - positions[point];
        MIN_COS < normal.dot(normals[other])
            && normal.dot(offset).abs() < MAX_RISE * offset.length()
    };
    let n_agreeing = neighbors.iter().filter(|other| is_agreeing(other.index as usize)).count();
    MIN_AGREEING_NEIGHBORS * neighbors.len() as f32 <= n_agreeing as f32
}

#[cfg(test)]
mod tests {
    //! Sparse points with stated normals, and points that fill a volume.

    use crate::math::{Random, Vec3};
    use crate::points::{PointCloud, Preparation, Structure, prepare};
    use crate::progress::NoProgress;

    fn n_scattered(cloud: PointCloud) -> usize {
        let (cloud, _) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let structures = cloud.structures().unwrap_or_default();
        structures.iter().filter(|structure| **structure == Structure::Scatter).count()
    }

    /// Points on a thin spiral tube, hardly more than its neighbours around it.
    fn sparse_tube() -> PointCloud {
        let mut random = Random::new(1, 0);
        let point = |_| {
            let along = 12.0 * random.next_f32();
            let (sin, cos) = (std::f32::consts::TAU * random.next_f32()).sin_cos();
            let (axis_sin, axis_cos) = along.sin_cos();
            let out = Vec3::new(axis_cos, axis_sin, 0.0);
            let normal = cos * out + sin * Vec3::Z;
            (2.0 * out + 0.15 * along * Vec3::Z + 0.3 * normal, normal)
        };
        let (positions, normals): (Vec<Vec3>, Vec<Vec3>) = (0..500).map(point).unzip();
        PointCloud { normals: Some(normals), ..PointCloud::from_positions(positions) }
    }

    #[test]
    fn sparse_points_with_normals_of_a_surface_form_one() {
        let tube = sparse_tube();
        let without = PointCloud::from_positions(tube.positions.clone());
        assert!(400 < n_scattered(without));
        assert!(n_scattered(tube) < 5);
    }

    #[test]
    fn points_that_fill_a_volume_stay_scattered_whatever_their_normals() {
        let mut random = Random::new(2, 0);
        let crown = |_| Vec3::from_array(std::array::from_fn(|_| random.next_f32()));
        let positions: Vec<Vec3> = (0..3000).map(crown).collect();
        let up = vec![Vec3::Z; positions.len()];
        let outward = positions.iter().map(|p| (*p - 0.5).normalize_or(Vec3::X)).collect();
        for normals in [up, outward] {
            let normals = Some(normals);
            let cloud = PointCloud { normals, ..PointCloud::from_positions(positions.clone()) };
            assert!(2000 < n_scattered(cloud));
        }
    }
}

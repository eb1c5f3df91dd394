//! Curvature of the surface at each point, from a sphere fitted to its neighbours (Guennebaud and Gross, Algebraic Point
//! Set Surfaces, 2007), and radii that follow it: where the surface bends, fewer points make a disc.

use crate::error::Result;
use crate::math::Vec3;
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood, spacing_per_reach};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours of a sphere.
const N_NEIGHBORS: usize = 16;
/// Maximum height of the surface over the rim of a point's disc, in spacings.
const MAX_HEIGHT: f32 = 0.1;
/// Minimum factor on a radius: with a radius of 0.7 a disc has half as many points, which still close the surface.
const MIN_FACTOR: f32 = 0.7;

/// Returns radii that are no larger than the curvature of the surface allows. `radii` are the distances to the `k`-th
/// neighbours, and `normals` are unit or zero, with any signs.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn radii_by_curvature(
    positions: &[Vec3],
    normals: &[Vec3],
    radii: &[f32],
    k: usize,
    progress: &dyn Progress,
) -> Result<Vec<f32>> {
    let curvature = |point: usize, near: &[Neighbor]| curvature(positions, normals, point, near);
    let tree = KdTree::new(positions, progress)?;
    let curvatures = tree.map(Neighborhood::Nearest(N_NEIGHBORS), progress, curvature)?;
    let fitted = |(radius, curvature): (&f32, &f32)| {
        let spacing = radius * spacing_per_reach(k as f32);
        // A disc of radius r touches a sphere of curvature c, whose surface is c r^2 / 2 below its rim.
        let most = (2.0 * MAX_HEIGHT * spacing / curvature).sqrt();
        most.clamp(MIN_FACTOR * radius, *radius)
    };
    Ok(radii.par_iter().zip(&curvatures).map(fitted).collect())
}

/// Returns the curvature of the sphere fitted to a point and its neighbours, 0 where they determine none.
fn curvature(positions: &[Vec3], normals: &[Vec3], point: usize, neighbors: &[Neighbor]) -> f32 {
    let Some(last) = neighbors.last() else { return 0.0 };
    let support = 1.5 * last.distance_squared.max(f32::MIN_POSITIVE);
    let (own, center) = (normals[point], positions[point]);
    let (mut w, mut p, mut n, mut pn, mut pp) = (1.0, Vec3::ZERO, own, 0.0, 0.0);
    for neighbor in neighbors {
        let i = neighbor.index as usize;
        let offset = positions[i] - center;
        let normal = if normals[i].dot(own) < 0.0 { -normals[i] } else { normals[i] };
        let weight = (1.0 - neighbor.distance_squared / support).max(0.0).powi(4);
        w += weight;
        p += weight * offset;
        n += weight * normal;
        pn += weight * offset.dot(normal);
        pp += weight * offset.length_squared();
    }
    let bend = 0.5 * (pn - p.dot(n) / w) / (pp - p.length_squared() / w);
    let gradient = (n - 2.0 * bend * p) / w;
    let curvature = 2.0 * bend.abs() / gradient.length();
    if curvature.is_finite() { curvature } else { 0.0 }
}

#[cfg(test)]
mod tests {
    //! A sphere has the curvature of its radius, a plane none, whatever the signs of normals.

    use super::*;
    use crate::math::Random;
    use crate::progress::NoProgress;

    fn with_normals(n: usize, sphere: f32) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut random = Random::new(5, 0);
        let mut normal =
            || Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        let outward: Vec<Vec3> = (0..n).map(|_| normal().normalize()).collect();
        let sign = |i: usize| if i.is_multiple_of(3) { -1.0 } else { 1.0 };
        let normals = outward.iter().enumerate().map(|(i, normal)| sign(i) * *normal).collect();
        (outward.iter().map(|normal| sphere * *normal).collect(), normals)
    }

    #[test]
    fn spheres_have_the_curvature_of_their_radius() {
        for sphere in [1e-3, 2.0, 1e4] {
            let (positions, normals) = with_normals(5000, sphere);
            let tree = KdTree::new(&positions, &NoProgress).unwrap();
            for point in 0..500 {
                let near = tree.nearest(positions[point], N_NEIGHBORS, Some(point as u32));
                let found = curvature(&positions, &normals, point, &near);
                assert!((found * sphere - 1.0).abs() < 1e-2, "{sphere}: {found}");
            }
        }
    }

    #[test]
    fn radii_shrink_where_the_surface_bends_alone() {
        let flat: Vec<Vec3> =
            (0..900).map(|i| Vec3::new((i % 30) as f32, (i / 30) as f32, 0.0)).collect();
        let radii = vec![2.0; 900];
        let found = radii_by_curvature(&flat, &[Vec3::Z; 900], &radii, 12, &NoProgress).unwrap();
        assert_eq!(found, radii);
        // 200 points on a ball of radius 1 are about 0.25 apart, and their discs 0.5 wide.
        let (positions, normals) = with_normals(200, 1.0);
        let found = radii_by_curvature(&positions, &normals, &[0.5; 200], 12, &NoProgress).unwrap();
        assert!(found.iter().all(|radius| (0.35..0.36).contains(radius)), "{found:?}");
    }
}

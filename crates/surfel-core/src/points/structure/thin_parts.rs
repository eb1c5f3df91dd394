//! Thin parts of objects, as fingers, horns and the edges of wings: the nearest points of a point there are on all sides of
//! the part, so that no plane fits them. Fewer of them lie on one side.

use super::connected_parts::connected_parts;
use super::point_shape::{PointShape, Structure, is_surface};
use super::vegetation::count_scattered;
use crate::error::Result;
use crate::math::{Vec3, sampled_quantile};
use crate::points::neighbors::KdTree;
use crate::points::normals::planes::{PlaneFit, fit_plane};
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours on one side of a thin part.
const N_NEIGHBORS: usize = 8;
/// Maximum ratio of the radius of a point to the median of all: sparse points far from others would make shards.
const MAX_RADIUS: f32 = 4.0;
/// Distance of linked points in radii of either: stray points are farther.
const MAX_LINK: f32 = 2.0;
/// Minimum number of points of a part, and the minimum fraction of those whose neighbours lie in a plane. Noise has 0.1 to 0.4.
const OF_PARTS: (usize, f32) = (16, 0.5);
/// Minimum number of points and minimum fraction for details, as the tip of a toe.
const OF_DETAILS: (usize, f32) = (1, 0.25);
/// Maximum fraction of scattered points in a cloud where these are details rather than noise.
const MAX_SCATTERED: f32 = 0.1;

/// Makes surfaces of the connected scattered points half of which lie in a plane with few neighbours, and of details a quarter of
/// which do, unless many points stay scattered. `radii` are those of points of surfaces.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn join_thin_parts(
    tree: &KdTree,
    radii: &[f32],
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    join_parts(tree, radii, OF_PARTS, shapes, progress)?;
    if count_scattered(shapes) as f32 <= MAX_SCATTERED * shapes.len() as f32 {
        join_parts(tree, radii, OF_DETAILS, shapes, progress)?;
    }
    Ok(())
}

/// Makes surfaces of the connected scattered points that are at least so many and of which at least this fraction lies in a plane
/// with few neighbours.
fn join_parts(
    tree: &KdTree,
    radii: &[f32],
    (min_points, min_even): (usize, f32),
    shapes: &mut [PointShape],
    progress: &dyn Progress,
) -> Result<()> {
    let max_radius = MAX_RADIUS * sampled_quantile(radii, 0.5);
    let is_scattered =
        |point: usize| shapes[point].structure == Structure::Scatter && radii[point] <= max_radius;
    let positions = tree.positions();
    let is_linked = |point: usize, other: usize| {
        let reach = MAX_LINK * radii[point].min(radii[other]);
        positions[point].distance(positions[other]) < reach
    };
    let parts = connected_parts(tree, is_scattered, is_linked, progress)?;
    // Each plane with the distance to the last of its points.
    let fit = |point: &u32| -> Result<(PlaneFit, f32)> {
        progress.check()?;
        let neighbors = tree.nearest(positions[*point as usize], N_NEIGHBORS, Some(*point));
        let fit = fit_plane(positions, *point as usize, &neighbors);
        Ok((fit, kth_distance(&neighbors, N_NEIGHBORS)))
    };
    let even_fits = |part: &Vec<u32>| -> Result<Option<Vec<(PlaneFit, f32)>>> {
        if part.len() < min_points {
            return Ok(None);
        }
        let fits = part.par_iter().map(fit).collect::<Result<Vec<_>>>()?;
        let n_even = fits.iter().filter(|(fit, _)| is_surface(fit)).count();
        Ok((min_even * part.len() as f32 <= n_even as f32).then_some(fits))
    };
    let fits = parts.par_iter().map(even_fits).collect::<Result<Vec<_>>>()?;
    for (part, fits) in parts.iter().zip(fits) {
        for (point, (fit, reach)) in part.iter().zip(fits.into_iter().flatten()) {
            let point = *point as usize;
            if fit.normal != Vec3::ZERO {
                let (structure, radius) = (Structure::Surface, radii[point].min(reach));
                shapes[point] = PointShape { structure, normal: fit.normal, radius };
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Fingers and stray points.

    use super::*;
    use crate::math::Random;
    use crate::points::test_clouds::prepared;
    use crate::progress::NoProgress;
    use std::f32::consts::TAU;

    /// Returns a ball of radius 10 with a spacing of about 1, and a finger with eight points around.
    fn hand(at_finger: impl Fn(&mut Random, Vec3) -> Vec3) -> Vec<Vec3> {
        let mut random = Random::new(4, 0);
        let mut points: Vec<Vec3> = (0..1200)
            .map(|i| {
                let z = 1.0 - (2.0 * i as f32 + 1.0) / 1200.0;
                let (sin, cos) = (2.399_963 * i as f32).sin_cos();
                10.0 * Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
            })
            .collect();
        points.extend((0..160).map(|i| {
            let (sin, cos) = (TAU * (i % 8) as f32 / 8.0 + 0.4 * (i / 8) as f32).sin_cos();
            let axis = Vec3::new(0.0, 0.0, 12.0 + (i / 8) as f32);
            at_finger(&mut random, axis + 1.2 * Vec3::new(cos, sin, 0.0))
        }));
        points
    }

    #[test]
    fn a_finger_is_a_surface_and_points_that_fill_it_are_not() {
        let n_of_surface = |points: Vec<Vec3>| {
            let (cloud, structures) = prepared(points);
            let finger = cloud.positions().iter().zip(&structures).filter(|(p, _)| 11.5 < p.z);
            finger.filter(|(_, structure)| **structure == Structure::Surface).count()
        };
        assert_eq!(n_of_surface(hand(|_, point| point)), 160);
        let filled = |random: &mut Random, point: Vec3| {
            let [x, y, z] = std::array::from_fn(|_| 6.0 * (random.next_f32() - 0.5));
            Vec3::new(x, y, point.z + z)
        };
        assert!(n_of_surface(hand(filled)) < 40);
    }

    #[test]
    fn a_small_bump_of_a_surface_is_a_detail_and_one_amid_noise_is_not() {
        // A grid with a bump of nine points, and points that fill a box.
        let grid = (0..900).map(|i| {
            let [x, y] = [i % 30, i / 30];
            let is_bump = (14..17).contains(&x) && (14..17).contains(&y);
            Vec3::new(x as f32, y as f32, if is_bump { 0.7 } else { 0.0 })
        });
        let grid: Vec<Vec3> = grid.collect();
        let mut random = Random::new(6, 0);
        let mut noise: Vec<Vec3> = (0..300)
            .map(|_| 6.0 * Vec3::from_array([0; 3].map(|_| random.next_f32())) + 50.0 * Vec3::Z)
            .collect();
        let n_scattered = |points: Vec<Vec3>| {
            let tree = KdTree::new(&points, &NoProgress).unwrap();
            let is_scattered = |point: &Vec3| 0.5 < point.z;
            let shape = |point: &Vec3| PointShape {
                structure: if is_scattered(point) {
                    Structure::Scatter
                } else {
                    Structure::Surface
                },
                normal: Vec3::Z,
                radius: 2.0,
            };
            let mut shapes: Vec<PointShape> = points.iter().map(shape).collect();
            join_thin_parts(&tree, &vec![2.0; points.len()], &mut shapes, &NoProgress).unwrap();
            let bump =
                shapes.iter().zip(&points).filter(|(_, point)| (0.5..9.0).contains(&point.z));
            bump.filter(|(shape, _)| shape.structure == Structure::Scatter).count()
        };
        assert_eq!(n_scattered(grid.clone()), 0);
        noise.extend(grid);
        assert_eq!(n_scattered(noise), 9);
    }

    #[test]
    fn a_stray_point_beyond_a_finger_stays_a_ball() {
        let mut points = hand(|_, point| point).split_off(1200);
        points.push(Vec3::new(0.0, 0.0, 50.0));
        let tree = KdTree::new(&points, &NoProgress).unwrap();
        let ball = PointShape { structure: Structure::Scatter, normal: Vec3::Z, radius: 1.0 };
        let mut shapes = vec![ball; points.len()];
        join_thin_parts(&tree, &vec![3.0; points.len()], &mut shapes, &NoProgress).unwrap();
        let (stray, finger) = shapes.split_last().unwrap();
        assert_eq!(stray.structure, Structure::Scatter);
        assert!(finger.iter().all(|shape| shape.structure == Structure::Surface));
    }
}

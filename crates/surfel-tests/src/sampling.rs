//! Samples of a mesh's surface: random, evenly spaced, of falling density, noisy.

use crate::ground_truth::GroundTruth;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use surfel_core::math::{Aabb, Random, Vec3};
use surfel_core::points::neighbors::{Neighbor, NeighborMethod, Neighborhood, map_neighborhoods};
use surfel_core::progress::NoProgress;

/// The way in which points are spread over a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Points are evenly spaced, as if they pushed each other away.
    Uniform,
    /// Points are independent of each other.
    Random,
    /// Evenly spaced points are moved by normally distributed offsets; the number is the standard deviation along
    /// each axis in units of the mean spacing.
    Noisy(f32),
    /// Points are locally even, and their number per area falls along Z from the bottom by a factor of ten.
    Falling,
}

impl Sampling {
    /// Every sampling of the benchmark with its name.
    pub const ALL: [(&'static str, Self); 5] = [
        ("uniform", Self::Uniform),
        ("random", Self::Random),
        ("noise-0.3", Self::Noisy(0.3)),
        ("noise-0.6", Self::Noisy(0.6)),
        ("falling", Self::Falling),
    ];

    /// Returns `n` points of the surface.
    pub fn sample(self, mesh: &GroundTruth, n: usize, seed: u64) -> Vec<Vec3> {
        match self {
            Self::Uniform => even(mesh, n, seed, |_| 1.0),
            Self::Random => random(mesh, n, seed, |_| 1.0),
            Self::Noisy(deviation) => {
                let mut points = even(mesh, n, seed, |_| 1.0);
                add_noise(&mut points, deviation * mean_spacing(mesh, n), seed);
                points
            }
            Self::Falling => {
                let bounds = mesh.bounds();
                even(mesh, n, seed, |position| falling_density(&bounds, position))
            }
        }
    }
}

/// Returns the mean spacing of `n` points: the side of a square that has the area of the surface per point.
pub fn mean_spacing(mesh: &GroundTruth, n: usize) -> f32 {
    (area(mesh) / n as f64).sqrt() as f32
}

fn area(mesh: &GroundTruth) -> f64 {
    mesh.triangles().map(|corners| f64::from(triangle_area(corners))).sum()
}

fn triangle_area([a, b, c]: [Vec3; 3]) -> f32 {
    0.5 * (b - a).cross(c - a).length()
}

/// Returns the density at a position relative to that at the bottom.
fn falling_density(bounds: &Aabb, position: Vec3) -> f32 {
    0.1f32.powf((position.z - bounds.min.z) / (bounds.max.z - bounds.min.z))
}

/// Returns independent points; `density`, at most 1, is proportional to their number per area.
fn random(mesh: &GroundTruth, n: usize, seed: u64, density: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
    let triangles: Vec<[Vec3; 3]> = mesh.triangles().collect();
    let mut total = 0.0;
    let areas = triangles.iter().map(|corners| {
        total += f64::from(triangle_area(*corners));
        total
    });
    let cumulative_areas: Vec<f64> = areas.collect();
    let mut random = Random::new(seed, 0);
    let mut points = Vec::with_capacity(n);
    while points.len() < n {
        let target = total * random.next_f64();
        let triangle_idx = cumulative_areas.partition_point(|area| *area <= target);
        let [a, b, c] = triangles[triangle_idx.min(triangles.len() - 1)];
        let (u, v) = (random.next_f32(), random.next_f32());
        // The parallelogram's other half is folded onto the triangle.
        let (u, v) = if 1.0 < u + v { (1.0 - u, 1.0 - v) } else { (u, v) };
        let point = a + u * (b - a) + v * (c - a);
        if random.next_f32() < density(point) {
            points.push(point);
        }
    }
    points
}

/// Returns evenly spaced points by weighted sample elimination (Yuksel, Sample Elimination for Generating Poisson
/// Disk Sample Sets, 2015) of five times as many random ones.
fn even(
    mesh: &GroundTruth,
    n: usize,
    seed: u64,
    density: impl Fn(Vec3) -> f32 + Sync,
) -> Vec<Vec3> {
    const OVERSAMPLING: usize = 5;
    const N_NEIGHBORS: usize = 32;
    let candidates = random(mesh, OVERSAMPLING * n, seed, &density);
    // The area that the points would have at a density of 1: each candidate represents 1 / density of its share.
    let inverse_densities = candidates.iter().map(|point| 1.0 / f64::from(density(*point)));
    let effective_area = area(mesh) * candidates.len() as f64 / inverse_densities.sum::<f64>();
    // The radius of discs in the densest packing of n.
    let packing = (effective_area / (2.0 * 3f64.sqrt() * n as f64)).sqrt() as f32;
    let radius = |point: Vec3| packing / density(point).sqrt();
    let weights = |point: usize, neighbors: &[Neighbor]| {
        let mut weights = [(u32::MAX, 0.0); N_NEIGHBORS];
        for (slot, neighbor) in weights.iter_mut().zip(neighbors) {
            let reach = radius(candidates[point]) + radius(candidates[neighbor.index as usize]);
            let overlap = (1.0 - neighbor.distance_squared.sqrt() / reach).max(0.0);
            *slot = (neighbor.index, overlap.powi(8));
        }
        weights
    };
    let neighborhood = Neighborhood::Nearest(N_NEIGHBORS);
    let knn = NeighborMethod::Knn;
    let weights = map_neighborhoods(&candidates, knn, neighborhood, &NoProgress, weights).unwrap();
    let kept = eliminate(&weights, n);
    candidates.into_iter().zip(kept).filter(|(_, is_kept)| *is_kept).map(|(p, _)| p).collect()
}

/// Removes the candidate whose weights have the greatest sum, again and again, until `n` are left.
fn eliminate<const K: usize>(weights: &[[(u32, f32); K]], n: usize) -> Vec<bool> {
    let sum = |weights: &[(u32, f32); K]| weights.iter().map(|(_, weight)| weight).sum();
    let mut sums: Vec<f32> = weights.iter().map(sum).collect();
    let mut is_kept = vec![true; weights.len()];
    let mut n_kept = weights.len();
    // Weights are not negative, so their bits sort as they do.
    let entry = |sum: f32, candidate: usize| (sum.max(0.0).to_bits(), Reverse(candidate));
    let entries = sums.iter().enumerate().map(|(candidate, sum)| entry(*sum, candidate));
    let mut queue: BinaryHeap<_> = entries.collect();
    while n < n_kept {
        let Some((bits, Reverse(candidate))) = queue.pop() else { break };
        if !is_kept[candidate] {
            continue;
        }
        // An entry from before its neighbours were removed returns with the present sum.
        let present = entry(sums[candidate], candidate);
        if present.0 < bits {
            queue.push(present);
            continue;
        }
        is_kept[candidate] = false;
        n_kept -= 1;
        for (neighbor, weight) in weights[candidate] {
            if let Some(sum) = sums.get_mut(neighbor as usize) {
                *sum -= weight;
            }
        }
    }
    is_kept
}

fn add_noise(points: &mut [Vec3], deviation: f32, seed: u64) {
    let mut random = Random::new(seed, 1);
    for point in points {
        let offset = [(); 3].map(|()| random.next_gaussian() as f32);
        *point += deviation * Vec3::from_array(offset);
    }
}

#[cfg(test)]
mod tests {
    //! Samplings have the spacing, the density and the noise that they are named for.

    use super::*;
    use crate::shapes;
    use surfel_core::points::neighbors::KdTree;

    const N_POINTS: usize = 2000;

    fn samples(sampling: Sampling) -> (GroundTruth, Vec<Vec3>) {
        let mesh = GroundTruth::from_mesh(&shapes::cube());
        let points = sampling.sample(&mesh, N_POINTS, 1);
        assert_eq!(points.len(), N_POINTS);
        (mesh, points)
    }

    fn nearest_distances(points: &[Vec3]) -> Vec<f32> {
        let tree = KdTree::new(points, &NoProgress).unwrap();
        let nearest = |i: usize| tree.nearest(points[i], 1, Some(i as u32))[0].distance_squared;
        (0..points.len()).map(|i| nearest(i).sqrt()).collect()
    }

    #[test]
    fn uniform_points_keep_a_distance_from_each_other() {
        let (mesh, points) = samples(Sampling::Uniform);
        let spacing = mean_spacing(&mesh, N_POINTS);
        let min = nearest_distances(&points).into_iter().fold(f32::MAX, f32::min);
        assert!(0.6 * spacing < min, "{min} of {spacing}");
    }

    #[test]
    fn random_points_have_the_mean_distance_of_a_poisson_process() {
        let (mesh, points) = samples(Sampling::Random);
        let distances = nearest_distances(&points);
        let mean = distances.iter().sum::<f32>() / N_POINTS as f32;
        let expected = 0.5 * mean_spacing(&mesh, N_POINTS);
        assert!((mean / expected - 1.0).abs() < 0.06, "{mean} instead of {expected}");
    }

    #[test]
    fn falling_points_are_ten_times_denser_at_the_bottom() {
        let (mesh, points) = samples(Sampling::Falling);
        let bounds = mesh.bounds();
        let height = |point: &Vec3| (point.z - bounds.min.z) / (bounds.max.z - bounds.min.z);
        let uniform = Sampling::Random.sample(&mesh, 50_000, 2);
        let density = |low: f32, high: f32| {
            let count = |points: &[Vec3]| {
                points.iter().filter(|point| (low..high).contains(&height(point))).count() as f32
            };
            count(&points) / count(&uniform)
        };
        let ratio = density(0.1, 0.3) / density(0.7, 0.9);
        // Between heights of 0.2 and 0.8 the density falls to a fourth.
        assert!((3.3..4.8).contains(&ratio), "{ratio}");
    }

    #[test]
    fn noise_moves_points_by_its_deviation() {
        let (mesh, exact) = samples(Sampling::Uniform);
        let noisy = Sampling::Noisy(0.3).sample(&mesh, N_POINTS, 1);
        let squares = exact.iter().zip(&noisy).map(|(a, b)| a.distance_squared(*b));
        let deviation = (squares.sum::<f32>() / (3 * N_POINTS) as f32).sqrt();
        let expected = 0.3 * mean_spacing(&mesh, N_POINTS);
        assert!((deviation / expected - 1.0).abs() < 0.05, "{deviation} instead of {expected}");
    }
}

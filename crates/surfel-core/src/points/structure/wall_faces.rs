//! Faces of thin walls, boards and doors: the points of the other face lie among the neighbours, so that the plane through all
//! of them may have any direction. Most of those near the plane of a point's own face lie on it.

use super::point_shape::{PointShape, Structure};
use crate::error::Result;
use crate::math::{Vec3, hash};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::points::normals::planes::fit_plane;
use crate::points::radii::radius::kth_distance;
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours among which a face is sought.
pub const N_FACE_NEIGHBORS: usize = 96;
/// Number of nearest neighbours that give the planes that are tried.
const N_NEAREST: usize = 12;
/// Number of planes that are tried.
const N_PLANES: u64 = 48;
/// Distances from a plane of the points on it, in radii of the neighbourhood, from the least noise on.
const THICKNESSES: [f32; 3] = [0.06, 0.1, 0.16];
/// Number of times that a plane is fitted again to the points near it, and their distance from it, in distances of those on it.
const N_REFITS: usize = 3;
const REFIT_DISTANCE: f32 = 2.0;
/// Distance from a plane within which others are counted, in distances of those on it.
const WIDER: f32 = 3.0;
/// Minimum fraction, of these, of the points on the plane. Of points that fill space, a third is on any plane.
const MIN_FRACTION: f32 = 0.8;
/// Number of nearest points on a face that a disc reaches.
const N_REACHED: usize = 12;
/// Maximum fraction, of the points farther away, of those on one side: a wall has its other face on the other side. Leaves that one
/// sweep of the scanner saw lie in a plane, too, amid those of other sweeps.
const MAX_OTHER_SIDE: f32 = 0.05;
/// Minimum number of neighbours on the plane.
const MIN_POINTS: usize = 12;
/// Minimum width of the points on the plane, as the ratio of its eigenvalues: a narrow strip has many planes.
const MIN_WIDTH: f32 = 0.2;

/// The face of a thin wall.
pub struct Face {
    /// Unit normal of either sign.
    pub normal: Vec3,
    /// The neighbours on it, nearest first.
    pub points: Vec<Neighbor>,
    /// The neighbours behind it, as those on the other face.
    others: Vec<Neighbor>,
}

impl Face {
    /// Returns the face of a point, or `None` if too few of the neighbours near any plane through the point lie on it. `seed`
    /// decides which planes are tried.
    pub fn of(positions: &[Vec3], point: usize, neighbors: &[Neighbor], seed: u32) -> Option<Self> {
        let center = positions[point];
        let offset = |neighbor: &Neighbor| positions[neighbor.index as usize] - center;
        let offsets: Vec<Vec3> = neighbors.iter().map(offset).collect();
        let reach = offsets.last()?.length();
        // The nearest neighbours are on the same face, however many points the other one has.
        let nearest = &offsets[..N_NEAREST.min(offsets.len())];
        let reach_of_nearest = nearest.last()?.length();
        let candidate = |plane: u64| {
            let bits = hash(u64::from(seed) << 8 | plane);
            let [a, b] =
                [bits, bits >> 32].map(|bits| nearest[(bits % nearest.len() as u64) as usize]);
            let cross = a.cross(b);
            // Short or nearly parallel offsets give a plane of any tilt.
            (0.2 * reach_of_nearest * reach_of_nearest < cross.length()).then(|| cross.normalize())
        };
        let candidates: Vec<Vec3> = (0..N_PLANES).filter_map(candidate).collect();
        let n_within = |normal: Vec3, height: f32| {
            offsets.iter().filter(|offset| normal.dot(**offset).abs() < height).count()
        };
        // Planes across both faces have many points, too, but more of them nearby.
        let best = |thickness: f32| {
            let score = |normal: &Vec3| {
                let near = n_within(*normal, WIDER * thickness) as i32;
                2 * n_within(*normal, thickness) as i32 - near
            };
            candidates.iter().copied().max_by_key(score)
        };
        THICKNESSES.into_iter().find_map(|thickness| {
            let thickness = thickness * reach;
            let mut plane = Plane { normal: best(thickness)?, height: 0.0 };
            for _ in 0..N_REFITS {
                let near = plane.points_within(REFIT_DISTANCE * thickness, neighbors, &offsets);
                let fit = fit_plane(positions, point, &near);
                if fit.width < MIN_WIDTH {
                    return None;
                }
                let sum: f32 = near.iter().map(|other| fit.normal.dot(offset(other))).sum();
                // The point itself has no height.
                plane = Plane { normal: fit.normal, height: sum / (near.len() + 1) as f32 };
            }
            plane.is_face(thickness, &offsets).then(|| {
                let is_near =
                    |other: &&Neighbor| plane.height_of(offset(other)).abs() < WIDER * thickness;
                let (points, others) = (
                    plane.points_within(thickness, neighbors, &offsets),
                    neighbors.iter().filter(|other| !is_near(other)).copied().collect(),
                );
                Self { normal: plane.normal, points, others }
            })
        })
    }
}

/// Makes discs of the scattered points on a face of a wall whose other points are on a surface.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn join_faces(tree: &KdTree, shapes: &mut [PointShape], progress: &dyn Progress) -> Result<()> {
    let is_scattered = |point: &usize| shapes[*point].structure == Structure::Scatter;
    let scattered: Vec<usize> = (0..shapes.len()).filter(is_scattered).collect();
    let on_face = |point: &usize| {
        progress.check()?;
        let (positions, own) = (tree.positions(), Some(*point as u32));
        let neighbors = tree.nearest(positions[*point], N_FACE_NEIGHBORS, own);
        let Some(face) = Face::of(positions, *point, &neighbors, *point as u32) else {
            return Ok(None);
        };
        let is_surface =
            |other: &&Neighbor| shapes[other.index as usize].structure == Structure::Surface;
        let n_on_surface = face.others.iter().filter(is_surface).count();
        let radius = kth_distance(&face.points, N_REACHED);
        let shape = PointShape { structure: Structure::Surface, normal: face.normal, radius };
        Ok((face.others.len() < 2 * n_on_surface).then_some(shape))
    };
    let found = scattered.par_iter().map(on_face).collect::<Result<Vec<_>>>()?;
    for (point, shape) in scattered.into_iter().zip(found) {
        shapes[point] = shape.unwrap_or(shapes[point]);
    }
    Ok(())
}

/// A plane beside a point.
struct Plane {
    normal: Vec3,
    /// Height above the point.
    height: f32,
}

impl Plane {
    /// Returns the neighbours at less than a distance.
    fn points_within(
        &self,
        distance: f32,
        neighbors: &[Neighbor],
        offsets: &[Vec3],
    ) -> Vec<Neighbor> {
        let is_within =
            |(_, offset): &(&Neighbor, &Vec3)| self.height_of(**offset).abs() < distance;
        neighbors.iter().zip(offsets).filter(is_within).map(|(neighbor, _)| *neighbor).collect()
    }

    fn height_of(&self, offset: Vec3) -> f32 {
        self.normal.dot(offset) - self.height
    }

    /// True if most of the points near the plane lie on it, and all others on one side.
    fn is_face(&self, thickness: f32, offsets: &[Vec3]) -> bool {
        let (mut n_on_plane, mut n_near, mut n_above) = (0, 0, 0);
        for height in offsets.iter().map(|offset| self.height_of(*offset)) {
            n_on_plane += usize::from(height.abs() < thickness);
            n_near += usize::from(height.abs() < WIDER * thickness);
            n_above += usize::from(WIDER * thickness <= height);
        }
        let n_beyond = offsets.len() - n_near;
        let on_other_side = n_above.min(n_beyond - n_above);
        MIN_POINTS <= n_on_plane
            && MIN_FRACTION * n_near as f32 <= n_on_plane as f32
            && on_other_side as f32 <= MAX_OTHER_SIDE * n_beyond as f32
    }
}

#[cfg(test)]
mod tests {
    //! A thin wall whose faces were measured at different distances, and points that fill space.

    use super::*;
    use crate::math::Random;
    use crate::points::{Denoise, PointCloud, Preparation, prepare};
    use crate::progress::NoProgress;

    const THICKNESS: f32 = 0.12;
    const N_SPARSE: usize = 2000;

    /// A wall of 2 x 2 with noise: 500 points a unit on the face at z = 0, which come first, and 8 times as many on the other.
    fn thin_wall() -> Vec<Vec3> {
        let mut random = Random::new(8, 0);
        let mut point = |z: f32| {
            let noise = 0.01 * random.next_gaussian() as f32;
            Vec3::new(2.0 * random.next_f32(), 2.0 * random.next_f32(), z + noise)
        };
        let mut points: Vec<Vec3> = (0..N_SPARSE).map(|_| point(0.0)).collect();
        points.extend((0..8 * N_SPARSE).map(|_| point(THICKNESS)));
        points
    }

    fn face(tree: &KdTree, point: usize) -> Option<Face> {
        let positions = tree.positions();
        let neighbors = tree.nearest(positions[point], N_FACE_NEIGHBORS, Some(point as u32));
        Face::of(positions, point, &neighbors, point as u32)
    }

    #[test]
    fn a_sparse_point_has_the_plane_of_its_own_face() {
        let points = thin_wall();
        let tree = KdTree::new(&points, &NoProgress).unwrap();
        let mut n_found = 0;
        for point in 0..N_SPARSE {
            let Some(Face { normal, points: on_face, .. }) = face(&tree, point) else { continue };
            assert!(0.9 < normal.z.abs(), "{normal}");
            assert!(on_face.iter().all(|other| (other.index as usize) < N_SPARSE));
            n_found += 1;
        }
        assert!(9 * N_SPARSE < 10 * n_found, "{n_found}");
    }

    #[test]
    fn points_that_fill_space_or_lie_in_parallel_planes_have_no_face() {
        let mut random = Random::new(9, 0);
        for height_of_plane in [0.0f32, 0.1] {
            let mut axis = || 2.0 * random.next_f32() - 1.0;
            let mut point = |_| {
                let z = axis();
                let plane = (z / height_of_plane).round() * height_of_plane;
                Vec3::new(axis(), axis(), if plane.is_finite() { plane } else { z })
            };
            let points: Vec<Vec3> = (0..4000).map(&mut point).collect();
            let tree = KdTree::new(&points, &NoProgress).unwrap();
            let inner = (0..points.len()).filter(|i| points[*i].abs().max_element() < 0.7);
            let n_faces = inner.filter(|point| face(&tree, *point).is_some()).count();
            assert!(n_faces < 40, "{n_faces}, {height_of_plane}");
        }
    }

    #[test]
    fn both_faces_of_a_noisy_thin_wall_are_surfaces() {
        let cloud = PointCloud::from_positions(thin_wall());
        let preparation = Preparation { denoise: Denoise::On, ..Preparation::default() };
        let (cloud, _) = prepare(cloud, &preparation, &NoProgress).unwrap();
        let structures = cloud.structures().unwrap();
        let is_scattered = |structure: &&Structure| **structure == Structure::Scatter;
        let n_scattered = structures[..N_SPARSE].iter().filter(is_scattered).count();
        assert!(n_scattered < N_SPARSE / 50, "{n_scattered}");
        let is_tilted = |normal: &&Vec3| normal.z.abs() < 0.9;
        let n_tilted = cloud.normals()[..N_SPARSE].iter().filter(is_tilted).count();
        assert!(n_tilted < N_SPARSE / 20, "{n_tilted}");
        let squared: f32 = cloud.positions[..N_SPARSE].iter().map(|p| p.z * p.z).sum();
        let noise = (squared / N_SPARSE as f32).sqrt();
        assert!(noise < 0.007, "{noise}");
    }
}

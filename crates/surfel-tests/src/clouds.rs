//! Point clouds of shapes with closed forms, with their exact normals.

use std::f32::consts::PI;
use surfel_core::math::{DVec3, Random, Vec3, hash};
use surfel_core::points::PointCloud;

/// Returns `n` points of a sphere about the origin on a Fibonacci lattice: each represents the same area.
pub fn sphere(n: usize, radius: f32) -> PointCloud {
    let golden_angle = f64::from(PI) * (3.0 - 5f64.sqrt());
    let direction = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z).as_vec3()
    };
    let normals: Vec<Vec3> = (0..n).map(direction).collect();
    with_normals(normals.iter().map(|&normal| radius * normal).collect(), normals)
}

/// Returns `n_side` * `n_side` points of the square |x|, |y| <= 1 at z = 0, each moved by up to `jitter` cells.
pub fn plane(n_side: usize, jitter: f32, seed: u64) -> PointCloud {
    let cell = 2.0 / n_side as f32;
    let mut random = Random::new(seed, 0);
    let mut along =
        |i: usize| -1.0 + cell * (i as f32 + 0.5 + jitter * (2.0 * random.next_f32() - 1.0));
    let positions: Vec<Vec3> = (0..n_side * n_side)
        .map(|i| Vec3::new(along(i % n_side), along(i / n_side), 0.0))
        .collect();
    let normals = vec![Vec3::Z; positions.len()];
    with_normals(positions, normals)
}

/// Returns points of the planes z = 0 and x = 0, which cross along the Y axis.
pub fn crossing_planes(n_side: usize, jitter: f32, seed: u64) -> PointCloud {
    let level = plane(n_side, jitter, seed);
    let upright =
        plane(n_side, jitter, seed + 1).positions.into_iter().map(|p| Vec3::new(0.0, p.y, p.x));
    let n = level.len();
    let positions = level.positions.into_iter().chain(upright).collect();
    with_normals(positions, [vec![Vec3::Z; n], vec![Vec3::X; n]].concat())
}

/// Returns points of the faces of the box |x|, |y|, |z| <= 1, `n_side` * `n_side` points each.
pub fn cube(n_side: usize, jitter: f32, seed: u64) -> PointCloud {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for face in 0..6u8 {
        let sign = if face < 3 { 1.0 } else { -1.0 };
        // A rotation about the diagonal maps one pair of faces to the next.
        let turn = |p: Vec3| match face % 3 {
            0 => p,
            1 => Vec3::new(p.z, p.x, p.y),
            _ => Vec3::new(p.y, p.z, p.x),
        };
        for p in plane(n_side, jitter, seed + u64::from(face)).positions {
            positions.push(turn(p + sign * Vec3::Z));
            normals.push(turn(sign * Vec3::Z));
        }
    }
    with_normals(positions, normals)
}

/// Returns the faces of the cube of side 2 as lattices of `n_side` x `n_side` points, of which the outermost lie on the edges,
/// with outward normals.
pub fn cube_with_edges(n_side: usize) -> PointCloud {
    let mut cloud = cube(n_side, 0.0, 0);
    let stretch = n_side as f32 / (n_side - 1) as f32;
    for position in &mut cloud.positions {
        // The points on a face lie half a spacing within its edges.
        *position = (stretch * *position).clamp(-Vec3::ONE, Vec3::ONE);
    }
    cloud
}

/// Returns `n` points of the X axis from -1 to 1, without normals.
pub fn line(n: usize) -> PointCloud {
    let step = 2.0 / (n.max(2) - 1) as f32;
    PointCloud::from_positions((0..n).map(|i| Vec3::X * (i as f32 * step - 1.0)).collect())
}

/// Returns one point `n` times.
pub fn equal_points(n: usize) -> PointCloud {
    PointCloud::from_positions(vec![Vec3::new(1.0, 2.0, 3.0); n])
}

/// Returns points of a wavy surface, row by row, at a random position in each unit square.
pub fn waves(n_points: usize, phase: f32) -> PointCloud {
    let row_length = n_points.isqrt();
    let mut random = Random::new(1, 0);
    let mut cloud = PointCloud::default();
    let (mut normals, radii) = (Vec::new(), vec![1.0; n_points]);
    for i in 0..n_points {
        let x = (i / row_length) as f32 + random.next_f32();
        let y = (i % row_length) as f32 + random.next_f32();
        let (sin_x, cos_x) = (0.02 * x + phase).sin_cos();
        let (sin_y, cos_y) = (0.03 * y).sin_cos();
        cloud.positions.push(Vec3::new(x, y, 20.0 * sin_x * cos_y));
        normals.push(Vec3::new(-0.4 * cos_x * cos_y, 0.6 * sin_x * sin_y, 1.0).normalize());
    }
    PointCloud { normals: Some(normals), radii: Some(radii), ..cloud }
}

/// Returns a cloud whose normals have random signs.
pub fn with_random_signs(mut cloud: PointCloud) -> PointCloud {
    for (i, normal) in cloud.normals.iter_mut().flatten().enumerate() {
        if hash(i as u64) & 1 == 1 {
            *normal = -*normal;
        }
    }
    cloud
}

/// Returns a copy of a cloud far from the origin, like a survey in the coordinates of a national grid.
pub fn georeferenced(cloud: &PointCloud) -> PointCloud {
    let origin = cloud.origin + DVec3::new(562_340.25, 4_183_210.5, 148.125);
    PointCloud { origin, ..cloud.clone() }
}

fn with_normals(positions: Vec<Vec3>, normals: Vec<Vec3>) -> PointCloud {
    PointCloud { normals: Some(normals), ..PointCloud::from_positions(positions) }
}

#[cfg(test)]
mod tests {
    //! Positions and normals of the clouds that tests use.

    use super::*;

    fn normals(cloud: &PointCloud) -> &[Vec3] {
        cloud.normals.as_deref().unwrap()
    }

    #[test]
    fn sphere_points_are_even() {
        let cloud = sphere(2000, 3.0);
        let mean = cloud.positions.iter().copied().sum::<Vec3>() / 2000.0;
        assert!(mean.length() < 0.01, "{mean}");
        for (position, normal) in cloud.positions.iter().zip(normals(&cloud)) {
            assert!((position.length() - 3.0).abs() < 1e-5 && (normal.length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn cube_points_lie_on_the_face_of_their_normal() {
        let cloud = cube(5, 0.4, 7);
        assert_eq!(cloud.len(), 150);
        for (position, normal) in cloud.positions.iter().zip(normals(&cloud)) {
            assert_eq!(position.dot(*normal), 1.0);
            assert!(position.abs().max_element() <= 1.0);
        }
        let sum = normals(&cloud).iter().copied().sum::<Vec3>();
        assert_eq!(sum, Vec3::ZERO);
    }

    #[test]
    fn outermost_points_of_a_cube_with_edges_lie_on_them() {
        let cloud = cube_with_edges(5);
        let is_on_edge = |p: &&Vec3| 2 <= p.abs().to_array().iter().filter(|x| **x == 1.0).count();
        assert_eq!(cloud.positions.iter().filter(is_on_edge).count(), 6 * 16);
    }

    #[test]
    fn crossing_planes_have_the_normals_of_their_halves() {
        let cloud = crossing_planes(8, 0.3, 1);
        let on_plane = |(p, n): (&Vec3, &Vec3)| p.dot(*n) == 0.0;
        assert!(cloud.positions.iter().zip(normals(&cloud)).all(on_plane));
    }

    #[test]
    fn a_line_includes_both_ends() {
        let cloud = line(11);
        assert_eq!((cloud.positions[0].x, cloud.positions[10].x), (-1.0, 1.0));
    }
}

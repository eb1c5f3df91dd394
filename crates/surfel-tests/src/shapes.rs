//! Closed meshes of shapes with closed forms, which serve as ground truth.

use crate::scenes;
use surfel_core::math::{Mat3, Random, Vec3};
use surfel_core::scene::Mesh;

/// Returns the box |x|, |y|, |z| <= 1, rotated so that no side faces an axis.
pub fn cube() -> Mesh {
    let turn = Mat3::from_axis_angle(Vec3::new(1.0, 2.0, 0.5).normalize(), 0.8);
    let mut mesh = scenes::cuboid(-Vec3::ONE, Vec3::ONE);
    mesh.positions.iter_mut().for_each(|position| *position = turn * *position);
    mesh
}

/// Returns a smooth body of bumps and hollows in 128,000 triangles.
pub fn blob() -> Mesh {
    star(160, 400, |direction| lobed_radius(direction, 1))
}

/// Returns a body of bumps and hollows in 1,520 flat triangles.
pub fn low_poly_blob() -> Mesh {
    star(20, 40, |direction| lobed_radius(direction, 2))
}

/// Returns a head on a neck in 240,000 triangles. Its face looks along -Y.
pub fn head() -> Mesh {
    star(300, 400, head_radius)
}

/// Returns the closed surface at a distance from the origin that depends on the direction.
fn star(n_rings: u32, n_segments: u32, radius: impl Fn(Vec3) -> f32) -> Mesh {
    let mut mesh = scenes::uv_sphere(n_rings, n_segments, 1.0);
    mesh.positions.iter_mut().for_each(|position| *position *= radius(position.normalize()));
    Mesh { normals: None, ..mesh }
}

/// Returns 1 in the direction `center`, and less with the angle to it: 1/e where the cosine of the angle is
/// 1 - 1 / `sharpness`.
fn bump(direction: Vec3, center: Vec3, sharpness: f32) -> f32 {
    (sharpness * (direction.dot(center.normalize()) - 1.0)).exp()
}

fn lobed_radius(direction: Vec3, seed: u64) -> f32 {
    const N_LOBES: usize = 14;
    let mut random = Random::new(seed, 0);
    let lobe = |_| {
        let center = Vec3::from_array([(); 3].map(|()| random.next_gaussian() as f32));
        let height = -0.2 + 0.55 * random.next_f32();
        let sharpness = 4.0 + 16.0 * random.next_f32();
        height * bump(direction, center, sharpness)
    };
    1.0 + (0..N_LOBES).map(lobe).sum::<f32>()
}

fn head_radius(direction: Vec3) -> f32 {
    let mirrored = Vec3::new(direction.x.abs(), direction.y, direction.z);
    let skull = (direction / Vec3::new(0.78, 0.95, 1.12)).length().recip();
    let features = [
        (0.24, Vec3::new(0.0, -1.0, -0.12), 90.0),   // nose
        (0.10, Vec3::new(0.0, -1.0, 0.08), 200.0),   // bridge of the nose
        (-0.09, Vec3::new(0.33, -0.92, 0.14), 70.0), // eye socket
        (0.05, Vec3::new(0.33, -0.92, 0.13), 320.0), // eyeball
        (0.05, Vec3::new(0.32, -0.9, 0.36), 90.0),   // brow
        (0.05, Vec3::new(0.1, -1.0, -0.42), 150.0),  // upper lip
        (-0.04, Vec3::new(0.0, -1.0, -0.5), 300.0),  // mouth
        (0.05, Vec3::new(0.07, -1.0, -0.58), 180.0), // lower lip
        (0.12, Vec3::new(0.0, -0.85, -0.85), 40.0),  // chin
        (0.22, Vec3::new(1.0, 0.1, 0.02), 120.0),    // ear
        (-0.10, Vec3::new(1.0, 0.02, 0.02), 400.0),  // hollow of the ear
        (0.45, Vec3::new(0.0, 0.25, -1.0), 9.0),     // neck
    ];
    let face: f32 = features
        .into_iter()
        .map(|(height, center, sharpness)| height * bump(mirrored, center, sharpness))
        .sum();
    // Hair covers the back and the top.
    let strands = (40.0 * direction.x).sin() * (30.0 * direction.z).sin();
    let hair = ((direction.y + direction.z).clamp(0.2, 0.5) - 0.2) * 0.1 * strands;
    skull + face + hair
}

#[cfg(test)]
mod tests {
    //! The shapes are closed and their features point the right way.

    use super::*;

    #[test]
    fn every_direction_has_a_positive_radius() {
        for mesh in [blob(), low_poly_blob(), head(), cube()] {
            let lengths = mesh.positions.iter().map(|position| position.length());
            let (min, max) =
                lengths.fold((f32::MAX, 0f32), |(min, max), r| (min.min(r), max.max(r)));
            assert!(0.3 < min && max < 2.5, "{min} to {max}");
        }
    }

    #[test]
    fn the_nose_stands_out_of_the_face() {
        let radius = |x, y, z| head_radius(Vec3::new(x, y, z).normalize());
        assert!(radius(0.33, -0.92, 0.1) + 0.15 < radius(0.0, -1.0, -0.12));
        assert!(radius(1.0, 0.5, 0.02) < radius(1.0, 0.1, 0.02));
    }
}

//! Normals of what a camera shows, from a small map of the points nearest to it.

use super::camera::{Camera, Projection};
use super::depth_map::DepthMap;
use super::sample::sample_points;
use crate::math::Vec3;

/// Width over height of the map: that of a picture.
const ASPECT: f64 = 16.0 / 9.0;
/// Maximum number of points that are looked at: enough for the largest map.
const MAX_SAMPLES: usize = 400_000;

/// Returns the unit normals, facing `camera`, of the surface that `points` show it: one for each pixel of a small picture
/// whose neighbours show points, too. The camera is in the coordinates of the points.
pub fn visible_normals(points: &[Vec3], camera: &Camera) -> Vec<Vec3> {
    let map = DepthMap::new(&sample_points(points, MAX_SAMPLES), camera, ASPECT);
    let [_, _, forward] = camera.axes();
    let toward_camera = |point: Vec3| match camera.projection {
        Projection::Orthographic { .. } => -forward.as_vec3(),
        _ => camera.position.as_vec3() - point,
    };
    let normal = |(x, y): (usize, usize)| {
        let across = map.nearest(x + 1, y)? - map.nearest(x - 1, y)?;
        let along = map.nearest(x, y + 1)? - map.nearest(x, y - 1)?;
        let normal = across.cross(along).try_normalize()?;
        let is_facing = 0.0 < normal.dot(toward_camera(map.nearest(x, y)?));
        Some(if is_facing { normal } else { -normal })
    };
    let (width, height) = map.size;
    let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
    inner.filter_map(normal).collect()
}

#[cfg(test)]
mod tests {
    //! The visible sides of a box have their normals.

    use super::*;
    use crate::math::{DVec3, Random};

    #[test]
    fn visible_sides_of_a_box_have_their_normals() {
        let mut random = Random::new(8, 0);
        let mut side = |i: usize| {
            let mut p = Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
            p[i % 3] = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            p
        };
        let points: Vec<Vec3> = (0..60_000).map(&mut side).collect();
        let projections = [
            Projection::Perspective { view_angle_deg: 35.0 },
            Projection::Orthographic { height: 4.0 },
        ];
        for projection in projections {
            let camera = Camera {
                position: DVec3::new(6.0, 3.0, 2.0),
                focal_point: DVec3::ZERO,
                view_up: DVec3::Z,
                projection,
            };
            assert!(visible_normals(&[], &camera).is_empty());
            let normals = visible_normals(&points, &camera);
            let along = |axis: Vec3| normals.iter().filter(|n| 0.95 < n.dot(axis)).count();
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(along);
            assert!(z < y && y < x && 0 < z, "{x} {y} {z}");
            assert!(
                0.8 * normals.len() as f32 <= (x + y + z) as f32,
                "{} {}",
                normals.len(),
                x + y + z
            );
        }
    }
}

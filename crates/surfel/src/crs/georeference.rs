//! The place of a plan: the world coordinates of its pixels.

use super::{CoordinateSystem, Unit};
use surfel_core::math::DVec3;
use surfel_core::scene::{Camera, Projection};
use surfel_formats::Georeference;

/// Returns where the pixels of a camera's picture lie, if it looks straight down without perspective.
pub fn georeference(
    camera: &Camera,
    (width, height): (u32, u32),
    system: Option<&CoordinateSystem>,
) -> Option<Georeference> {
    let Projection::Orthographic { height: shown } = camera.projection else { return None };
    let [right, up, forward] = camera.axes();
    if 1e-9 < (forward + DVec3::Z).length() {
        return None;
    }
    let pixel_size = shown / f64::from(height);
    let [right, down] = [right, -up].map(|axis| [axis.x, axis.y].map(|x| pixel_size * x + 0.0));
    let middle = [camera.position.x, camera.position.y];
    let half = [0.5 * f64::from(width), 0.5 * f64::from(height)];
    let corner = [0, 1].map(|i| middle[i] - half[0] * right[i] - half[1] * down[i]);
    Some(Georeference {
        corner,
        right,
        down,
        epsg: system.and_then(CoordinateSystem::epsg),
        is_geographic: system.is_some_and(|system| system.unit() == Unit::Degrees),
    })
}

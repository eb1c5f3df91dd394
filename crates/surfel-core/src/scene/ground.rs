//! East, north and other directions of a world with any up direction.

use crate::math::{DVec3, Vec3};

/// Returns unit vectors to the east and north for a world with the unit vector `up`.
///
/// They are +X and +Y if up is +Z, and +X and -Z if up is +Y, as glTF files are rotated.
pub(super) fn ground_axes(up: Vec3) -> (Vec3, Vec3) {
    let east = if up.x.abs() < 0.9 { Vec3::X } else { Vec3::Y };
    let east = (east - east.dot(up) * up).normalize();
    (east, up.cross(east))
}

/// Returns the unit vector toward `azimuth_deg` clockwise from north and `elevation_deg` above the horizon, for a world
/// with the unit vector `up`.
pub(super) fn direction(azimuth_deg: f64, elevation_deg: f64, up: Vec3) -> DVec3 {
    let (east, north) = ground_axes(up);
    let (sin_azimuth, cos_azimuth) = azimuth_deg.to_radians().sin_cos();
    let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
    let level = sin_azimuth * east.as_dvec3() + cos_azimuth * north.as_dvec3();
    cos_elevation * level + sin_elevation * up.as_dvec3()
}

/// Returns the unit vector to the north of a world with the unit vector `up`: +Y if up is +Z.
pub fn north(up: Vec3) -> Vec3 {
    ground_axes(up).1
}

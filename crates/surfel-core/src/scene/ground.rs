//! East and north of a world with any up direction.

use crate::math::Vec3;

/// Returns unit vectors to the east and north for a world with the unit vector `up`.
///
/// They are +X and +Y if up is +Z, and +X and -Z if up is +Y, as glTF files are rotated.
pub(super) fn ground_axes(up: Vec3) -> (Vec3, Vec3) {
    let east = if up.x.abs() < 0.9 { Vec3::X } else { Vec3::Y };
    let east = (east - east.dot(up) * up).normalize();
    (east, up.cross(east))
}

/// Returns the unit vector to the north of a world with the unit vector `up`: +Y if up is +Z.
pub fn north(up: Vec3) -> Vec3 {
    ground_axes(up).1
}

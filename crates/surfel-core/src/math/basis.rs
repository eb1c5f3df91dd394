//! Orthonormal bases around a direction, and the rotation in a linear map.

use super::{DMat3, DQuat, DVec3, Floats, Vec3, Vec3Lanes};

/// A right-handed orthonormal basis around a given third vector.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    /// Unit vector of the local X axis.
    pub tangent: Vec3,
    /// Unit vector of the local Y axis.
    pub bitangent: Vec3,
    /// Unit vector of the local Z axis, around which the basis was built.
    pub normal: Vec3,
}

impl Basis {
    /// Builds a basis around the unit vector `normal` (Duff et al., Building an Orthonormal Basis, Revisited,
    /// 2017).
    pub fn around(normal: Vec3) -> Self {
        let sign = 1.0f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// Transforms a local vector to the space in which the basis is given.
    pub fn to_world(&self, local: Vec3) -> Vec3 {
        local.x * self.tangent + local.y * self.bitangent + local.z * self.normal
    }
}

/// Returns the tangents and bitangents around unit normals in lanes, computed like those of `Basis::around`; a zero has no
/// sign here.
#[inline(always)]
pub fn tangents<F: Floats>(normal: Vec3Lanes<F>) -> [Vec3Lanes<F>; 2] {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let sign = F::select(normal.z.lt(zero), F::splat(-1.0), one);
    let a = F::splat(-1.0) / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = Vec3Lanes {
        x: one + sign * normal.x * normal.x * a,
        y: sign * b,
        z: zero - sign * normal.x,
    };
    [tangent, Vec3Lanes { x: b, y: sign + normal.y * normal.y * a, z: zero - normal.y }]
}

/// Returns the rotation of a linear map that may also scale, shear and mirror: its first axis keeps its direction, its
/// second the plane. The identity if there is none.
pub fn rotation_of(linear: &DMat3) -> DQuat {
    let x = linear.x_axis.normalize_or_zero();
    let z = x.cross(linear.y_axis).normalize_or_zero();
    if z == DVec3::ZERO || !linear.is_finite() {
        return DQuat::IDENTITY;
    }
    DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize()
}

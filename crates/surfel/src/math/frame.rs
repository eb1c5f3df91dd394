//! Orthonormal frames around a direction.

use super::{Floats, Vec3, Vec3Lanes};

/// A right-handed orthonormal basis whose third vector was given.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub tangent: Vec3,
    pub bitangent: Vec3,
    pub normal: Vec3,
}

impl Frame {
    /// Around the unit vector `normal` (Duff et al., Building an Orthonormal Basis, Revisited, 2017).
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

    pub fn to_world(&self, local: Vec3) -> Vec3 {
        local.x * self.tangent + local.y * self.bitangent + local.z * self.normal
    }
}

/// Tangents and bitangents around unit normals in lanes, as `Frame::around` has them.
#[inline(always)]
pub fn tangents<F: Floats>(normal: Vec3Lanes<F>) -> [Vec3Lanes<F>; 2] {
    let (zero, one) = (F::splat(0.0), F::splat(1.0));
    let sign = F::select(normal.z.less(zero), F::splat(-1.0), one);
    let a = F::splat(-1.0) / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = Vec3Lanes {
        x: one + sign * normal.x * normal.x * a,
        y: sign * b,
        z: zero - sign * normal.x,
    };
    [tangent, Vec3Lanes { x: b, y: sign + normal.y * normal.y * a, z: zero - normal.y }]
}

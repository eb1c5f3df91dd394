//! Orthonormal frames around a direction.

use super::Vec3;

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

    /// Components of `vector` along tangent and bitangent.
    pub fn project(&self, vector: Vec3) -> (f32, f32) {
        (vector.dot(self.tangent), vector.dot(self.bitangent))
    }
}

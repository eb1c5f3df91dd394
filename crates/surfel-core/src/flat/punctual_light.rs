//! Punctual lights in world coordinates.

use crate::math::{DAffine3, DQuat, DVec3, Vec3};
use crate::scene::{PunctualLight, PunctualLightKind};
use std::f32::consts::PI;

/// A punctual light in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatPunctualLight {
    /// The distribution of the light.
    pub kind: PunctualLightKind,
    /// Position relative to the scene's origin.
    pub position: Vec3,
    /// Unit direction in which the light shines.
    pub direction: Vec3,
    /// Linear RGB radiance that a white matte surface reflects if it faces the light at distance 1.
    pub color: Vec3,
    /// Maximum distance that the light reaches.
    pub range: f32,
    /// Radius of the luminous ball.
    pub radius: f32,
}

impl FlatPunctualLight {
    /// Transforms `light` to the world. Returns none if the transform leaves it no direction.
    pub(super) fn new(
        light: &PunctualLight,
        world_from_node: DAffine3,
        origin: DVec3,
    ) -> Option<Self> {
        let direction = world_from_node.transform_vector3(-DVec3::Z).try_normalize()?;
        Some(Self {
            kind: light.kind,
            position: (world_from_node.translation - origin).as_vec3(),
            direction: direction.as_vec3(),
            color: light.color / PI,
            range: light.range,
            radius: light.radius,
        })
    }

    /// Returns the light rotated about `center`.
    pub fn rotated_about(&self, rotation: DQuat, center: Vec3) -> Self {
        let rotate = |vector: Vec3| (rotation * vector.as_dvec3()).as_vec3();
        let position = center + rotate(self.position - center);
        Self { position, direction: rotate(self.direction), ..*self }
    }

    /// Returns the factor by which the light is attenuated in the unit `direction` from it at `distance`.
    /// Directional light is not attenuated.
    pub fn falloff(&self, direction: Vec3, distance: f32) -> f32 {
        if self.kind == PunctualLightKind::Directional {
            return 1.0;
        }
        // The window and the cone of KHR_lights_punctual: inverse square falloff that ends at the range.
        let window = (1.0 - (distance / self.range).powi(4)).clamp(0.0, 1.0);
        let spot = match self.kind {
            PunctualLightKind::Spot { inner_rad, outer_rad } => {
                let cos = direction.dot(self.direction);
                let (inner, outer) = (inner_rad.cos(), outer_rad.cos());
                ((cos - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0).powi(2)
            }
            _ => 1.0,
        };
        window * spot / (distance * distance).max(1e-12)
    }
}

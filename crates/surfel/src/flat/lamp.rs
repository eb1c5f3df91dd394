//! Lamps where they stand in the world.

use crate::math::{DAffine3, DQuat, DVec3, Vec3};
use crate::scene::{Lamp, LampKind};
use std::f32::consts::PI;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatLamp {
    pub kind: LampKind,
    /// Relative to the scene's origin.
    pub position: Vec3,
    /// Unit: where it shines.
    pub direction: Vec3,
    /// Linear: what a white matte surface facing it at distance 1 throws back.
    pub color: Vec3,
    /// Nothing beyond this is lit.
    pub range: f32,
    /// Of the ball that shines.
    pub radius: f32,
}

impl FlatLamp {
    /// None where the transform leaves no direction.
    pub(super) fn place(lamp: &Lamp, world_from_node: DAffine3, origin: DVec3) -> Option<Self> {
        let direction = world_from_node.transform_vector3(-DVec3::Z).try_normalize()?;
        Some(Self {
            kind: lamp.kind,
            position: (world_from_node.translation - origin).as_vec3(),
            direction: direction.as_vec3(),
            color: lamp.color / PI,
            range: lamp.range,
            radius: lamp.radius,
        })
    }

    /// The lamp carried about a place.
    pub fn turned(&self, turn: DQuat, center: Vec3) -> Self {
        let turned = |vector: Vec3| (turn * vector.as_dvec3()).as_vec3();
        let position = center + turned(self.position - center);
        Self { position, direction: turned(self.direction), ..*self }
    }

    /// What share of the lamp's light reaches a place in `direction` (unit, from the lamp) at a distance.
    pub fn falloff(&self, direction: Vec3, distance: f32) -> f32 {
        if self.kind == LampKind::Directional {
            return 1.0;
        }
        // As KHR_lights_punctual has it: inverse square, windowed so that it ends at the range.
        let window = (1.0 - (distance / self.range).powi(4)).clamp(0.0, 1.0);
        let spot = match self.kind {
            LampKind::Spot { inner_rad, outer_rad } => {
                let cos = direction.dot(self.direction);
                let (inner, outer) = (inner_rad.cos(), outer_rad.cos());
                ((cos - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0).powi(2)
            }
            _ => 1.0,
        };
        window * spot / (distance * distance).max(1e-12)
    }
}

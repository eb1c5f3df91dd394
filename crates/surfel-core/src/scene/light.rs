//! Lights. A white matte surface that faces a light of unit strength has radiance 1.

use super::environment::Environment;
use super::ground::direction;
use crate::math::{DQuat, Vec3};

/// A light of the whole scene. [`PunctualLight`]s are attached to nodes instead.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// Parallel light from a disc in the sky.
    Sun(Sun),
    /// A gradient sky with ambient occlusion.
    Sky(Sky),
    /// An environment map.
    Environment(Environment),
    /// A light of this strength at the camera, without shadows.
    Headlight(f32),
}

/// Parallel light with the soft shadows of a disc in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector toward the sun.
    pub direction: Vec3,
    /// Linear colour times strength. Unit strength means an irradiance of π at normal incidence.
    pub color: Vec3,
    /// Angular diameter in degrees: 0 gives hard shadows, the real sun has 0.53.
    pub angular_diameter_deg: f32,
}

/// Light from all directions, dimmed by nearby occluders (ambient occlusion).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Unit vector toward the zenith.
    pub up: Vec3,
    /// Linear radiance from the zenith.
    pub zenith: Vec3,
    /// Linear radiance from straight below.
    pub ground: Vec3,
    /// Distance in world units beyond which occluders have no effect, and up to which their effect falls off
    /// linearly; may be infinite.
    pub ao_distance: f32,
}

/// A light that is attached to a node and shines along the node's -Z axis (KHR_lights_punctual).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PunctualLight {
    /// Directional, point or spot light.
    pub kind: PunctualLightKind,
    /// Linear colour times intensity: candela, or lux for a directional light. The radiance of a white matte
    /// surface that faces the light at distance 1 is this divided by π.
    pub color: Vec3,
    /// Distance in world units beyond which nothing is lit; may be infinite.
    pub range: f32,
    /// Radius of the luminous sphere in world units: 0 gives hard shadows.
    pub radius: f32,
}

/// The kind of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualLightKind {
    /// Parallel light from infinitely far away.
    Directional,
    /// Light to all directions.
    Point,
    /// A cone of light about the node's -Z axis.
    Spot {
        /// Angle from the axis in radians up to which the light has full strength.
        inner_rad: f32,
        /// Angle from the axis in radians beyond which there is no light.
        outer_rad: f32,
    },
}

impl Sky {
    /// Returns the linear radiance from `direction` (unit).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        // A step at the horizon would show as an edge on every gently curved surface.
        let height = (0.5 + direction.dot(self.up)).clamp(0.0, 1.0);
        self.ground.lerp(self.zenith, height * height * (3.0 - 2.0 * height))
    }
}

impl Light {
    /// Returns the light rotated about the scene.
    pub fn rotated(&self, rotation: DQuat) -> Self {
        let rotated = |direction: Vec3| (rotation * direction.as_dvec3()).as_vec3();
        match self {
            Self::Sun(sun) => Self::Sun(Sun { direction: rotated(sun.direction), ..*sun }),
            Self::Sky(sky) => Self::Sky(Sky { up: rotated(sky.up), ..*sky }),
            Self::Environment(environment) => Self::Environment(environment.rotated(rotation)),
            Self::Headlight(strength) => Self::Headlight(*strength),
        }
    }
}

impl Sun {
    /// Returns the unit vector toward a sun at `azimuth_deg` clockwise from north and `elevation_deg` above
    /// the horizon.
    ///
    /// North is +Y if `up` is +Z, -Z if it is +Y, and otherwise at a right angle to `up` and east.
    pub fn direction_from_angles(azimuth_deg: f32, elevation_deg: f32, up: Vec3) -> Vec3 {
        direction(azimuth_deg.into(), elevation_deg.into(), up).normalize().as_vec3()
    }
}

#[cfg(test)]
mod tests {
    //! The sun's angles are those of a compass, and the sky is uniform if its colours are.

    use super::*;

    #[test]
    fn azimuth_is_clockwise_from_north() {
        let near = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-6, "{a} {b}");
        near(Sun::direction_from_angles(0.0, 0.0, Vec3::Z), Vec3::Y);
        near(Sun::direction_from_angles(90.0, 0.0, Vec3::Z), Vec3::X);
        near(Sun::direction_from_angles(123.0, 90.0, Vec3::Z), Vec3::Z);
        near(Sun::direction_from_angles(0.0, 0.0, Vec3::Y), -Vec3::Z);
    }

    #[test]
    fn a_sky_of_one_color_is_uniform() {
        let sky = Sky { up: Vec3::Z, zenith: Vec3::ONE, ground: Vec3::ONE, ao_distance: 1.0 };
        for direction in [Vec3::Z, -Vec3::Z, Vec3::X] {
            assert_eq!(sky.radiance(direction), Vec3::ONE);
        }
    }
}

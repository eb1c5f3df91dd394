//! Lights. A white matte surface facing a light of strength 1 has radiance 1.

use super::environment::Environment;
use crate::math::{DQuat, Vec3};

#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    Sun(Sun),
    Sky(Sky),
    /// A picture of all that is around.
    Environment(Environment),
    /// At the camera, without shadows: its strength.
    Headlight(f32),
}

/// Parallel light with the shadows of a disc in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit, toward the sun.
    pub direction: Vec3,
    /// Linear colour times strength.
    pub color: Vec3,
    /// 0 gives hard shadows; the real sun has 0.53.
    pub angular_diameter_deg: f32,
}

/// Light from all directions, dimmed by what lies near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    pub up: Vec3,
    /// Linear radiance overhead.
    pub zenith: Vec3,
    /// Linear radiance from straight below.
    pub ground: Vec3,
    /// Occluders farther away than this do not count, nearer ones count linearly; may be infinite.
    pub reach: f32,
}

/// A light that stands at a node and shines along its -Z (KHR_lights_punctual).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    pub kind: LampKind,
    /// Linear colour times intensity: what a white surface facing it at distance 1 throws back, times pi
    /// (candela; lux for a directional one).
    pub color: Vec3,
    /// Nothing beyond this distance is lit; may be infinite.
    pub range: f32,
    /// Of the ball that shines, in world units: 0 gives hard shadows.
    pub radius: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LampKind {
    /// Parallel light from infinitely far away.
    Directional,
    Point,
    /// Full within the inner angle from the axis, nothing beyond the outer one.
    Spot {
        inner_rad: f32,
        outer_rad: f32,
    },
}

impl Sky {
    /// Radiance from `direction` (unit).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        // A smooth horizon: a step would show as an edge on every slowly turning surface.
        let height = (0.5 + direction.dot(self.up)).clamp(0.0, 1.0);
        self.ground.lerp(self.zenith, height * height * (3.0 - 2.0 * height))
    }
}

impl Light {
    /// The light carried about the scene.
    pub fn turned(&self, turn: DQuat) -> Self {
        let turned = |direction: Vec3| (turn * direction.as_dvec3()).as_vec3();
        match self {
            Self::Sun(sun) => Self::Sun(Sun { direction: turned(sun.direction), ..*sun }),
            Self::Sky(sky) => Self::Sky(Sky { up: turned(sky.up), ..*sky }),
            Self::Environment(environment) => Self::Environment(environment.turned(turn)),
            Self::Headlight(strength) => Self::Headlight(*strength),
        }
    }
}

impl Sun {
    /// Unit vector toward a sun at `azimuth_deg` clockwise from north and `elevation_deg` above the horizon.
    ///
    /// North is +Y where `up` is +Z; for other ups it is the axis that takes that place.
    pub fn toward(azimuth_deg: f32, elevation_deg: f32, up: Vec3) -> Vec3 {
        let (sin_azimuth, cos_azimuth) = azimuth_deg.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
        let (east, north) = ground_axes(up);
        (cos_elevation * (sin_azimuth * east + cos_azimuth * north) + sin_elevation * up)
            .normalize()
    }
}

/// East and north for a world whose up is `up`: +X and +Y for +Z, +X and -Z for +Y (as glTF is turned).
pub(super) fn ground_axes(up: Vec3) -> (Vec3, Vec3) {
    let east = if up.x.abs() < 0.9 { Vec3::X } else { Vec3::Y };
    let east = (east - east.dot(up) * up).normalize();
    (east, up.cross(east))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuth_is_clockwise_from_north() {
        let near = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-6, "{a} {b}");
        near(Sun::toward(0.0, 0.0, Vec3::Z), Vec3::Y);
        near(Sun::toward(90.0, 0.0, Vec3::Z), Vec3::X);
        near(Sun::toward(123.0, 90.0, Vec3::Z), Vec3::Z);
        near(Sun::toward(0.0, 0.0, Vec3::Y), -Vec3::Z);
    }

    #[test]
    fn a_uniform_sky_is_uniform() {
        let sky = Sky { up: Vec3::Z, zenith: Vec3::ONE, ground: Vec3::ONE, reach: 1.0 };
        for direction in [Vec3::Z, -Vec3::Z, Vec3::X] {
            assert_eq!(sky.radiance(direction), Vec3::ONE);
        }
    }
}

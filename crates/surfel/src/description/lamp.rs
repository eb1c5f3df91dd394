//! Lamps: lights at places, which may move.

use super::color_rule::Color;
use super::keys::settings;
use super::rule::{Checked, OneOf, Text, number};
use super::vector_rule::Vector;
use super::{Invalid, read_table};
use serde_json::{Map, Value};
use std::f64::consts::PI;
use std::path::Path;
use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::scene::{Node, PunctualLight, PunctualLightKind, Transform};

/// The shape of a lamp's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LampShape {
    /// Light to all sides.
    Point,
    /// A cone.
    Spot,
    /// Parallel light from infinitely far away.
    Directional,
}

const SHAPES: OneOf<LampShape> = OneOf(&[
    ("point", LampShape::Point),
    ("spot", LampShape::Spot),
    ("directional", LampShape::Directional),
]);

settings! {
    /// A lamp.
    pub struct LampDescription {
        /// Name for animations [default: lamp and its number].
        name: String, Text, "NAME";
        /// point, spot, or directional: parallel light from infinitely far away.
        kind: LampShape = LampShape::Point, SHAPES, "KIND";
        /// Position; of a directional lamp only the direction to the target counts [default of such: above].
        position: DVec3, Vector, "X,Y,Z";
        /// Point that spots and directional lamps shine at.
        target: DVec3 = DVec3::ZERO, Vector, "X,Y,Z";
        /// Colour.
        color: Vec3 = Vec3::ONE, Color, "COLOR";
        /// Strength: 1 makes a white surface that faces the lamp at distance 1 appear white.
        strength: f64 = 1.0, NOT_NEGATIVE, "FACTOR";
        /// Radius of the shining sphere in world units; above 0 shadows are soft.
        radius: f64 = 0.0, NOT_NEGATIVE, "LENGTH";
        /// Distance in world units at which the light has faded to nothing [default: infinite].
        range: f64, ABOVE_ZERO, "LENGTH";
        /// Angle of the whole cone of a spot in degrees.
        angle: f64 = 45.0, ANGLE, "DEG";
        /// Fraction of the cone over which a spot fades.
        blend: f64 = 0.15, number(0.0, 1.0), "FRACTION";
    }
}

const NOT_NEGATIVE: super::rule::Number = number(0.0, f64::INFINITY);
const ABOVE_ZERO: Checked = Checked { allows: |x| 0.0 < x, expected: "a number above 0" };
const ANGLE: Checked =
    Checked { allows: |x| 0.0 < x && x <= 180.0, expected: "degrees above 0, 180 at most" };

impl LampDescription {
    /// Reads a lamp from a table; without a name it is called by its number.
    pub(super) fn read(table: &Map<String, Value>, number: usize) -> Result<Self, Invalid> {
        let mut lamp = Self::default();
        read_table(&mut lamp, table, Path::new(""))?;
        lamp.name.get_or_insert_with(|| format!("lamp {number}"));
        lamp.node()?;
        Ok(lamp)
    }

    /// Returns true if the lamp shines from above, wherever that is.
    pub fn shines_from_above(&self) -> bool {
        self.kind() == LampShape::Directional && self.position.is_none()
    }

    /// Returns a node at the lamp's position that shines toward its target, from +Z if it shines from above.
    ///
    /// # Errors
    ///
    /// Fails without a position, unless the lamp is directional.
    pub fn node(&self) -> Result<Node, Invalid> {
        let outer_rad = (self.angle().to_radians() / 2.0) as f32;
        let kind = match self.kind() {
            LampShape::Point => PunctualLightKind::Point,
            LampShape::Spot => PunctualLightKind::Spot {
                inner_rad: outer_rad * (1.0 - self.blend() as f32),
                outer_rad,
            },
            LampShape::Directional => PunctualLightKind::Directional,
        };
        let target = self.target();
        let position = match (self.position, kind) {
            (Some(position), _) => position,
            // Parallel light comes from above unless a position says otherwise. Up is chosen later.
            (None, PunctualLightKind::Directional) => target + DVec3::Z,
            (None, _) => return Err(Invalid::at("position", "is missing; expected [x, y, z]")),
        };
        let toward = (target - position).try_normalize().unwrap_or(-DVec3::Z);
        // Strength 1 at distance 1 gives a white matte surface the radiance 1, as a sun of strength 1 does.
        let lamp = PunctualLight {
            kind,
            color: (self.strength() * PI) as f32 * self.color(),
            range: self.range.map_or(f32::INFINITY, |range| range as f32),
            radius: self.radius() as f32,
        };
        Ok(Node {
            transform: Transform::Trs {
                translation: position,
                rotation: DQuat::from_rotation_arc(-DVec3::Z, toward),
                scale: DVec3::ONE,
            },
            light: Some(lamp),
            ..Node::new(self.name.clone().unwrap_or_default())
        })
    }

    /// Writes the lamp as a table.
    pub(super) fn write(&self) -> Value {
        Value::Object(super::write_table(self))
    }
}

#[cfg(test)]
mod tests {
    //! Each key of a lamp changes its node.

    use super::*;
    use serde_json::json;

    fn node(table: Value) -> Node {
        let Value::Object(table) = table else { panic!("{table} is no table") };
        LampDescription::read(&table, 3).unwrap().node().unwrap()
    }

    fn light(table: Value) -> PunctualLight {
        node(table).light.unwrap()
    }

    #[test]
    fn a_lamp_with_a_position_alone_is_a_white_point_of_strength_1() {
        let lamp = node(json!({ "position": [1, 2, 3] }));
        let expected = PunctualLight {
            kind: PunctualLightKind::Point,
            color: Vec3::splat(PI as f32),
            range: f32::INFINITY,
            radius: 0.0,
        };
        assert_eq!((lamp.name.as_str(), lamp.light), ("lamp 3", Some(expected)));
        assert_eq!(lamp.transform.matrix().translation, DVec3::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn color_strength_range_and_radius_are_those_of_the_light() {
        let lamp = light(json!({
            "position": [0, 0, 1], "color": "#00ff00", "strength": 2, "range": 7.5, "radius": 0.25,
        }));
        assert_eq!(lamp.color, Vec3::new(0.0, 2.0 * PI as f32, 0.0));
        assert_eq!((lamp.range, lamp.radius), (7.5, 0.25));
    }

    #[test]
    fn the_angle_of_a_spot_is_that_of_its_whole_cone_over_a_fraction_of_which_it_fades() {
        let cone_deg = |angle: f64, blend: f64| {
            let spot = json!({
                "kind": "spot", "position": [0, 0, 1], "angle": angle, "blend": blend,
            });
            match light(spot).kind {
                PunctualLightKind::Spot { inner_rad, outer_rad } => {
                    [inner_rad, outer_rad].map(|rad| rad.to_degrees().round())
                }
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(cone_deg(90.0, 0.0), [45.0, 45.0]);
        assert_eq!(cone_deg(120.0, 0.5), [30.0, 60.0]);
        assert_eq!(cone_deg(60.0, 1.0), [0.0, 30.0]);
    }

    #[test]
    fn spots_and_directional_lamps_shine_at_their_target() {
        let ahead = |table: Value| node(table).transform.matrix().transform_vector3(-DVec3::Z);
        let spot = json!({ "kind": "spot", "position": [1, 2, 3], "target": [1, 7, 3] });
        assert!(ahead(spot).distance(DVec3::Y) < 1e-12);
        let origin = json!({ "kind": "spot", "position": [0, 0, 5] });
        assert!(ahead(origin).distance(-DVec3::Z) < 1e-12);
        let sideways = json!({ "kind": "directional", "position": [9, 0, 4], "target": [2, 0, 4] });
        assert!(ahead(sideways.clone()).distance(-DVec3::X) < 1e-12);
        assert_eq!(light(sideways).kind, PunctualLightKind::Directional);
        // Without a position light comes from above, wherever the target is.
        let from_above = json!({ "kind": "directional", "target": [5, 5, 5] });
        assert!(ahead(from_above).distance(-DVec3::Z) < 1e-12);
    }
}

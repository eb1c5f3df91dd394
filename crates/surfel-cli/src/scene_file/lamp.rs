//! Lamps of a scene file.

use super::fields::Fields;
use crate::args::parse;
use std::f64::consts::PI;
use surfel::math::{DQuat, DVec3, Vec3};
use surfel::scene::{Lamp, LampKind, Node, Transform};

/// A node at `position` that shines toward `target`.
pub fn read(mut fields: Fields) -> Result<Node, String> {
    let name = fields.text("name")?.unwrap_or_else(|| fields.name().to_owned());
    let kind = fields.text("kind")?.unwrap_or_else(|| "point".into());
    let position = fields.vector("position")?;
    let target = fields.vector("target")?.unwrap_or(DVec3::ZERO);
    let color = match fields.text("color")? {
        Some(text) => {
            parse::color(&text).map_err(|error| format!("{}: color: {error}", fields.name()))?
        }
        None => Vec3::ONE,
    };
    let not_negative = |number: f64| 0.0 <= number;
    let strength = fields.number("strength", "a number from 0", not_negative)?.unwrap_or(1.0);
    let radius = fields.number("radius", "a number from 0", not_negative)?.unwrap_or(0.0);
    let range = fields.number("range", "a number above 0", |number| 0.0 < number)?;
    let is_angle = |number: f64| 0.0 < number && number <= 180.0;
    let angle = fields.number("angle", "degrees above 0, 180 at most", is_angle)?.unwrap_or(45.0);
    let is_share = |number: f64| (0.0..=1.0).contains(&number);
    let blend = fields.number("blend", "a number from 0 to 1", is_share)?.unwrap_or(0.15);
    fields.finish()?;
    let outer_rad = (angle.to_radians() / 2.0) as f32;
    let kind = match kind.as_str() {
        "point" => LampKind::Point,
        "spot" => LampKind::Spot { inner_rad: outer_rad * (1.0 - blend as f32), outer_rad },
        "directional" => LampKind::Directional,
        other => {
            let name = fields.name();
            return Err(format!(
                "{name}: kind: found `{other}`, expected point, spot or directional"
            ));
        }
    };
    let position = match (position, kind) {
        (Some(position), _) => position,
        // Parallel light comes from a direction, which a place says too: from above.
        (None, LampKind::Directional) => target + DVec3::Z,
        (None, _) => return Err(format!("{}: position is missing", fields.name())),
    };
    let toward = (target - position).try_normalize().unwrap_or(-DVec3::Z);
    // Strength 1 at distance 1 gives a white matte surface the radiance 1, as a sun of strength 1 does.
    let lamp = Lamp {
        kind,
        color: (strength * PI) as f32 * color,
        range: range.map_or(f32::INFINITY, |range| range as f32),
        radius: radius as f32,
    };
    Ok(Node {
        transform: Transform::Parts {
            translation: position,
            rotation: DQuat::from_rotation_arc(-DVec3::Z, toward),
            scale: DVec3::ONE,
        },
        lamp: Some(lamp),
        ..Node::new(name)
    })
}

//! Mirrors and gloss: Fresnel's shares, and the GGX distribution of Walter et al. (2007).

use crate::math::{Vec3, scrambled_pair};
use std::f32::consts::{PI, TAU};
use std::sync::OnceLock;

/// Below this roughness a surface is a perfect mirror.
pub const LEAST_ROUGHNESS: f32 = 0.02;

/// Share of unpolarised light that a boundary reflects, exactly (Fresnel 1823). `cos` is that of the angle
/// to the normal, `eta` the index of refraction where the light comes from over that beyond.
pub fn fresnel(cos: f32, eta: f32) -> f32 {
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    // No boundary at all: exactly nothing, so that matte surfaces are just that.
    if eta == 1.0 {
        return 0.0;
    }
    if squared <= 0.0 {
        return 1.0;
    }
    let beyond = squared.sqrt();
    let across = (eta * cos - beyond) / (eta * cos + beyond);
    let along = (cos - eta * beyond) / (cos + eta * beyond);
    0.5 * (across * across + along * along)
}

/// Share of light that a pane reflects: both its sides, and all that goes to and fro between them. `eta` is
/// the index of refraction around it over its own.
pub fn pane_fresnel(cos: f32, eta: f32) -> f32 {
    let at_side = fresnel(cos, eta);
    2.0 * at_side / (1.0 + at_side)
}

/// That of a metal whose colour is `facing` (Schlick 1994).
pub fn metal_fresnel(cos: f32, facing: Vec3) -> Vec3 {
    facing + (1.0 - facing) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Where light from `direction` goes at a mirror with this normal, all unit.
pub fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize()
}

/// Where light goes on at a boundary (Snell's law); none if it is reflected totally. `normal` faces where
/// the light comes from.
pub fn refract(direction: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cos = -direction.dot(normal);
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    let along = || (eta * direction + (eta * cos - squared.sqrt()) * normal).normalize();
    (0.0 < squared).then(along)
}

/// Width of the distribution for a roughness as authors have it (Burley 2012).
fn width(roughness: f32) -> f32 {
    (roughness * roughness).max(1e-4)
}

/// A normal of the distribution as seen from `view`, both in the frame of the mean normal +Z (spherical caps,
/// Dupuy and Benyoub 2023).
pub fn visible_normal(view: Vec3, roughness: f32, (u, v): (f32, f32)) -> Vec3 {
    let alpha = width(roughness);
    let stretched = Vec3::new(alpha * view.x, alpha * view.y, view.z).normalize();
    let angle = TAU * u;
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let sin = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let cap = Vec3::new(sin * angle.cos(), sin * angle.sin(), z) + stretched;
    Vec3::new(alpha * cap.x, alpha * cap.y, cap.z.max(0.0)).normalize_or(Vec3::Z)
}

/// What Smith's masking leaves of the light that goes to or comes from a direction `cos` off the normal.
fn unmasked(cos: f32, alpha: f32) -> f32 {
    let cos = cos.abs().max(1e-4);
    let tan_squared = (1.0 - cos * cos) / (cos * cos);
    2.0 / (1.0 + (1.0 + alpha * alpha * tan_squared).sqrt())
}

/// What both ways leave, over what the way to the viewer leaves (height-correlated, Heitz 2014).
pub fn masking_of_light(cos_view: f32, cos_light: f32, roughness: f32) -> f32 {
    let alpha = width(roughness);
    let lambda = |cos| 1.0 / unmasked(cos, alpha) - 1.0;
    (1.0 + lambda(cos_view)) / (1.0 + lambda(cos_view) + lambda(cos_light))
}

/// Share of light that a rough mirror which absorbs nothing sends on with one bounce, by `cos` of the view
/// and roughness. To divide by it makes up for all further bounces (Turquin 2019).
pub fn energy(cos: f32, roughness: f32) -> f32 {
    const STEPS: usize = 32;
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let value = |i: usize| {
            let cos = (i % STEPS) as f32 / (STEPS - 1) as f32;
            single_bounce(cos.max(1e-3), (i / STEPS) as f32 / (STEPS - 1) as f32)
        };
        (0..STEPS * STEPS).map(value).collect()
    });
    let place = |value: f32| {
        let place = value.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let first = (place as usize).min(STEPS - 2);
        (first, place - first as f32)
    };
    let ((x, across), (y, along)) = (place(cos), place(roughness));
    let row = |y: usize| {
        let first = STEPS * y + x;
        table[first] + across * (table[first + 1] - table[first])
    };
    row(y) + along * (row(y + 1) - row(y))
}

fn single_bounce(cos: f32, roughness: f32) -> f32 {
    const SAMPLES: u32 = 1024;
    let view = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let sent = |i| {
        let normal = visible_normal(view, roughness, scrambled_pair(i, 0));
        let light = reflect(-view, normal);
        if light.z <= 0.0 { 0.0 } else { masking_of_light(cos, light.z, roughness) }
    };
    (0..SAMPLES).map(|i| f64::from(sent(i))).sum::<f64>() as f32 / SAMPLES as f32
}

/// Radiance toward the viewer for a unit irradiance from a direction, times the share that is reflected at
/// all; cosines are with the mean normal, `cos_half` that of the normal half way.
pub fn gloss(cos_view: f32, cos_light: f32, cos_half: f32, roughness: f32) -> f32 {
    let alpha = width(roughness);
    let squared = cos_half * cos_half * (alpha * alpha - 1.0) + 1.0;
    let density = alpha * alpha / (PI * squared * squared);
    let masking = masking_of_light(cos_view, cos_light, roughness) * unmasked(cos_view, alpha);
    density * masking / (4.0 * cos_view * cos_light) / energy(cos_view, roughness)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Random, cosine_hemisphere};

    #[test]
    fn glass_reflects_4_percent_head_on_and_all_beyond_the_critical_angle() {
        assert!((fresnel(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        assert!((fresnel(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert_eq!(fresnel(0.6, 1.5), 1.0);
        assert_eq!(fresnel(0.3, 1.0), 0.0);
        assert!((fresnel(1e-4, 1.0 / 1.5) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn light_bends_by_snells_law_and_back() {
        let direction = Vec3::new(0.6, 0.0, -0.8);
        let inside = refract(direction, Vec3::Z, 1.0 / 1.5).unwrap();
        assert!((inside.x - 0.4).abs() < 1e-6, "{inside}");
        let outside = refract(inside, Vec3::Z, 1.5).unwrap();
        assert!(outside.distance(direction) < 1e-6);
        assert_eq!(refract(direction, Vec3::Z, 2.0), None);
    }

    #[test]
    fn a_rough_mirror_that_absorbs_nothing_sends_all_light_on() {
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            for cos in [0.15, 0.5, 0.9] {
                let view = Vec3::new((1.0f32 - cos * cos).sqrt(), 0.0, cos);
                let n = 1 << 17;
                let sum: f64 = (0..n)
                    .map(|i| {
                        let light = cosine_hemisphere(scrambled_pair(i, 3));
                        let half = (view + light).normalize();
                        // Light of cosine density: pi times the gloss is the share that it stands for.
                        f64::from(PI * gloss(cos, light.z.max(1e-4), half.z, roughness))
                    })
                    .sum();
                let albedo = sum / f64::from(n);
                // Narrow lobes are found by few of these directions.
                let allowed = if roughness < 0.2 { 0.12 } else { 0.02 };
                assert!((albedo - 1.0).abs() < allowed, "{roughness} {cos}: {albedo}");
            }
        }
    }

    #[test]
    fn visible_normals_face_the_viewer() {
        let mut random = Random::new(4, 0);
        for _ in 0..1000 {
            let view =
                Vec3::new(random.next_f32() - 0.5, random.next_f32() - 0.5, random.next_f32());
            let view = view.normalize();
            let normal =
                visible_normal(view, random.next_f32(), (random.next_f32(), random.next_f32()));
            assert!((normal.length() - 1.0).abs() < 1e-5);
            assert!(-1e-4 < normal.dot(view) && 0.0 <= normal.z, "{view} {normal}");
        }
    }
}

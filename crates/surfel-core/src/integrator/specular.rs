//! Specular reflection: Fresnel terms and the GGX microfacet distribution of Walter et al. (2007).

use crate::math::{Vec3, owen_sobol_2d};
use std::f32::consts::{PI, TAU};
use std::sync::OnceLock;

/// Number of steps of cosine and of roughness between which directional albedos are interpolated.
pub const ALBEDO_STEPS: usize = 32;
/// Roughness below which a surface is a perfect mirror.
pub const MIN_ROUGHNESS: f32 = 0.02;
/// Minimum GGX width parameter alpha.
pub const MIN_GGX_ALPHA: f32 = 1e-4;
/// Minimum cosine to the normal of a view or a light on a rough surface.
pub const MIN_GGX_COS: f32 = 1e-3;
/// Minimum cosine to the normal in the masking function.
pub const MIN_MASKING_COS: f32 = 1e-4;

/// Returns the fraction of unpolarised light that a dielectric interface reflects (Fresnel 1823, exact).
///
/// `cos` is the cosine of the angle of incidence, `eta` the index of refraction on the incident side over
/// that on the far side.
pub fn fresnel(cos: f32, eta: f32) -> f32 {
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    // Equal indices must reflect exactly nothing, so that matte surfaces stay matte.
    if eta == 1.0 {
        return 0.0;
    }
    if squared <= 0.0 {
        return 1.0;
    }
    let cos_far = squared.sqrt();
    let perpendicular = (eta * cos - cos_far) / (eta * cos + cos_far);
    let parallel = (cos - eta * cos_far) / (cos + eta * cos_far);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

/// Returns the fraction of light that a thin slab reflects, all interreflections between its two sides
/// included.
///
/// `eta` is the index of refraction around the slab over that of the slab.
pub fn thin_slab_fresnel(cos: f32, eta: f32) -> f32 {
    let at_side = fresnel(cos, eta);
    2.0 * at_side / (1.0 + at_side)
}

/// Returns the fraction of light that a metal reflects, with its colour `f0` at normal incidence
/// (Schlick 1994).
pub fn schlick_fresnel(cos: f32, f0: Vec3) -> Vec3 {
    f0 + (1.0 - f0) * (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Returns the mirror reflection of `direction` at a surface with this normal, all unit.
pub fn reflect(direction: Vec3, normal: Vec3) -> Vec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize()
}

/// Returns the refracted direction at a dielectric interface (Snell's law), or `None` at total internal
/// reflection.
///
/// `normal` is on the side that `direction` comes from; `eta` is as in [`fresnel`].
pub fn refract(direction: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cos = -direction.dot(normal);
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    let refracted = || (eta * direction + (eta * cos - squared.sqrt()) * normal).normalize();
    (0.0 < squared).then(refracted)
}

/// Returns the GGX width parameter alpha of a perceptual roughness (Burley 2012).
fn ggx_alpha(roughness: f32) -> f32 {
    (roughness * roughness).max(MIN_GGX_ALPHA)
}

/// Samples the distribution of GGX normals visible from `view` (spherical caps, Dupuy and Benyoub 2023).
///
/// `view` and the result are unit vectors in the frame whose +Z is the shading normal; `(u, v)` is uniform
/// in the unit square.
pub fn sample_ggx_vndf(view: Vec3, roughness: f32, (u, v): (f32, f32)) -> Vec3 {
    let alpha = ggx_alpha(roughness);
    let stretched = Vec3::new(alpha * view.x, alpha * view.y, view.z).normalize();
    let angle = TAU * u;
    let z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
    let sin = (1.0 - z * z).clamp(0.0, 1.0).sqrt();
    let cap = Vec3::new(sin * angle.cos(), sin * angle.sin(), z) + stretched;
    Vec3::new(alpha * cap.x, alpha * cap.y, cap.z.max(0.0)).normalize_or(Vec3::Z)
}

/// Returns Smith's masking function G1 of GGX for a direction whose angle to the normal has cosine `cos`.
fn smith_g1(cos: f32, alpha: f32) -> f32 {
    let cos = cos.abs().max(MIN_MASKING_COS);
    let tan_squared = (1.0 - cos * cos) / (cos * cos);
    2.0 / (1.0 + (1.0 + alpha * alpha * tan_squared).sqrt())
}

/// Returns G2 / G1: the height-correlated masking and shadowing of view and light over the masking of the
/// view (Heitz 2014).
pub fn smith_g2_over_g1(cos_view: f32, cos_light: f32, roughness: f32) -> f32 {
    let alpha = ggx_alpha(roughness);
    let lambda = |cos| 1.0 / smith_g1(cos, alpha) - 1.0;
    (1.0 + lambda(cos_view)) / (1.0 + lambda(cos_view) + lambda(cos_light))
}

/// Returns the single-bounce directional albedo of a rough mirror that absorbs nothing, for a view whose
/// angle to the normal has cosine `cos`.
///
/// Division by it compensates for the energy of all further bounces (Turquin 2019).
pub fn directional_albedo(cos: f32, roughness: f32) -> f32 {
    static TABLE: OnceLock<Vec<f32>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let value = |i: usize| {
            let cos = (i % ALBEDO_STEPS) as f32 / (ALBEDO_STEPS - 1) as f32;
            integrate_albedo(
                cos.max(MIN_GGX_COS),
                (i / ALBEDO_STEPS) as f32 / (ALBEDO_STEPS - 1) as f32,
            )
        };
        (0..ALBEDO_STEPS * ALBEDO_STEPS).map(value).collect()
    });
    let cell = |value: f32| {
        let position = value.clamp(0.0, 1.0) * (ALBEDO_STEPS - 1) as f32;
        let index = (position as usize).min(ALBEDO_STEPS - 2);
        (index, position - index as f32)
    };
    let ((x, weight_x), (y, weight_y)) = (cell(cos), cell(roughness));
    let row = |y: usize| {
        let first = ALBEDO_STEPS * y + x;
        table[first] + weight_x * (table[first + 1] - table[first])
    };
    row(y) + weight_y * (row(y + 1) - row(y))
}

/// Returns the directional albedo by quasi-Monte Carlo integration.
fn integrate_albedo(cos: f32, roughness: f32) -> f32 {
    const SAMPLES: u32 = 1024;
    let view = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let weight = |i| {
        let normal = sample_ggx_vndf(view, roughness, owen_sobol_2d(i, 0));
        let light = reflect(-view, normal);
        if light.z <= 0.0 { 0.0 } else { smith_g2_over_g1(cos, light.z, roughness) }
    };
    (0..SAMPLES).map(|i| f64::from(weight(i))).sum::<f64>() as f32 / SAMPLES as f32
}

/// Returns the GGX BRDF without its Fresnel term, with energy compensation.
///
/// The arguments are the cosines of the angles that view, light and half vector make with the shading
/// normal, and the roughness.
pub fn ggx_specular(cos_view: f32, cos_light: f32, cos_half: f32, roughness: f32) -> f32 {
    let alpha = ggx_alpha(roughness);
    // `1 + cos² (α² - 1)`, without a difference of almost equal numbers.
    let cos_squared = (cos_half * cos_half).min(1.0);
    let squared = (1.0 - cos_squared) + cos_squared * alpha * alpha;
    let density = alpha * alpha / (PI * squared * squared);
    let masking = smith_g2_over_g1(cos_view, cos_light, roughness) * smith_g1(cos_view, alpha);
    density * masking / (4.0 * cos_view * cos_light) / directional_albedo(cos_view, roughness)
}

#[cfg(test)]
mod tests {
    //! Fresnel terms have known values, refraction is reversible, and GGX conserves energy.

    use super::*;
    use crate::math::{Random, cosine_hemisphere};

    #[test]
    fn highlights_of_smooth_surfaces_are_finite() {
        for roughness in [0.02, 0.022, 0.03, 0.05] {
            let alpha = ggx_alpha(roughness);
            // Seen and lit head on nothing is masked.
            let expected = 1.0 / (4.0 * PI * alpha * alpha) / directional_albedo(1.0, roughness);
            for cos_half in [1.0, 1.0 + f32::EPSILON] {
                let found = ggx_specular(1.0, 1.0, cos_half, roughness);
                assert!((found / expected - 1.0).abs() < 1e-3, "{roughness}: {found}, {expected}");
            }
        }
    }

    #[test]
    fn glass_reflects_4_percent_head_on_and_all_beyond_the_critical_angle() {
        assert!((fresnel(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-6);
        assert!((fresnel(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert_eq!(fresnel(0.6, 1.5), 1.0);
        assert_eq!(fresnel(0.3, 1.0), 0.0);
        assert!((fresnel(1e-4, 1.0 / 1.5) - 1.0).abs() < 1e-2);
    }

    #[test]
    fn refraction_obeys_snells_law_and_is_reversible() {
        let direction = Vec3::new(0.6, 0.0, -0.8);
        let inside = refract(direction, Vec3::Z, 1.0 / 1.5).unwrap();
        assert!((inside.x - 0.4).abs() < 1e-6, "{inside}");
        let outside = refract(inside, Vec3::Z, 1.5).unwrap();
        assert!(outside.distance(direction) < 1e-6);
        assert_eq!(refract(direction, Vec3::Z, 2.0), None);
    }

    #[test]
    fn a_rough_mirror_without_absorption_reflects_all_light() {
        for roughness in [0.1, 0.3, 0.6, 1.0] {
            for cos in [0.15, 0.5, 0.9] {
                let view = Vec3::new((1.0f32 - cos * cos).sqrt(), 0.0, cos);
                let n = 1 << 17;
                let sum: f64 = (0..n)
                    .map(|i| {
                        let light = cosine_hemisphere(owen_sobol_2d(i, 3));
                        let half = (view + light).normalize();
                        // Cosine-distributed directions: pi times the BRDF is the sample's weight.
                        f64::from(PI * ggx_specular(cos, light.z.max(1e-4), half.z, roughness))
                    })
                    .sum();
                let albedo = sum / f64::from(n);
                // Few cosine-distributed directions hit a narrow lobe.
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
                sample_ggx_vndf(view, random.next_f32(), (random.next_f32(), random.next_f32()));
            assert!((normal.length() - 1.0).abs() < 1e-5);
            assert!(-1e-4 < normal.dot(view) && 0.0 <= normal.z, "{view} {normal}");
        }
    }
}

// Specular reflection: Fresnel terms and the GGX microfacet distribution of Walter et al. (2007).

struct Refraction {
    is_total: bool,
    direction: vec3<f32>,
}

// Returns the fraction of unpolarised light that a dielectric interface reflects. `eta` is the index of refraction on
// the incident side over that on the far side.
fn fresnel(cos: f32, eta: f32) -> f32 {
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    // Equal indices must reflect exactly nothing, so that matte surfaces stay matte.
    if eta == 1.0 {
        return 0.0;
    }
    if squared <= 0.0 {
        return 1.0;
    }
    let cos_far = sqrt(squared);
    let perpendicular = (eta * cos - cos_far) / (eta * cos + cos_far);
    let parallel = (cos - eta * cos_far) / (cos + eta * cos_far);
    return 0.5 * (perpendicular * perpendicular + parallel * parallel);
}

fn thin_slab_fresnel(cos: f32, eta: f32) -> f32 {
    let at_side = fresnel(cos, eta);
    return 2.0 * at_side / (1.0 + at_side);
}

// Returns the fraction of light that a metal reflects, with its colour `f0` at normal incidence (Schlick 1994).
fn schlick_fresnel(cos: f32, f0: vec3<f32>) -> vec3<f32> {
    let rest = clamp(1.0 - cos, 0.0, 1.0);
    let squared = rest * rest;
    return f0 + (1.0 - f0) * (squared * squared * rest);
}

fn reflection(direction: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    return normalize(direction - 2.0 * dot(direction, normal) * normal);
}

// Returns the refracted direction at a dielectric interface (Snell's law).
fn refraction(direction: vec3<f32>, normal: vec3<f32>, eta: f32) -> Refraction {
    let cos = -dot(direction, normal);
    let squared = 1.0 - eta * eta * (1.0 - cos * cos);
    if squared <= 0.0 {
        return Refraction(true, direction);
    }
    return Refraction(false, normalize(eta * direction + (eta * cos - sqrt(squared)) * normal));
}

fn ggx_alpha(roughness: f32) -> f32 {
    return max(roughness * roughness, MIN_GGX_ALPHA);
}

// Samples the distribution of GGX normals visible from `view` (spherical caps, Dupuy and Benyoub 2023), in the frame
// whose +Z is the shading normal.
fn sample_ggx_vndf(view: vec3<f32>, roughness: f32, uv: vec2<f32>) -> vec3<f32> {
    let alpha = ggx_alpha(roughness);
    let stretched = normalize(vec3<f32>(alpha * view.x, alpha * view.y, view.z));
    let turned = cos_sin(TAU * uv.x);
    let z = (1.0 - uv.y) * (1.0 + stretched.z) - stretched.z;
    let sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    let cap = vec3<f32>(sine * turned, z) + stretched;
    let normal = vec3<f32>(alpha * cap.x, alpha * cap.y, max(cap.z, 0.0));
    let squared = dot(normal, normal);
    return select(vec3<f32>(0.0, 0.0, 1.0), normal * inverseSqrt(max(squared, 1e-37)), 1e-37 < squared);
}

// Returns Smith's masking function G1 of GGX for a direction whose angle to the normal has cosine `cos`.
fn smith_g1(cosine: f32, alpha: f32) -> f32 {
    let cos = max(abs(cosine), MIN_MASKING_COS);
    let tan_squared = (1.0 - cos * cos) / (cos * cos);
    return 2.0 / (1.0 + sqrt(1.0 + alpha * alpha * tan_squared));
}

// Returns G2 / G1: the height-correlated masking and shadowing of view and light over the masking of the view.
fn smith_g2_over_g1(cos_view: f32, cos_light: f32, roughness: f32) -> f32 {
    let alpha = ggx_alpha(roughness);
    let lambda_view = 1.0 / smith_g1(cos_view, alpha) - 1.0;
    let lambda_light = 1.0 / smith_g1(cos_light, alpha) - 1.0;
    return (1.0 + lambda_view) / (1.0 + lambda_view + lambda_light);
}

// Returns the single-bounce directional albedo of a rough mirror that absorbs nothing, from the table of Rust.
fn directional_albedo(cosine: f32, roughness: f32) -> f32 {
    let steps = f32(ALBEDO_STEPS - 1u);
    let position = clamp(vec2<f32>(cosine, roughness), vec2<f32>(0.0), vec2<f32>(1.0)) * steps;
    let cell = min(vec2<u32>(position), vec2<u32>(ALBEDO_STEPS - 2u));
    let weight = position - vec2<f32>(cell);
    let first = ALBEDO_STEPS * cell.y + cell.x;
    let near = albedo_value(first) + weight.x * (albedo_value(first + 1u) - albedo_value(first));
    let second = first + ALBEDO_STEPS;
    let far = albedo_value(second) + weight.x * (albedo_value(second + 1u) - albedo_value(second));
    return near + weight.y * (far - near);
}

fn albedo_value(idx: u32) -> f32 {
    return tables.albedo[idx >> 2u][idx & 3u];
}

// Returns the GGX BRDF without its Fresnel term, with energy compensation.
fn ggx_specular(cos_view: f32, cos_light: f32, cos_half: f32, roughness: f32) -> f32 {
    let alpha = ggx_alpha(roughness);
    // As on the CPU, without a difference of almost equal numbers.
    let cos_squared = min(cos_half * cos_half, 1.0);
    let squared = (1.0 - cos_squared) + cos_squared * alpha * alpha;
    let density = alpha * alpha / (PI * squared * squared);
    let masking = smith_g2_over_g1(cos_view, cos_light, roughness) * smith_g1(cos_view, alpha);
    return density * masking / (4.0 * cos_view * cos_light) / directional_albedo(cos_view, roughness);
}

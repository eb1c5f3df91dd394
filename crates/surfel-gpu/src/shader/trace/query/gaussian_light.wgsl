// The light of Gaussians along a ray: the nearest are composited front to back, then the next, until hardly any light
// would pass.

// The light that Gaussians add along a ray, and what they let pass.
struct GaussianLight {
    // Colour in the sRGB encoding in which Gaussians are trained and composited, premultiplied by alpha.
    encoded: vec3<f32>,
    // Fraction of the light from behind that passes.
    transmittance: f32,
    // The first Gaussian; its `slot` is NONE if there is none.
    first: GaussianHit,
    // The Gaussian at which half of the light or less passes for the first time; its `slot` is NONE if there is none.
    median: GaussianHit,
}

// The harmonics of a ray in the coordinates of the cloud of a visit.
var<private> harmonics: array<f32, 16>;
var<private> harmonics_visit: u32;

// Computes the light of the Gaussians of some visits along a ray, up to its `t_max`.
fn gaussian_light(ray: Ray, first_visit: u32, n_visits: u32) -> GaussianLight {
    let none = GaussianHit(NO_LIMIT, 0u, NONE, 0.0);
    var light = GaussianLight(vec3<f32>(0.0), 1.0, none, none);
    composited = GaussianHit(-1.0, 0u, 0u, 0.0);
    harmonics_visit = NONE;
    loop {
        n_buffered = 0u;
        for (var i = 0u; i < n_visits; i++) {
            visit_idx = first_visit + i;
            if may_hit_instance(ray, min(ray.t_max, buffer_bound())) {
                search_gaussians(ray);
            }
        }
        for (var i = 0u; i < n_buffered; i++) {
            add_layer(&light, buffered[i], ray);
            if light.transmittance < MIN_GAUSSIAN_TRANSMITTANCE {
                // The layers that are there stand for all: no light passes, and the colour stays.
                light.encoded /= 1.0 - light.transmittance;
                light.transmittance = 0.0;
                return light;
            }
        }
        if n_buffered < BUFFER_SIZE {
            return light;
        }
        composited = buffered[BUFFER_SIZE - 1u];
    }
    return light;
}

// Adds a layer behind those that are there.
fn add_layer(light: ptr<function, GaussianLight>, hit: GaussianHit, ray: Ray) {
    visit_idx = hit.visit;
    if harmonics_visit != hit.visit {
        harmonics = spherical_harmonics(object_ray(ray, object_scale(ray)).direction);
        harmonics_visit = hit.visit;
    }
    let alpha = gaussian_alpha(slot_max_squared(hit.slot), hit.squared);
    if (*light).first.slot == NONE {
        (*light).first = hit;
    }
    (*light).encoded += (*light).transmittance * alpha * color_along(hit.slot);
    (*light).transmittance *= 1.0 - alpha;
    if (*light).median.slot == NONE && (*light).transmittance <= 0.5 {
        (*light).median = hit;
    }
}

// Returns the sRGB-encoded colour of a Gaussian in the direction of the harmonics.
fn color_along(slot: u32) -> vec3<f32> {
    let n = visits[visit_idx].n_harmonics;
    var color = vec3<f32>(0.5);
    for (var i = 0u; i < n; i++) {
        color += harmonics[i]
            * vec3<f32>(coefficient(slot, i), coefficient(slot, n + i), coefficient(slot, 2u * n + i));
    }
    return max(color, vec3<f32>(0.0));
}

// Returns the colour without the part of the light that passes, linear.
fn gaussian_color(light: GaussianLight) -> vec3<f32> {
    let alpha = 1.0 - light.transmittance;
    if alpha <= 0.0 {
        return vec3<f32>(0.0);
    }
    let encoded = light.encoded / alpha;
    let high = pow((encoded + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, encoded / 12.92, encoded <= vec3<f32>(0.04045));
}

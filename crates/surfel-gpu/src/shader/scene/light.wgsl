// Lights.

// Returns the linear radiance of a sky from a unit direction.
fn sky_radiance(sky: LightRecord, direction: vec3<f32>) -> vec3<f32> {
    let height = clamp(0.5 + dot(direction, sky.direction), 0.0, 1.0);
    return mix(sky.ground, sky.color, height * height * (3.0 - 2.0 * height));
}

// Returns the factor by which a lamp is attenuated in a unit direction from it: the window and the cone of
// KHR_lights_punctual.
fn lamp_falloff(lamp: LightRecord, direction: vec3<f32>, distance: f32) -> f32 {
    let relative = distance / lamp.range;
    let squared = relative * relative;
    let window = clamp(1.0 - squared * squared, 0.0, 1.0);
    var spot = 1.0;
    if lamp.kind == SPOT {
        let cos = dot(direction, lamp.direction);
        spot = clamp((cos - lamp.outer_cos) / max(lamp.inner_cos - lamp.outer_cos, 1e-4), 0.0, 1.0);
    }
    return window * spot * spot / max(distance * distance, 1e-12);
}

// Lights.

// Returns the linear radiance of a sky from a unit direction.
fn sky_radiance(sky: LightSample, direction: vec3<f32>) -> vec3<f32> {
    let height = clamp(0.5 + dot(direction, sky.direction), 0.0, 1.0);
    return mix(sky.ground, sky.color, height * height * (3.0 - 2.0 * height));
}

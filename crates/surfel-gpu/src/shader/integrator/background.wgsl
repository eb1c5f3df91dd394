// Radiance along rays that leave the scene.

// Returns the radiance that a ray which leaves the scene in `direction` brings: the environment's, or without one the
// background as the picture shows it, or the sky's where it is transparent. `with_sun` adds the sun's disc.
fn background_radiance(direction: vec3<f32>, with_sun: bool) -> vec3<f32> {
    var sky = vec3<f32>(0.0);
    var environment = vec3<f32>(0.0);
    var suns = vec3<f32>(0.0);
    var has_environment = false;
    for (var i = 0u; i < frame.n_lights; i++) {
        let kind = lights[i].kind;
        if kind == SKY {
            sky += sky_radiance(lights[i], direction);
        } else if kind == ENVIRONMENT {
            has_environment = true;
            environment += environment_radiance(lights[i], direction);
        } else if with_sun && lights[i].lamp == NONE && (kind == SUN || kind == POINT_SUN) {
            suns += disc_radiance(lights[i], direction);
        }
    }
    if has_environment {
        return environment + sky + suns;
    }
    if frame.background == GRADIENT {
        // The gradient spans 60 degrees; its end colours continue above and below.
        let along = clamp(0.5 - dot(direction, frame.background_up), 0.0, 1.0);
        return mix(frame.background_top, frame.background_bottom, along) + suns;
    }
    return sky + suns;
}

fn disc_radiance(sun: LightRecord, direction: vec3<f32>) -> vec3<f32> {
    if dot(direction, sun.direction) < sun.cos_max || 1.0 <= sun.cos_max {
        return vec3<f32>(0.0);
    }
    // Unit strength means an irradiance of pi at normal incidence.
    return sun.color * min(0.5 / (1.0 - sun.cos_max), MAX_SUN_RADIANCE);
}

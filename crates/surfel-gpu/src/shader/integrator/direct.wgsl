// Direct lighting: a ray toward a light from each point, and the light that it brings.

// A sampled ray toward a light, without its origin; it contributes nothing where the light does not reach.
struct LightRay {
    direction: vec3<f32>,
    t_max: f32,
    contribution: vec3<f32>,
}

// Makes a ray toward the light from each point that the light can reach, or adds a light without shadows.
@compute @workgroup_size(WORKGROUP_SIZE)
fn sample_light(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    var path: Path;
    let is_added = id.x < atomicLoad(&counts[FIRST_TAKEN + POINTS]) && make_light_ray(points[id.x], &path);
    let slot = queue_slot(LIGHT_RAYS, local_idx, is_added);
    if slot < frame.capacity {
        paths[slot] = path;
    }
}

// Returns true if there is a ray from a point toward the light.
fn make_light_ray(point: ShadingPointRecord, path: ptr<function, Path>) -> bool {
    let light = lights[task.light];
    if light.kind == HEADLIGHT {
        add_radiance(point.pixel, reflected_radiance(point, point.to_viewer, light.color));
        return false;
    }
    let n_samples = min(point.n_light_samples, task.max_samples);
    if n_samples <= task.sample_idx {
        return false;
    }
    let sampled = sampled_ray(point, light, point.index * n_samples + task.sample_idx);
    let cosine = dot(point.geometric_normal, sampled.direction);
    if cosine <= 0.0 || all(sampled.contribution == vec3<f32>(0.0)) {
        return false;
    }
    let origin = point.position + point.spawn_offset * point.geometric_normal;
    let along = max(1.0 - point.light_steepness * cosine, 0.0);
    let ray = Ray(origin, along * point.spawn_t_min, sampled.direction, sampled.t_max);
    // As in `from_surface`.
    let cos = max(cosine, MIN_OFFSET_COS);
    let height = abs(dot(ray.origin - point.position, point.geometric_normal));
    let weight = sampled.contribution / f32(n_samples);
    *path = Path(ray, weight, point.pixel, vec3<f32>(1.0), height / cos, point.media, point.key, point.index, 1u);
    return true;
}

// Adds the light of the rays that nothing blocks.
@compute @workgroup_size(WORKGROUP_SIZE)
fn add_light(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < atomicLoad(&counts[FIRST_TAKEN + LIGHT_RAYS]) && paths[id.x].state == 1u {
        add_radiance(paths[id.x].pixel, paths[id.x].weight * paths[id.x].transmittance);
    }
}

fn sampled_ray(point: ShadingPointRecord, light: LightRecord, sample_idx: u32) -> LightRay {
    let key = point.key;
    if light.kind == SKY {
        let uv = owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SKY_DIRECTION, 0u)));
        let direction = basis_to_world(basis_around(point.normal), cosine_hemisphere(uv));
        // A uniform end of the ray makes occlusion fall off linearly with an occluder's distance.
        let end = 1.0 - owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SKY_DISTANCE, 0u))).x;
        let t_max = select(light.ao_distance * end, NO_LIMIT, NO_LIMIT <= light.ao_distance);
        return LightRay(direction, t_max, sky_radiance(light, direction) * point.diffuse);
    }
    if light.kind == ENVIRONMENT {
        return environment_ray(point, light, sample_idx);
    }
    if light.kind == POINT || light.kind == SPOT {
        return lamp_ray(point, light, sample_idx);
    }
    var direction = light.direction;
    if light.kind == SUN {
        let uv = owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SUN_DIRECTION, 0u)));
        direction = basis_to_world(basis_around(light.direction), uniform_cone(uv, light.cos_max));
    }
    return LightRay(direction, NO_LIMIT, reflected_radiance(point, direction, light.color));
}

// Samples an environment by multiple importance sampling: half of the directions follow its luminance, half the cosine,
// weighted by the balance heuristic (Veach and Guibas 1995).
fn environment_ray(point: ShadingPointRecord, light: LightRecord, sample_idx: u32) -> LightRay {
    let uv = owen_sobol_2d(sample_idx, hash(point.key ^ vec2<u32>(ENVIRONMENT_DIRECTION, 0u)));
    var direction = point.normal;
    if uv.x < 0.5 {
        direction = sample_environment(light, vec2<f32>(2.0 * uv.x, uv.y));
    } else {
        let local = cosine_hemisphere(vec2<f32>(2.0 * uv.x - 1.0, uv.y));
        direction = basis_to_world(basis_around(point.normal), local);
    }
    let cos = dot(point.normal, direction);
    if cos <= 0.0 {
        return LightRay(direction, NO_LIMIT, vec3<f32>(0.0));
    }
    let density = 0.5 * environment_density(light, direction) + 0.5 * cos / PI;
    let contribution = environment_radiance(light, direction) * (cos / PI / density) * point.diffuse;
    return LightRay(direction, NO_LIMIT, contribution);
}

// As `lamp_ray` of the CPU.
fn lamp_ray(point: ShadingPointRecord, light: LightRecord, sample_idx: u32) -> LightRay {
    var offset = light.position - point.position;
    var distance = length(offset);
    var direction = offset / max(distance, 1e-30);
    var t_max = distance;
    var factor = 1.0;
    if 0.0 < light.radius {
        let dimension = hash(vec2<u32>(PUNCTUAL_LIGHT_POSITION ^ (light.lamp << 8u), light.lamp >> 24u));
        let uv = owen_sobol_2d(sample_idx, hash(point.key ^ dimension));
        let basis = basis_around(select(vec3<f32>(0.0, 0.0, 1.0), direction, 0.0 < distance));
        if distance <= light.radius {
            // Within the ball, light comes from the disc through its centre.
            let on_disk = disk(uv);
            offset += light.radius * (on_disk.x * basis.tangent + on_disk.y * basis.bitangent);
            distance = length(offset);
            direction = offset / max(distance, 1e-30);
            t_max = 0.5 * distance;
        } else {
            let sine = light.radius / distance;
            let cos_max = sqrt(1.0 - sine * sine);
            let local = uniform_cone(uv, cos_max);
            direction = basis_to_world(basis, local);
            // Over the cone, the cosine at the surface has the mean (1 + cos_max) / 2.
            factor = 2.0 / (1.0 + cos_max);
            let aside = distance * length(local.xy);
            t_max = distance * local.z - sqrt(max(light.radius * light.radius - aside * aside, 0.0));
        }
    }
    let strength = factor * lamp_falloff(light, -direction, distance);
    return LightRay(direction, t_max, reflected_radiance(point, direction, strength * light.color));
}

// Returns the radiance reflected toward the viewer for a light of this strength, zero if it is behind the surface.
fn reflected_radiance(point: ShadingPointRecord, direction: vec3<f32>, strength: vec3<f32>) -> vec3<f32> {
    let cos = dot(point.normal, direction);
    if cos <= 0.0 {
        return vec3<f32>(0.0);
    }
    var reflectance = point.diffuse;
    if any(point.glossy != vec3<f32>(0.0)) {
        let middle = direction + point.to_viewer;
        let squared = dot(middle, middle);
        let half_vector = select(point.normal, middle / sqrt(max(squared, 1e-30)), 1e-30 < squared);
        let cos_view = max(dot(point.normal, point.to_viewer), MIN_GGX_COS);
        // Unit strength means an irradiance of pi at normal incidence.
        reflectance +=
            PI * ggx_specular(cos_view, cos, dot(point.normal, half_vector), point.roughness) * point.glossy;
    }
    return cos * reflectance * strength;
}

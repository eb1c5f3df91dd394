// Direct lighting: a ray toward a light from each hit, and the light that it brings.

@group(0) @binding(1) var<uniform> light: LightSample;

// Makes a ray toward the light from each hit that the light can reach, or adds a light without shadows.
@compute @workgroup_size(WORKGROUP_SIZE)
fn sample_light(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx {
        return;
    }
    shadow_rays[ray_idx].is_open = 0u;
    let hit = hits[ray_idx];
    if hit.instance == NONE {
        return;
    }
    let shading = shading_at(rays[ray_idx], hit);
    if shading.is_unlit {
        return;
    }
    if light.kind == HEADLIGHT {
        let cos = dot(shading.normal, -rays[ray_idx].direction);
        pixels[ray_idx].radiance += max(cos, 0.0) * shading.base_color * light.color;
        return;
    }
    let sampled = sampled_ray(shading, pixel_key(ray_idx));
    let is_behind = dot(shading.geometric_normal, sampled.ray.direction) <= 0.0;
    if is_behind || all(sampled.contribution == vec3<f32>(0.0)) {
        return;
    }
    atomicAdd(&n_traced[select(SHADOW_RAYS, SKY_RAYS, light.kind == SKY)], 1u);
    shadow_rays[ray_idx] = sampled;
}

// Adds the light of a sky where camera rays see it.
@compute @workgroup_size(WORKGROUP_SIZE)
fn shade_miss(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < frame.n_rays && hits[id.x].instance == NONE {
        pixels[id.x].alpha = 1.0;
        pixels[id.x].radiance += sky_radiance(light, rays[id.x].direction);
    }
}

// Adds the light of the rays that nothing blocks.
@compute @workgroup_size(WORKGROUP_SIZE)
fn add_light(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < frame.n_rays && shadow_rays[id.x].is_open == 1u {
        pixels[id.x].radiance += shadow_rays[id.x].contribution;
    }
}

fn sampled_ray(shading: Shading, key: vec2<u32>) -> ShadowRay {
    let sample_idx = frame.sample_idx * light.n_samples + light.sample_idx;
    let weight = 1.0 / f32(light.n_samples);
    if light.kind == SKY {
        let uv = owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SKY_DIRECTION, 0u)));
        let direction = basis_to_world(basis_around(shading.normal), cosine_hemisphere(uv));
        // A uniform end of the ray makes occlusion fall off linearly with an occluder's distance.
        let end = 1.0 - owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SKY_DISTANCE, 0u))).x;
        var ray = spawn(shading, direction);
        ray.t_max = min(light.ao_distance * end, NO_LIMIT);
        return ShadowRay(ray, weight * sky_radiance(light, direction) * shading.base_color, 1u);
    }
    if light.kind == POINT || light.kind == SPOT {
        return lamp_ray(shading, key, sample_idx);
    }
    var direction = light.direction;
    if light.kind == SUN {
        let uv = owen_sobol_2d(sample_idx, hash(key ^ vec2<u32>(SUN_DIRECTION, 0u)));
        direction = basis_to_world(basis_around(light.direction), uniform_cone(uv, light.cos_max));
    }
    let cos = max(dot(shading.normal, direction), 0.0);
    return ShadowRay(spawn(shading, direction), weight * cos * shading.base_color * light.color, 1u);
}

// Returns a ray toward a position on a lamp; it contributes nothing where the lamp does not reach.
fn lamp_ray(shading: Shading, key: vec2<u32>, sample_idx: u32) -> ShadowRay {
    var lamp = light.position;
    if 0.0 < light.radius {
        // The visible half of the ball appears as a disc that faces the shading point.
        let dimension = hash(vec2<u32>(PUNCTUAL_LIGHT_POSITION ^ (light.light << 8u), light.light >> 24u));
        let on_disk = disk(owen_sobol_2d(sample_idx, hash(key ^ dimension)));
        let toward = shading.position - lamp;
        let squared = dot(toward, toward);
        let axis = select(vec3<f32>(0.0, 0.0, 1.0), toward / sqrt(max(squared, 1e-30)), 1e-30 < squared);
        let basis = basis_around(axis);
        lamp += light.radius * (on_disk.x * basis.tangent + on_disk.y * basis.bitangent);
    }
    let offset = lamp - shading.position;
    let distance = length(offset);
    let direction = offset / max(distance, 1e-30);
    let strength = lamp_falloff(light, -direction, distance) / f32(light.n_samples);
    let cos = max(dot(shading.normal, direction), 0.0);
    var ray = spawn(shading, direction);
    ray.t_max = distance - min(light.radius, 0.5 * distance);
    return ShadowRay(ray, strength * cos * shading.base_color * light.color, 1u);
}

// The first and the last pass of a sample: camera rays, and the sum over samples.

@compute @workgroup_size(WORKGROUP_SIZE)
fn generate(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx {
        return;
    }
    var offset = vec2<f32>(0.5);
    if frame.is_centered == 0u {
        offset = owen_sobol_2d(frame.sample_idx, pixel_key(ray_idx));
    }
    let none = vec3<f32>(0.0);
    rays[ray_idx] = camera_ray(vec2<f32>(pixel_of(ray_idx)) + offset);
    hits[ray_idx] = HitRecord(none, NO_LIMIT, none, 0.0, none, 0.0, NONE, NONE, 0u, 0u, 0u, 0.0, 0u, 0u);
    var sum = pixels[ray_idx].sum;
    if frame.is_first == 1u {
        sum = vec4<f32>(0.0);
    }
    pixels[ray_idx] = Pixel(none, 0.0, sum);
    atomicAdd(&n_traced[PRIMARY_RAYS], 1u);
}

@compute @workgroup_size(WORKGROUP_SIZE)
fn accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < frame.n_rays {
        let pixel = pixels[id.x];
        pixels[id.x].sum = pixel.sum + vec4<f32>(pixel.radiance, pixel.alpha);
    }
}

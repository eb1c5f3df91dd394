// The first pass of a sample: camera rays.

@compute @workgroup_size(WORKGROUP_SIZE)
fn generate(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx {
        return;
    }
    if ray_idx == 0u {
        atomicStore(&counts[FIRST_ADDED + PATHS], frame.n_rays);
    }
    if frame.is_first == 1u {
        for (var i = 0u; i < 8u; i++) {
            atomicStore(&pixels[ray_idx][i], 0u);
        }
    }
    let key = pixel_key(ray_idx);
    var offset = vec2<f32>(0.5);
    if frame.is_centered == 0u {
        offset = owen_sobol_2d(frame.sample_idx, key);
    }
    let ray = camera_ray(vec2<f32>(pixel_of(ray_idx)) + offset);
    let one = vec3<f32>(1.0);
    let state = MISS_BACKGROUND << PATH_MISS;
    paths[ray_idx] = Path(ray, one, ray_idx, one, 0.0, vec4<u32>(NONE), key, frame.sample_idx, state);
}

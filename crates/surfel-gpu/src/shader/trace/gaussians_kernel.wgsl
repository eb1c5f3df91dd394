// The pass that computes the light of all Gaussians along the rays of paths, up to their hits.

@compute @workgroup_size(WORKGROUP_SIZE)
fn gaussians(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= ray_idx {
        return;
    }
    var ray = paths[ray_idx].ray;
    ray.t_max = min(ray.t_max, hits[ray_idx].distance);
    let light = gaussian_light(ray, task.first_visit, task.n_visits);
    if light.first.slot == NONE {
        return;
    }
    hits[ray_idx].gaussian_radiance = (1.0 - light.transmittance) * gaussian_color(light);
    hits[ray_idx].gaussian_transmittance = light.transmittance;
    hits[ray_idx].gaussian_distance =
        select(light.median.distance, light.first.distance, light.median.slot == NONE);
}

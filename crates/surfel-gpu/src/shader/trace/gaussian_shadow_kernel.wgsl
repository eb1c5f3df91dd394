// The pass that attenuates the rays toward a light by the Gaussians on the way.

@compute @workgroup_size(WORKGROUP_SIZE)
fn gaussian_shadow(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= ray_idx || paths[ray_idx].state == 0u {
        return;
    }
    let light = gaussian_light(paths[ray_idx].ray, task.first_visit, task.n_visits);
    if light.transmittance < MIN_TRANSMITTANCE {
        paths[ray_idx].state = 0u;
        return;
    }
    paths[ray_idx].transmittance *= light.transmittance;
}

// The pass that finds out which rays toward lights one instance blocks.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx || shadow_rays[ray_idx].is_open == 0u {
        return;
    }
    let world_ray = shadow_rays[ray_idx].ray;
    let ray = object_ray(world_ray, object_scale(world_ray));
    if is_occluded(ray) {
        shadow_rays[ray_idx].is_open = 0u;
    }
}

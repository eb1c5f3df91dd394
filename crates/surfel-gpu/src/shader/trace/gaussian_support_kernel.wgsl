// The pass that finds how near the rays pass the Gaussians that they hit.

@compute @workgroup_size(WORKGROUP_SIZE)
fn support(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= ray_idx {
        return;
    }
    let hit = hits[ray_idx];
    if !find_visit(hit.instance, hit.surface) {
        return;
    }
    let world_ray = paths[ray_idx].ray;
    let ray = object_ray(world_ray, object_scale(world_ray));
    let four = load_gaussians(hit.slot >> 3u, (hit.slot >> 2u) & 1u, ray.origin);
    hits[ray_idx].support_count = 1u;
    hits[ray_idx].support_distance = sqrt(intersect_gaussians(four, ray.direction).squares[hit.slot & 3u]);
}

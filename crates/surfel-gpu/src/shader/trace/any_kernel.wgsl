// The pass that finds out which rays toward lights the instances of one tree block.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any_hit(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + LIGHT_RAYS]) <= ray_idx || paths[ray_idx].state == 0u {
        return;
    }
    let world_ray = paths[ray_idx].ray;
    for (var i = 0u; i < task.n_visits; i++) {
        visit_idx = task.first_visit + i;
        if !may_hit_instance(world_ray, world_ray.t_max) {
            continue;
        }
        if is_occluded(object_ray(world_ray, object_scale(world_ray))) {
            paths[ray_idx].state = 0u;
            return;
        }
    }
}

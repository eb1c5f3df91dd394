// The pass that finds out which rays toward lights the instances of one tree block.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any_hit(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    var ray_idx = 0u;
    var is_open = id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]);
    if is_open {
        ray_idx = ray_of_entry(id.x);
        is_open = paths[ray_idx].state != 0u;
    }
    for (var i = 0u; i < task.n_visits; i++) {
        visit_idx = task.first_visit + i;
        var ray: Ray;
        var may_hit = false;
        if is_open {
            let world_ray = paths[ray_idx].ray;
            may_hit = may_hit_instance(world_ray, world_ray.t_max);
            if may_hit {
                ray = object_ray(world_ray, object_scale(world_ray));
            }
        }
        if is_blocked_in_group(ray, may_hit, local_idx) {
            paths[ray_idx].state = 0u;
            is_open = false;
        }
    }
}

// The pass that merges the hits of rays on the instances of one tree into their nearest hits.

@compute @workgroup_size(WORKGROUP_SIZE)
fn closest(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    let is_open = id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]);
    var ray_idx = 0u;
    if is_open {
        ray_idx = ray_of_entry(id.x);
    }
    for (var i = 0u; i < task.n_visits; i++) {
        visit_idx = task.first_visit + i;
        var ray: Ray;
        var may_hit = false;
        if is_open {
            ray = visiting_ray(ray_idx);
            may_hit = ray.t_min <= ray.t_max;
        }
        let found = surface_hit_in_group(ray, may_hit, local_idx);
        if may_hit && found.is_hit {
            keep_nearer(ray_idx, found);
        }
    }
}

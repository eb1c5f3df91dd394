// The pass that tests whether rays toward lights are blocked near the discs that were found. Those that are not are
// undecided, as there may be other discs.

@compute @workgroup_size(WORKGROUP_SIZE)
fn test_any(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    visit_idx = task.first_visit;
    var is_undecided = false;
    if id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]) && search_states[id.x].slot != NONE {
        let world_ray = paths[id.x].ray;
        let ray = object_ray(world_ray, object_scale(world_ray));
        let is_blocked = accepts_hit(ray, search_states[id.x].distance, search_states[id.x].slot);
        is_undecided = !is_blocked;
        if is_blocked {
            paths[id.x].state = 0u;
        }
    }
    let slot = queue_slot(UNDECIDED, local_idx, is_undecided);
    if is_undecided {
        search_states[slot].undecided[task.round & 1u] = id.x;
    }
}

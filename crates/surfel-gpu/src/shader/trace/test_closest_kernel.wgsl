// The pass that tests whether rays hit the surface near their discs. The others are undecided: what is behind these discs
// is searched in the next round.

@compute @workgroup_size(WORKGROUP_SIZE)
fn test_closest(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    visit_idx = task.first_visit;
    var ray_idx = 0u;
    var is_undecided = false;
    if id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]) {
        ray_idx = ray_of_entry(id.x);
        is_undecided = !is_decided(ray_idx);
    }
    let slot = queue_slot(UNDECIDED, local_idx, is_undecided);
    if is_undecided {
        search_states[slot].undecided[task.round & 1u] = ray_idx;
    }
}

// Returns true if the search along a ray is finished, with its hit if there is one.
fn is_decided(ray_idx: u32) -> bool {
    let ray = visiting_ray(ray_idx);
    let first = search_states[ray_idx];
    var found = missed_surface();
    if first.slot != NONE {
        found = hit_near_disc(ray, first.distance, first.slot);
        if !found.is_hit {
            return false;
        }
    }
    if first.passed_slot != NONE {
        found = hit_before_slit(found, first.passed_slot, first.passed_distance, ray);
    }
    if found.is_hit {
        keep_nearer(ray_idx, found);
    }
    return true;
}

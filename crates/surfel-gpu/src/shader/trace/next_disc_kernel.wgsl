// The pass that finds the next disc of each ray. Most rays hit the surface near their first disc. A pass of its own tests
// it: kernels that do one thing keep their state in registers, and more of them run at the same time.

@compute @workgroup_size(WORKGROUP_SIZE)
fn next_disc(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= id.x {
        return;
    }
    visit_idx = task.first_visit;
    let ray_idx = ray_of_entry(id.x);
    var ray = visiting_ray(ray_idx);
    if task.round == 0u {
        search_states[ray_idx].passed_slot = NONE;
    } else {
        ray.t_min = pass_disc(ray_idx, ray.direction);
    }
    var nearest = NearestHit(0.0, NONE);
    if ray.t_min <= ray.t_max {
        nearest = closest_hit(ray);
    }
    search_states[ray_idx].slot = nearest.slot;
    search_states[ray_idx].distance = nearest.distance;
}

// Notes that a ray passed the disc of the last round. Returns the distance at which the search goes on.
fn pass_disc(ray_idx: u32, direction: vec3<f32>) -> f32 {
    let passed = NearestHit(search_states[ray_idx].distance, search_states[ray_idx].slot);
    let disc = slot_point(passed.slot, vec3<f32>(0.0));
    if search_states[ray_idx].passed_slot == NONE && counts_as_passed(disc, direction) {
        search_states[ray_idx].passed_slot = passed.slot;
        search_states[ray_idx].passed_distance = passed.distance;
    }
    return behind_disc(passed.distance, disc);
}

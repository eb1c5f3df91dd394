// The pass that finds any disc on each ray toward a light, if there is one. The tree has one instance.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any_disc(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= id.x {
        return;
    }
    visit_idx = task.first_visit;
    let world_ray = paths[id.x].ray;
    var hit = AnyHit(0.0, NONE);
    if paths[id.x].state != 0u {
        hit = any_hit_of(object_ray(world_ray, object_scale(world_ray)));
    }
    search_states[id.x].slot = hit.slot;
    search_states[id.x].distance = hit.distance;
}

// The pass that finds any disc on each ray toward a light, if there is one.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any_disc(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= id.x {
        return;
    }
    visit_idx = task.first_visit;
    let world_ray = paths[id.x].ray;
    var hit = AnyHit(0.0, NONE);
    if paths[id.x].state != 0u && may_hit_instance(world_ray, world_ray.t_max) {
        hit = any_hit_of(object_ray(world_ray, object_scale(world_ray)));
    }
    first_discs[id.x] = vec4<u32>(hit.slot, bitcast<u32>(hit.distance), 0u, 0u);
}

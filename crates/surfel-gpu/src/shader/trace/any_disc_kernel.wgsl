// The pass that finds any disc on each ray toward a light, if there is one; in each round another one.

@compute @workgroup_size(WORKGROUP_SIZE)
fn any_disc(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= id.x {
        return;
    }
    visit_idx = task.first_visit;
    let ray_idx = ray_of_entry(id.x);
    let world_ray = paths[ray_idx].ray;
    var hit = AnyHit(0.0, NONE);
    if paths[ray_idx].state != 0u && may_hit_instance(world_ray, world_ray.t_max) {
        hit = any_hit_of(object_ray(world_ray, object_scale(world_ray)), task.round);
    }
    first_discs[ray_idx].slot = hit.slot;
    first_discs[ray_idx].distance = hit.distance;
}

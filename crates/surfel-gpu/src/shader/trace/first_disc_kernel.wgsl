// The pass that finds the first disc of each ray. Most rays hit the surface near it, which a pass of its own tests: kernels
// that do one thing keep their state in registers, and more of them run at the same time.

@compute @workgroup_size(WORKGROUP_SIZE)
fn first_disc(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= id.x {
        return;
    }
    visit_idx = task.first_visit;
    let ray = visiting_ray(id.x);
    var nearest = NearestHit(0.0, NONE);
    if ray.t_min <= ray.t_max {
        nearest = closest_hit(ray);
    }
    first_discs[id.x] = vec4<u32>(nearest.slot, bitcast<u32>(nearest.distance), 0u, 0u);
}

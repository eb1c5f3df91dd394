// The pass before the trees are traced: no ray has hit anything.

@compute @workgroup_size(WORKGROUP_SIZE)
fn clear_hits(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]) {
        hits[id.x].instance = NONE;
        hits[id.x].distance = NO_LIMIT;
        hits[id.x].gaussian_distance = NO_LIMIT;
    }
}

// The pass that tests whether rays hit the surface near their first discs. The others are undecided: what is behind these
// discs is searched in another pass.

@compute @workgroup_size(WORKGROUP_SIZE)
fn test_closest(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local_idx: u32) {
    visit_idx = task.first_visit;
    var is_undecided = false;
    if id.x < atomicLoad(&counts[FIRST_TAKEN + task.queue]) {
        let disc = first_discs[id.x];
        if disc.x != NONE {
            let found = hit_near_disc(visiting_ray(id.x), bitcast<f32>(disc.y), disc.x);
            is_undecided = !found.is_hit;
            if found.is_hit {
                keep_nearer(id.x, found);
            }
        }
    }
    let slot = queue_slot(UNDECIDED, local_idx, is_undecided);
    if is_undecided {
        first_discs[slot].z = id.x;
    }
}

// The rays of a workgroup that share the tests of their hits. Some rays have hundreds of hits that the tests reject, most
// have few: each round, the rays that are still searching note hits, which all invocations test together.

var<workgroup> group_rays: array<Ray, WORKGROUP_SIZE>;
// The hits of a round: the index of their ray in the workgroup, their distance and slot.
var<workgroup> noted_rays: array<u32, MAX_NOTED>;
var<workgroup> noted_distances: array<f32, MAX_NOTED>;
var<workgroup> noted_slots: array<u32, MAX_NOTED>;
var<workgroup> n_noted: atomic<u32>;
var<workgroup> n_searching: atomic<u32>;
var<workgroup> n_searching_in_round: u32;

// Index of the invocation's own ray.
var<private> own_idx: u32;

fn note_hit(distance: f32, slot: u32) {
    let at = atomicAdd(&n_noted, 1u);
    noted_rays[at] = own_idx;
    noted_distances[at] = distance;
    noted_slots[at] = slot;
}

// Begins a round. Returns the number of rays of the workgroup that are still searching.
fn begin_round(is_searching: bool) -> u32 {
    if own_idx == 0u {
        atomicStore(&n_searching, 0u);
        atomicStore(&n_noted, 0u);
    }
    workgroupBarrier();
    if is_searching {
        atomicAdd(&n_searching, 1u);
    }
    workgroupBarrier();
    if own_idx == 0u {
        n_searching_in_round = atomicLoad(&n_searching);
    }
    return workgroupUniformLoad(&n_searching_in_round);
}

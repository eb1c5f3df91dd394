// Slots in queues: each workgroup adds the number of its entries to the counter of the queue once.

var<workgroup> n_entries: atomic<u32>;
var<workgroup> first_slot: u32;

// Returns the slot of an invocation's entry in a queue, NONE if it adds none. All invocations of a workgroup call this
// together, and once only: `n_entries` is not reset.
fn queue_slot(queue: u32, local_idx: u32, is_added: bool) -> u32 {
    var slot = NONE;
    if is_added {
        slot = atomicAdd(&n_entries, 1u);
    }
    workgroupBarrier();
    if local_idx == 0u {
        first_slot = atomicAdd(&counts[FIRST_ADDED + queue], atomicLoad(&n_entries));
    }
    workgroupBarrier();
    if is_added {
        slot += first_slot;
    }
    return slot;
}

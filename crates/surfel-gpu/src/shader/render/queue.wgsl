// Queues of paths, shading points and rays toward lights.

// Sizes of indirect dispatches, three words for each queue.
@group(2) @binding(0) var<storage, read_write> dispatches: array<u32, 3u * N_QUEUES>;

// Closes a queue: passes over it start as many workgroups as its entries need. What is added next is a new queue.
@compute @workgroup_size(1)
fn take_queue() {
    let n_added = atomicExchange(&counts[FIRST_ADDED + task.queue], 0u);
    atomicMax(&counts[MAX_ADDED], n_added);
    let n = min(n_added, frame.capacity);
    atomicStore(&counts[FIRST_TAKEN + task.queue], n);
    // The counts have 64 bits. No other invocation adds to them.
    let n_before = atomicAdd(&counts[FIRST_TRACED + task.ray_kind], n);
    if n_before + n < n_before {
        atomicAdd(&counts[FIRST_TRACED_UPPER + task.ray_kind], 1u);
    }
    if task.queue == LIGHT_RAYS {
        atomicStore(&counts[N_ACTIVE], n);
    }
    dispatches[3u * task.queue] = (n + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
    dispatches[3u * task.queue + 1u] = 1u;
    dispatches[3u * task.queue + 2u] = 1u;
}

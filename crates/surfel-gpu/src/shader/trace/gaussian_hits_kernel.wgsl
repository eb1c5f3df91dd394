// The pass that merges the places where the Gaussians of clouds let half of the light pass into the nearest hits of rays,
// for queries that want a surface.

@compute @workgroup_size(WORKGROUP_SIZE)
fn closest(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= ray_idx {
        return;
    }
    for (var i = 0u; i < task.n_visits; i++) {
        merge_nearer(ray_idx, task.first_visit + i);
    }
}

// Replaces the hit of a ray by a nearer one on the cloud of a visit.
fn merge_nearer(ray_idx: u32, visit: u32) {
    var ray = paths[ray_idx].ray;
    ray.t_max = min(ray.t_max, hits[ray_idx].distance);
    let light = gaussian_light(ray, visit, 1u);
    let median = light.median;
    if median.slot == NONE || hits[ray_idx].distance <= median.distance {
        return;
    }
    visit_idx = visit;
    let x = slot_row(median.slot, 0u);
    let y = slot_row(median.slot, 1u);
    let z = slot_row(median.slot, 2u);
    let longer = select(x, y, dot(x, x) < dot(y, y));
    let axis = normalize(select(longer, z, dot(longer, longer) < dot(z, z)));
    let direction = object_ray(ray, object_scale(ray)).direction;
    let normal = world_normal(select(-axis, axis, dot(axis, direction) < 0.0));
    hits[ray_idx].normal = normal;
    hits[ray_idx].geometric_normal = normal;
    hits[ray_idx].distance = median.distance;
    hits[ray_idx].color = gaussian_color(light);
    hits[ray_idx].alpha = 1.0;
    hits[ray_idx].slot = median.slot;
    hits[ray_idx].instance = visits[visit].instance;
    hits[ray_idx].is_backface = 0u;
    hits[ray_idx].surface = visits[visit].surface;
}

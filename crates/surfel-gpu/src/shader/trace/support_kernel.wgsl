// The pass that finds the points behind the hits on one tree: how many, and how near the nearest one is.

@compute @workgroup_size(WORKGROUP_SIZE)
fn support(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if atomicLoad(&counts[FIRST_TAKEN + task.queue]) <= ray_idx {
        return;
    }
    let hit = hits[ray_idx];
    if !find_visit(hit.instance, hit.surface) {
        return;
    }
    let world_ray = paths[ray_idx].ray;
    let scale = object_scale(world_ray);
    let ray = object_ray(world_ray, scale);
    let position = ray_at(ray, hit.distance * scale);
    let point = slot_point(hit.slot, position);
    let to_center = point.center;
    let radius = point.radius / visits[visit_idx].radius_factor;
    if SHAPE == SPHERE || SHAPE == CAPSULE || SHAPE == LEAVES {
        let across = to_center - dot(to_center, ray.direction) * ray.direction;
        hits[ray_idx].support_count = 1u;
        hits[ray_idx].support_distance = length(across) / radius;
        return;
    }
    let max_squared = radius * radius;
    var nearest_squared = dot(to_center, to_center);
    var n_near = 0u;
    let reach = FIT_REACH * max(point.radius, radius);
    list_blocks(position - reach, position + reach, 0.0);
    loop {
        for (var i = 0u; i < n_listed; i++) {
            let points = load_points(listed_blocks[i], position);
            for (var lane = 0u; lane < 8u; lane++) {
                let other = point_at(points, lane);
                if 0.0 < other.radius {
                    let squared = dot(other.center, other.center);
                    n_near += select(0u, 1u, squared <= max_squared);
                    nearest_squared = min(nearest_squared, squared);
                }
            }
        }
        if !list_more() {
            break;
        }
    }
    hits[ray_idx].support_count = n_near;
    hits[ray_idx].support_distance = sqrt(nearest_squared) / radius;
}

// The pass that finds the points behind the hits on one tree: how many, and how near the nearest one is.

var<private> support_position: vec3<f32>;
var<private> max_squared: f32;
var<private> nearest_squared: f32;
var<private> n_near: u32;

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
    support_position = ray_at(ray, hit.distance * scale);
    let point = slot_point(hit.slot, support_position);
    let to_center = point.center;
    let radius = point.radius / visits[visit_idx].radius_factor;
    if SHAPE == SPHERE || SHAPE == CAPSULE {
        let across = to_center - dot(to_center, ray.direction) * ray.direction;
        hits[ray_idx].support_count = 1u;
        hits[ray_idx].support_distance = length(across) / radius;
        return;
    }
    max_squared = radius * radius;
    nearest_squared = dot(to_center, to_center);
    n_near = 0u;
    let reach = FIT_REACH * max(point.radius, radius);
    query_box(support_position - reach, support_position + reach, 0.0);
    hits[ray_idx].support_count = n_near;
    hits[ray_idx].support_distance = sqrt(nearest_squared) / radius;
}

fn visit_region_block(block_idx: u32) {
    let head = load_head(block_idx);
    for (var lane = 0u; lane < 8u; lane++) {
        let point = block_point(block_idx, head, lane, support_position);
        if 0.0 < point.radius {
            let squared = dot(point.center, point.center);
            n_near += select(0u, 1u, squared <= max_squared);
            nearest_squared = min(nearest_squared, squared);
        }
    }
}

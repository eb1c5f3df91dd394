// The closest triangle on a ray, and whether any triangle lies on it.

var<private> query_frame: RayFrame;
var<private> nearest_distance: f32;
var<private> nearest_slot: u32;

fn search_limit() -> f32 {
    return nearest_distance;
}

fn visit_block(block_idx: u32) -> bool {
    for (var lane = 0u; lane < 8u; lane++) {
        let slot = 8u * block_idx + lane;
        var corners = slot_corners(slot);
        let origin = query_frame.ray.origin;
        corners = array<vec3<f32>, 3>(corners[0] - origin, corners[1] - origin, corners[2] - origin);
        let distance = intersect_triangle(corners, query_frame);
        let is_tie = distance == nearest_distance && slot < nearest_slot;
        if 0.0 <= distance && (distance < nearest_distance || is_tie) {
            nearest_distance = distance;
            nearest_slot = slot;
            // A search without colours asks for any triangle.
            if !HAS_COLORS {
                return true;
            }
        }
    }
    return false;
}

fn search_triangles(ray: Ray) {
    query_frame = ray_frame(ray);
    nearest_distance = ray.t_max;
    nearest_slot = NONE;
    traverse(ray);
}

fn is_occluded(ray: Ray) -> bool {
    search_triangles(ray);
    return nearest_slot != NONE;
}

fn surface_hit(ray: Ray) -> SurfaceHit {
    search_triangles(ray);
    if nearest_slot == NONE {
        return missed_surface();
    }
    let corners = slot_corners(nearest_slot);
    let origin = ray.origin;
    let relative =
        array<vec3<f32>, 3>(corners[0] - origin, corners[1] - origin, corners[2] - origin);
    let weights = barycentrics(relative, ray.direction);
    let normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    let size = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    let outward = normalize(normal / size);
    let geometric_normal = select(outward, -outward, 0.0 < dot(outward, ray.direction));
    var hit = point_hit(nearest_distance, nearest_slot, 0.0, geometric_normal, vec3<f32>(1.0));
    var offset = CORNER_VECTORS;
    if (visit.attributes & HAS_NORMALS) != 0u {
        let interpolated = interpolate(nearest_slot, offset, weights);
        let squared = dot(interpolated, interpolated);
        if 1e-30 < squared {
            hit.normal = interpolated / sqrt(squared);
        }
        offset += NORMAL_VECTORS;
    }
    if (visit.attributes & HAS_COLORS_OF_VERTICES) != 0u {
        hit.color = interpolate(nearest_slot, offset, weights);
    }
    return hit;
}

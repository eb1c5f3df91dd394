// The closest triangle on a ray, and whether any triangle lies on it.

struct Search {
    frame: RayFrame,
    distance: f32,
    slot: u32,
}

fn search_limit(search: ptr<function, Search>) -> f32 {
    return (*search).distance;
}

fn visit_block(block_idx: u32, search: ptr<function, Search>) -> bool {
    let frame_of_ray = (*search).frame;
    let origin = frame_of_ray.ray.origin;
    for (var lane = 0u; lane < 8u; lane++) {
        let slot = 8u * block_idx + lane;
        var corners = slot_corners(slot);
        corners = array<vec3<f32>, 3>(corners[0] - origin, corners[1] - origin, corners[2] - origin);
        let distance = intersect_triangle(corners, frame_of_ray);
        let is_tie = distance == (*search).distance && slot < (*search).slot;
        if 0.0 <= distance && (distance < (*search).distance || is_tie) {
            (*search).distance = distance;
            (*search).slot = slot;
            // A search without colours asks for any triangle.
            if !HAS_COLORS {
                return true;
            }
        }
    }
    return false;
}

fn search_triangles(ray: Ray) -> Search {
    var search = Search(ray_frame(ray), ray.t_max, NONE);
    traverse(ray, &search);
    return search;
}

fn is_occluded(ray: Ray) -> bool {
    return search_triangles(ray).slot != NONE;
}

fn surface_hit(ray: Ray) -> SurfaceHit {
    let nearest = search_triangles(ray);
    if nearest.slot == NONE {
        return missed_surface();
    }
    let corners = slot_corners(nearest.slot);
    let origin = ray.origin;
    let relative =
        array<vec3<f32>, 3>(corners[0] - origin, corners[1] - origin, corners[2] - origin);
    let weights = barycentrics(relative, ray.direction);
    let normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
    let size = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    let outward = normalize(normal / size);
    let is_backface = 0.0 < dot(outward, ray.direction);
    let geometric_normal = select(outward, -outward, is_backface);
    var hit =
        point_hit(nearest.distance, nearest.slot, 0.0, geometric_normal, vec3<f32>(1.0), is_backface);
    hit.barycentrics = weights.yz;
    interpolate_attributes(&hit, corners, weights);
    return hit;
}

// Sets the attributes that the vertices have.
fn interpolate_attributes(hit: ptr<function, SurfaceHit>, corners: array<vec3<f32>, 3>, weights: vec3<f32>) {
    let slot = (*hit).slot;
    var offset = CORNER_VECTORS;
    if has_column(HAS_NORMALS) {
        let normal = interpolate(slot, offset, 3u, weights).xyz;
        let squared = dot(normal, normal);
        if 1e-30 < squared {
            (*hit).normal = normal / sqrt(squared);
            (*hit).has_normal = true;
        }
        offset += 3u * COMPONENT_VECTORS;
    }
    if has_column(HAS_COLORS_OF_VERTICES) {
        (*hit).color = interpolate(slot, offset, 4u, weights);
        offset += 4u * COMPONENT_VECTORS;
    }
    let is_second = (visits[visit_idx].attributes & TANGENTS_OF_SECOND_UVS) != 0u;
    if has_column(HAS_FIRST_UVS) {
        (*hit).uvs = interpolate(slot, offset, 2u, weights);
        if !is_second {
            (*hit).tangent = tangent_of_uvs(slot, offset, corners);
        }
        offset += 2u * COMPONENT_VECTORS;
    }
    if has_column(HAS_SECOND_UVS) {
        (*hit).uvs = vec4<f32>((*hit).uvs.xy, interpolate(slot, offset, 2u, weights).xy);
        if is_second {
            (*hit).tangent = tangent_of_uvs(slot, offset, corners);
        }
        offset += 2u * COMPONENT_VECTORS;
    }
    if has_column(HAS_TANGENTS) {
        (*hit).tangent = interpolate(slot, offset, 4u, weights);
    }
}

// Returns the triangle's tangent along its texture coordinates, with the sign of the bitangent; zero if there is none.
fn tangent_of_uvs(slot: u32, offset: u32, corners: array<vec3<f32>, 3>) -> vec4<f32> {
    let first = slot_vector(slot, offset, 2u, 0u).xy;
    let to_b = slot_vector(slot, offset, 2u, 1u).xy - first;
    let to_c = slot_vector(slot, offset, 2u, 2u).xy - first;
    let area = to_b.x * to_c.y - to_b.y * to_c.x;
    let along = to_c.y * (corners[1] - corners[0]) - to_b.y * (corners[2] - corners[0]);
    let squared = dot(along, along);
    if area == 0.0 || squared <= 1e-37 {
        return vec4<f32>(0.0);
    }
    let sign_of_area = select(1.0, -1.0, area < 0.0);
    // The second texture coordinate points down, the bitangent of a normal map up.
    return vec4<f32>(sign_of_area * along / sqrt(squared), -sign_of_area);
}

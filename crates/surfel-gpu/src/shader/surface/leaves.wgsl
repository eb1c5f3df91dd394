// Leaves: each point is a cluster of small discs that point in all directions.

// Returns the distances to the nearest leaf at or beyond `t_min` of four clusters, -1 without a hit.
fn intersect_leaves(four: FourPoints, ray: Ray) -> vec4<f32> {
    let reach = four.radius * LEAVES_REACH;
    let along = dot_four(four.x, four.y, four.z, ray.direction);
    let is_near = squared_offsets(four, along, ray.direction) < reach * reach;
    if !any(is_near) {
        return vec4<f32>(-1.0);
    }
    // Centres and directions, mirrored at the planes of the points' normals. Those of unused lanes are zero.
    let squared = four.normal_x * four.normal_x + four.normal_y * four.normal_y + four.normal_z * four.normal_z;
    let factor = 2.0 / max(squared, vec4<f32>(1.0));
    let height = factor * (four.normal_x * four.x + four.normal_y * four.y + four.normal_z * four.z);
    let center_x = four.x - height * four.normal_x;
    let center_y = four.y - height * four.normal_y;
    let center_z = four.z - height * four.normal_z;
    let slope = factor * dot_four(four.normal_x, four.normal_y, four.normal_z, ray.direction);
    let direction_x = ray.direction.x - slope * four.normal_x;
    let direction_y = ray.direction.y - slope * four.normal_y;
    let direction_z = ray.direction.z - slope * four.normal_z;
    let radius = four.radius * LEAF_RADIUS;
    var nearest = vec4<f32>(NO_LIMIT);
    for (var i = 0u; i < N_LEAVES; i++) {
        let offset = LEAF_CENTERS[i];
        let normal = LEAF_NORMALS[i];
        let x = center_x + offset.x * four.radius;
        let y = center_y + offset.y * four.radius;
        let z = center_z + offset.z * four.radius;
        let facing = dot_four(direction_x, direction_y, direction_z, normal);
        let is_parallel = facing == vec4<f32>(0.0);
        let distance = dot_four(x, y, z, normal) / select(facing, vec4<f32>(1.0), is_parallel);
        let across_x = x - distance * direction_x;
        let across_y = y - distance * direction_y;
        let across_z = z - distance * direction_z;
        let is_inside = across_x * across_x + across_y * across_y + across_z * across_z < radius * radius;
        let is_hit = is_inside & (vec4<f32>(ray.t_min) <= distance) & !is_parallel;
        nearest = select(nearest, min(distance, nearest), is_hit);
    }
    return select(vec4<f32>(-1.0), nearest, is_near & (nearest < vec4<f32>(NO_LIMIT)));
}

// Returns the normal of the leaf at `position`, on either side of it.
fn leaf_normal(position: vec3<f32>, surfel: Surfel) -> vec3<f32> {
    let position_in_cluster = mirrored((position - surfel.center) / surfel.radius, surfel.normal);
    var least = NO_LIMIT;
    var nearest = vec3<f32>(0.0, 0.0, 1.0);
    for (var i = 0u; i < N_LEAVES; i++) {
        let normal = normalize(LEAF_NORMALS[i]);
        let from_leaf = position_in_cluster - LEAF_CENTERS[i];
        // A position on a leaf is nearer to its plane than the others that it lies on by chance.
        let distance = abs(dot(normal, from_leaf)) + max(length(from_leaf) - LEAF_RADIUS, 0.0);
        if distance < least {
            least = distance;
            nearest = normal;
        }
    }
    return mirrored(nearest, surfel.normal);
}

// Returns a vector mirrored at the plane of a unit normal.
fn mirrored(vector: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    return vector - 2.0 * dot(normal, vector) * normal;
}

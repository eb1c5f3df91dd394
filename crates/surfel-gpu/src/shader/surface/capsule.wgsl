// Capsules: each point is a short thick line along its direction.

// Returns the distances to the outer sides of four capsules, -1 without a hit.
fn intersect_capsules(four: FourPoints, ray: Ray) -> vec4<f32> {
    var distances = vec4<f32>(-1.0);
    for (var lane = 0u; lane < 4u; lane++) {
        distances[lane] = intersect_capsule(point_of_four(four, lane), ray);
    }
    return distances;
}

// Returns the distance to the outer side of a capsule, or -1 without a hit. The point's radius is half the length, its
// normal the direction.
fn intersect_capsule(point: Point, ray: Ray) -> f32 {
    let axis = normalize(point.normal);
    let thickness = point.radius * (1.0 / CAPSULE_ASPECT);
    let half_length = point.radius - thickness;
    // The distances are measured from the position on the ray that is nearest to the centre, as those of far capsules
    // would cancel.
    let nearest = dot(point.center, ray.direction);
    let from_center = nearest * ray.direction - point.center;
    let slope = dot(ray.direction, axis);
    let height = dot(from_center, axis);
    let across = 1.0 - slope * slope;
    let half_linear = -height * slope;
    let constant = dot(from_center, from_center) - height * height - thickness * thickness;
    let discriminant = half_linear * half_linear - across * constant;
    // A ray along the axis meets the cap that faces it.
    let is_parallel = across < MIN_ACROSS;
    let side = (-half_linear - sqrt(max(discriminant, 0.0))) / max(across, MIN_ACROSS);
    let at = select(height + side * slope, select(NO_LIMIT, -NO_LIMIT, 0.0 < slope), is_parallel);
    let cap_center = from_center - clamp(at, -half_length, half_length) * axis;
    let half_linear_cap = dot(cap_center, ray.direction);
    let of_cap =
        half_linear_cap * half_linear_cap - dot(cap_center, cap_center) + thickness * thickness;
    let cap_distance = -half_linear_cap - sqrt(max(of_cap, 0.0));
    let is_side = abs(at) < half_length;
    let distance = nearest + select(cap_distance, side, is_side);
    let is_hit = select(0.0 <= of_cap, 0.0 <= discriminant, is_side);
    return select(-1.0, distance, is_hit && ray.t_min <= distance);
}

// Returns the outward direction, not of unit length, of a capsule at `position` on its surface.
fn capsule_normal(position: vec3<f32>, surfel: Surfel) -> vec3<f32> {
    let half_length = surfel.radius * (1.0 - 1.0 / CAPSULE_ASPECT);
    let offset = position - surfel.center;
    return offset - clamp(dot(offset, surfel.normal), -half_length, half_length) * surfel.normal;
}

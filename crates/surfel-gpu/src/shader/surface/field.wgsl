// The field of weighted planes: at each position the mean of the signed distances from the planes of the points around,
// whose zeros are the surface (Wald and Seidel 2005).

// A point of the field, seen along a segment of a ray.
struct RayPoint {
    // True if the point has weight on the segment.
    is_near: bool,
    // Square of its distance from the segment's start, and the distance along the ray at which it is nearest.
    squared: f32,
    along: f32,
    // Height of the segment's start above the point's plane, and the slope along the ray.
    height: f32,
    slope: f32,
    inverse_support_squared: f32,
}

fn inverse_support_squared(radius: f32) -> f32 {
    let support = FIELD_SUPPORT * radius;
    return 1.0 / (support * support);
}

// Returns the unit normal of a point, turned around if it is flipped.
fn side_normal(normal: vec3<f32>, is_flipped: bool) -> vec3<f32> {
    let unit = normal / sqrt(max(dot(normal, normal), 1.0));
    return select(unit, -unit, is_flipped);
}

// Returns a point, whose centre is relative to the start of a segment, along the segment.
fn ray_point(point: Point, is_flipped: bool, direction: vec3<f32>, length: f32) -> RayPoint {
    let inverse = inverse_support_squared(point.radius);
    let along = dot(point.center, direction);
    let squared = dot(point.center, point.center);
    let nearest = clamp(along, 0.0, length);
    let least = squared - nearest * (along + along - nearest);
    let normal = side_normal(point.normal, is_flipped);
    let is_near = least * inverse < 1.0;
    return RayPoint(is_near, squared, along, -dot(normal, point.center), dot(normal, direction), inverse);
}

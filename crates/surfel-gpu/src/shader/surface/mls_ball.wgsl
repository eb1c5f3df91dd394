// Balls around the points of moving least squares.

// Returns the distance at which a ray is nearest to a point whose ball it meets, or -1 without a hit.
fn intersect_ball(point: Point, ray: Ray) -> f32 {
    let distance = dot(point.center, ray.direction);
    let offset = point.center - distance * ray.direction;
    let is_hit = dot(offset, offset) < point.radius * point.radius && ray.t_min <= distance;
    return select(-1.0, distance, is_hit);
}

// Discs: each point is the flat disc that its normal and radius describe (Wiesmeier 2011).

// Returns the distance to both sides of a disc, or -1 without a hit. The test compares products, so that a ray in the
// disc's plane divides by nothing that matters.
fn intersect_disc(point: Point, ray: Ray) -> f32 {
    let facing = dot(point.normal, ray.direction);
    if facing == 0.0 {
        return -1.0;
    }
    let distance = dot(point.normal, point.center) / facing;
    let offset = point.center - distance * ray.direction;
    let is_hit = dot(offset, offset) < point.radius * point.radius && ray.t_min <= distance;
    return select(-1.0, distance, is_hit);
}

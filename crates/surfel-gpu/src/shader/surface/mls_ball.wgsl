// Balls around the points of moving least squares.

// Returns the distances at which a ray is nearest to four points whose balls it meets, -1 without a hit.
fn intersect_balls(four: FourPoints, ray: Ray) -> vec4<f32> {
    let distance = dot_four(four.x, four.y, four.z, ray.direction);
    let is_inside = squared_offsets(four, distance, ray.direction) < four.radius * four.radius;
    return select(vec4<f32>(-1.0), distance, is_inside & (vec4<f32>(ray.t_min) <= distance));
}

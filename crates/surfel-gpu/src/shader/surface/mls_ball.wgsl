// Balls around the points of moving least squares.

// Returns the distances at which a ray is nearest to four points whose balls it meets, -1 without a hit.
fn intersect_balls(four: FourPoints, ray: Ray) -> vec4<f32> {
    let direction = ray.direction;
    let distance = dot_four(four.x, four.y, four.z, direction);
    let x = four.x - distance * direction.x;
    let y = four.y - distance * direction.y;
    let z = four.z - distance * direction.z;
    let is_inside = x * x + y * y + z * z < four.radius * four.radius;
    return select(vec4<f32>(-1.0), distance, is_inside & (vec4<f32>(ray.t_min) <= distance));
}

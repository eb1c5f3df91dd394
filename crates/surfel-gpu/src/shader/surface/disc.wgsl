// Discs: each point is the flat disc that its normal and radius describe (Wiesmeier 2011).

// Returns the distances to both sides of four discs, -1 without a hit. A ray in the plane of a disc misses it.
fn intersect_discs(four: FourPoints, ray: Ray) -> vec4<f32> {
    let facing = dot_four(four.normal_x, four.normal_y, four.normal_z, ray.direction);
    let height = four.normal_x * four.x + four.normal_y * four.y + four.normal_z * four.z;
    let is_parallel = facing == vec4<f32>(0.0);
    let distance = height / select(facing, vec4<f32>(1.0), is_parallel);
    let is_inside = squared_offsets(four, distance, ray.direction) < four.radius * four.radius;
    let is_hit = is_inside & (vec4<f32>(ray.t_min) <= distance) & !is_parallel;
    return select(vec4<f32>(-1.0), distance, is_hit);
}

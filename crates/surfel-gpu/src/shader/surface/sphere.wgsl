// Spheres: each point is a ball of its radius (Wiesmeier 2011).

// Returns for each of four spheres the nearest root at or beyond `t_min`, which is the far side if the ray starts inside,
// or -1 without a hit.
fn intersect_spheres(four: FourPoints, ray: Ray) -> vec4<f32> {
    let along = dot_four(four.x, four.y, four.z, ray.direction);
    // The distance of the centre from the line, rather than b^2 - 4ac, which cancels for far spheres (Haines et al.,
    // Precision Improvements for Ray/Sphere Intersection, 2019).
    let squared = four.radius * four.radius - squared_offsets(four, along, ray.direction);
    let half_chord = sqrt(max(squared, vec4<f32>(0.0)));
    let near = along - half_chord;
    let t_min = vec4<f32>(ray.t_min);
    let distance = select(along + half_chord, near, t_min <= near);
    return select(vec4<f32>(-1.0), distance, (vec4<f32>(0.0) < squared) & (t_min <= distance));
}

// Spheres: each point is a ball of its radius (Wiesmeier 2011).

// Returns the nearest root at or beyond `t_min`, which is the far side if the ray starts inside, or -1 without a hit.
fn intersect_sphere(point: Point, ray: Ray) -> f32 {
    let along = dot(point.center, ray.direction);
    // The distance of the centre from the line, rather than b^2 - 4ac, which cancels for far spheres (Haines et al.,
    // Precision Improvements for Ray/Sphere Intersection, 2019).
    let across = point.center - along * ray.direction;
    let squared = point.radius * point.radius - dot(across, across);
    let half_chord = sqrt(max(squared, 0.0));
    let near = along - half_chord;
    let distance = select(along + half_chord, near, ray.t_min <= near);
    return select(-1.0, distance, 0.0 < squared && ray.t_min <= distance);
}

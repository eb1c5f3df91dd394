// The shapes that the points of a tree have.

// Returns the distance to a point as a shape of the kernel's kind, or -1 without a hit.
fn intersect_shape(point: Point, ray: Ray) -> f32 {
    if SHAPE == SPHERE {
        return intersect_sphere(point, ray);
    }
    if SHAPE == CAPSULE {
        return intersect_capsule(point, ray);
    }
    if SHAPE == MLS {
        return intersect_ball(point, ray);
    }
    return intersect_disc(point, ray);
}

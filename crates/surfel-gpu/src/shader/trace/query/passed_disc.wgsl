// Discs of smooth surfaces near which rays hit nothing.

// Returns true if a disc counts as passed: from its front where front sides are known.
fn counts_as_passed(disc: Point, direction: vec3<f32>) -> bool {
    return visits[visit_idx].has_front_sides == 0u || dot(disc.normal, direction) < 0.0;
}

// Returns the distance at which the search goes on behind a disc.
fn behind_disc(distance: f32, disc: Point) -> f32 {
    return max(distance + SMOOTH_RESTART_OFFSET * disc.radius, distance * (1.0 + 2.0 * EPSILON));
}

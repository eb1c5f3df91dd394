// The weight function of points.

// Returns the weight of a point at a squared distance, which falls from 1 to 0 at the support's radius.
fn support_weight(squared_distance: f32, inverse_support_squared: f32) -> f32 {
    let inside = max(1.0 - squared_distance * inverse_support_squared, 0.0);
    let squared = inside * inside;
    return squared * squared;
}

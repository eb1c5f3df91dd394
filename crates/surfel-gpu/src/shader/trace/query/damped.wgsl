// Steps of searches along rays.

// Returns a step along the ray after another one. Where it would turn back, it ends at the root of the line through
// both (the secant method).
fn damped(step: f32, last_step: f32) -> f32 {
    if step * last_step < 0.0 {
        return step * last_step / (last_step - step);
    }
    return step;
}

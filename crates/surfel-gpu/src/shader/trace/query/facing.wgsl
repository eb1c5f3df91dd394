// Sides of normals.

// Returns a normal turned against a direction.
fn facing(normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    return select(normal, -normal, 0.0 < dot(normal, direction));
}

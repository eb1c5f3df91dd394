// Rays with a range of distances.

struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

fn ray_at(ray: Ray, distance: f32) -> vec3<f32> {
    return ray.origin + distance * ray.direction;
}

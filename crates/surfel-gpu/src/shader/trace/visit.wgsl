// The instance that a pass traces, and rays in its coordinates.

@group(0) @binding(1) var<uniform> visit: Visit;

struct SurfaceHit {
    is_hit: bool,
    distance: f32,
    slot: u32,
    radius: f32,
    normal: vec3<f32>,
    geometric_normal: vec3<f32>,
    color: vec3<f32>,
}

fn missed_surface() -> SurfaceHit {
    let none = vec3<f32>(0.0);
    return SurfaceHit(false, NO_LIMIT, NONE, 0.0, none, none, none);
}

// Returns a hit on points, whose shading normal is that of their surface.
fn point_hit(distance: f32, slot: u32, radius: f32, normal: vec3<f32>, color: vec3<f32>) -> SurfaceHit {
    return SurfaceHit(true, distance, slot, radius, normal, normal, color);
}

// Returns the factor by which distances along a ray grow from the world to the object.
fn object_scale(ray: Ray) -> f32 {
    if visit.is_identity == 1u {
        return 1.0;
    }
    return length(visit.object_from_world * vec4<f32>(ray.direction, 0.0));
}

// Returns a ray in the coordinates of the object.
fn object_ray(ray: Ray, scale: f32) -> Ray {
    if visit.is_identity == 1u {
        return ray;
    }
    return Ray(
        visit.object_from_world * vec4<f32>(ray.origin, 1.0),
        ray.t_min * scale,
        (visit.object_from_world * vec4<f32>(ray.direction, 0.0)) / scale,
        scaled_limit(ray.t_max, scale),
    );
}

fn scaled_limit(distance: f32, scale: f32) -> f32 {
    if NO_LIMIT <= distance {
        return NO_LIMIT;
    }
    return min(distance * scale, NO_LIMIT);
}

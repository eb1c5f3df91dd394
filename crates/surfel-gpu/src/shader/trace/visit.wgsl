// The instances of the tree that a pass traces, and rays in their coordinates.

// Index of the instance that is traced.
var<private> visit_idx: u32;

struct SurfaceHit {
    is_hit: bool,
    distance: f32,
    slot: u32,
    radius: f32,
    normal: vec3<f32>,
    geometric_normal: vec3<f32>,
    color: vec4<f32>,
    is_backface: bool,
    barycentrics: vec2<f32>,
    // Both sets of texture coordinates.
    uvs: vec4<f32>,
    // True if the normal is that of vertices.
    has_normal: bool,
    // Tangent of a normal map in object space, and the sign of its bitangent; zero without one.
    tangent: vec4<f32>,
}

fn missed_surface() -> SurfaceHit {
    var missed = point_hit(NO_LIMIT, NONE, 0.0, vec3<f32>(0.0), vec3<f32>(0.0), false);
    missed.is_hit = false;
    return missed;
}

// Returns a hit on points, whose shading normal is that of their surface.
fn point_hit(
    distance: f32,
    slot: u32,
    radius: f32,
    normal: vec3<f32>,
    color: vec3<f32>,
    is_backface: bool,
) -> SurfaceHit {
    let none = vec4<f32>(0.0);
    let opaque = vec4<f32>(color, 1.0);
    return SurfaceHit(true, distance, slot, radius, normal, normal, opaque, is_backface, none.xy, none, false, none);
}

// Returns the index of the ray at an index in the queue of the pass.
fn ray_of_entry(entry: u32) -> u32 {
    if task.queue == UNDECIDED {
        return search_states[entry].undecided[(task.round + 1u) & 1u];
    }
    return entry;
}

// Goes to the visit of a hit. Returns false if the pass has none for it.
fn find_visit(instance: u32, surface: u32) -> bool {
    visit_idx = task.first_visit;
    let end = task.first_visit + task.n_visits;
    while visit_idx < end && visits[visit_idx].instance != instance {
        visit_idx += 1u;
    }
    return visit_idx < end && surface == visits[visit_idx].surface;
}

// Returns the factor by which distances along a ray grow from the world to the object.
fn object_scale(ray: Ray) -> f32 {
    if visits[visit_idx].is_identity == 1u {
        return 1.0;
    }
    return length(visits[visit_idx].object_from_world * vec4<f32>(ray.direction, 0.0));
}

// Returns a ray in the coordinates of the object.
fn object_ray(ray: Ray, scale: f32) -> Ray {
    if visits[visit_idx].is_identity == 1u {
        return ray;
    }
    return Ray(
        visits[visit_idx].object_from_world * vec4<f32>(ray.origin, 1.0),
        ray.t_min * scale,
        (visits[visit_idx].object_from_world * vec4<f32>(ray.direction, 0.0)) / scale,
        scaled_limit(ray.t_max, scale),
    );
}

fn scaled_limit(distance: f32, scale: f32) -> f32 {
    if NO_LIMIT <= distance {
        return NO_LIMIT;
    }
    return min(distance * scale, NO_LIMIT);
}

// Returns a unit normal of the object in world space.
fn world_normal(normal: vec3<f32>) -> vec3<f32> {
    if visits[visit_idx].is_identity == 1u {
        return normal;
    }
    return normalize(visits[visit_idx].world_from_normal * normal);
}

// Returns true if a ray may hit the instance nearer than `t_max`. The box of a tree with one instance is not tested, as
// its root has the same.
fn may_hit_instance(ray: Ray, t_max: f32) -> bool {
    if task.n_visits == 1u {
        return true;
    }
    let lower = visits[visit_idx].lower;
    let upper = visits[visit_idx].upper;
    let is_small = abs(ray.direction) < vec3<f32>(MIN_DIRECTION);
    let inverse = 1.0 / select(ray.direction, vec3<f32>(MIN_DIRECTION), is_small);
    let coordinates = max(max(abs(lower), abs(upper)), abs(ray.origin));
    let slack = ROUNDING * max(max(coordinates.x, coordinates.y), coordinates.z);
    let at_low = (lower - slack - ray.origin) * inverse;
    let at_high = (upper + slack - ray.origin) * inverse;
    let near = min(at_low, at_high);
    let far = max(at_low, at_high);
    let enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    return enter <= min(min(far.x, far.y), min(far.z, t_max));
}

// Shading parameters at a hit: the material with the colours of the points applied.

struct Shading {
    position: vec3<f32>,
    // Shading normal: unit, facing the viewer.
    normal: vec3<f32>,
    // Geometric normal, along which new rays are offset.
    geometric_normal: vec3<f32>,
    base_color: vec3<f32>,
    emission: vec3<f32>,
    is_unlit: bool,
    radius: f32,
    surface: u32,
    // Largest absolute coordinate of the hit and of the ray's origin, which bounds rounding errors.
    coordinate_magnitude: f32,
}

fn shading_at(ray: Ray, hit: HitRecord) -> Shading {
    let material = materials[hit.material];
    let color = select(hit.color, vec3<f32>(1.0), material.ignores_vertex_colors == 1u);
    let base_color = material.base_color * color;
    return Shading(
        ray_at(ray, hit.distance),
        faceforward(hit.normal, hit.geometric_normal, ray.direction),
        hit.geometric_normal,
        base_color,
        material.emissive + material.emissive_strength * base_color,
        material.is_unlit == 1u,
        hit.radius,
        hit.surface,
        max(largest(abs(ray_at(ray, hit.distance))), largest(abs(ray.origin))),
    );
}

fn largest(vector: vec3<f32>) -> f32 {
    return max(max(vector.x, vector.y), vector.z);
}

// Returns a shading normal that faces away from the viewer tilted until it just faces the viewer.
fn faceforward(normal: vec3<f32>, geometric_normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> {
    let away = dot(normal, direction);
    if away <= -MIN_FACING_COS {
        return normal;
    }
    let tilted = normal - (away + MIN_FACING_COS) * direction;
    let squared = dot(tilted, tilted);
    return select(geometric_normal, tilted / sqrt(max(squared, 1e-30)), 1e-30 < squared);
}

// Returns a ray in `direction`, offset to that side so that it does not hit the surface again.
fn spawn(shading: Shading, direction: vec3<f32>) -> Ray {
    let normal = shading.geometric_normal;
    let side = select(-normal, normal, 0.0 <= dot(normal, direction));
    if shading.surface == TRIANGLE {
        // The position is wrong by a few roundings of the coordinates that it was computed from.
        let origin = shading.position + 32.0 * EPSILON * shading.coordinate_magnitude * side;
        return Ray(origin, 0.0, direction, NO_LIMIT);
    }
    let rounding = 4.0 * EPSILON * largest(abs(shading.position));
    var offset = SOLID_SPAWN_OFFSET;
    var t_min = 0.0;
    if shading.surface == SMOOTH {
        offset = SMOOTH_SPAWN_OFFSET;
        t_min = SMOOTH_SPAWN_T_MIN;
    } else if shading.surface != SPHERE && shading.surface != CAPSULE {
        offset = DISC_SPAWN_OFFSET;
        t_min = DISC_SPAWN_T_MIN;
    }
    let origin = shading.position + (offset * shading.radius + rounding) * side;
    return Ray(origin, t_min * shading.radius, direction, NO_LIMIT);
}

// The hits of rays on an instance, merged into their nearest hits.

// Returns a ray in the coordinates of the instance, up to the distance at which its hits count; its range is empty if it
// misses the box of the instance.
fn visiting_ray(ray_idx: u32) -> Ray {
    let world_ray = paths[ray_idx].ray;
    let known_distance = hits[ray_idx].distance;
    var ray = Ray(world_ray.origin, 1.0, world_ray.direction, 0.0);
    if !may_hit_instance(world_ray, min(world_ray.t_max, known_distance)) {
        return ray;
    }
    let scale = object_scale(world_ray);
    ray = object_ray(world_ray, scale);
    // Hits as near as the nearest stay, although their distances were rounded. Discs behind the nearest are blended with
    // it, whatever other instances are between them.
    let limit = scaled_limit(known_distance, scale * (1.0 + 2.0 * EPSILON));
    ray.t_max = min(ray.t_max, min(limit + visits[visit_idx].max_blend_distance, NO_LIMIT));
    return ray;
}

// Replaces the hit of a ray by one on the instance, if that is nearer.
fn keep_nearer(ray_idx: u32, found: SurfaceHit) {
    let scale = object_scale(paths[ray_idx].ray);
    let known_distance = hits[ray_idx].distance;
    let known_instance = hits[ray_idx].instance;
    let distance = found.distance / scale;
    let is_nearer = distance < known_distance || distance == known_distance && visits[visit_idx].instance <= known_instance;
    if !is_nearer {
        return;
    }
    var normal = world_normal(found.normal);
    let geometric_normal = world_normal(found.geometric_normal);
    // Some programs write normals against the winding order.
    let is_flipped = dot(normal, geometric_normal) < 0.0;
    normal = select(normal, -normal, is_flipped);
    let is_backface = found.is_backface && visits[visit_idx].has_outward_normals == 1u;
    hits[ray_idx] = HitRecord(
        normal,
        distance,
        found.color.xyz,
        found.radius * visits[visit_idx].max_scale,
        geometric_normal,
        found.color.w,
        found.slot,
        visits[visit_idx].instance,
        select(0u, 1u, is_backface),
        visits[visit_idx].surface,
        0u,
        0.0,
        found.barycentrics,
        found.uvs,
        world_tangent(found, normal, is_flipped),
        vec3<f32>(0.0),
        1.0,
        NO_LIMIT,
        0u,
        0u,
        0u,
    );
}

// Returns the unit tangent of a normal map perpendicular to the normal, zero without one, and the sign of the bitangent.
fn world_tangent(found: SurfaceHit, normal: vec3<f32>, is_flipped: bool) -> vec4<f32> {
    let world = visits[visit_idx].world_from_object * found.tangent.xyz;
    let tangent = world - dot(world, normal) * normal;
    let squared = dot(tangent, tangent);
    // The bitangent flips where the normal was flipped, as on a back face, and where the transform mirrors.
    let is_turned = select(found.is_backface, is_flipped, found.has_normal);
    let side = select(1.0, -1.0, is_turned != (visits[visit_idx].is_mirrored == 1u));
    if squared <= 1e-30 {
        return vec4<f32>(0.0, 0.0, 0.0, side);
    }
    return vec4<f32>(tangent / sqrt(squared), select(side, -side, found.tangent.w < 0.0));
}

// The pass that merges the hits of rays on one instance into their nearest hits.

@compute @workgroup_size(WORKGROUP_SIZE)
fn closest(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx {
        return;
    }
    let world_ray = rays[ray_idx];
    let known = hits[ray_idx];
    let scale = object_scale(world_ray);
    var ray = object_ray(world_ray, scale);
    // Hits as near as the nearest stay, although their distances were rounded. Discs behind the nearest are blended with
    // it, whatever other instances are between them.
    let limit = scaled_limit(known.distance, scale * (1.0 + 2.0 * EPSILON));
    ray.t_max = min(ray.t_max, min(limit + visit.max_blend_distance, NO_LIMIT));
    if ray.t_max < ray.t_min {
        return;
    }
    let found = surface_hit(ray);
    let distance = found.distance / scale;
    let is_nearer = distance < known.distance || distance == known.distance && visit.instance <= known.instance;
    if !found.is_hit || !is_nearer {
        return;
    }
    let normal = world_normal(found.normal);
    let geometric_normal = world_normal(found.geometric_normal);
    hits[ray_idx] = HitRecord(
        // Some programs write normals against the winding order.
        select(normal, -normal, dot(normal, geometric_normal) < 0.0),
        distance,
        found.color,
        found.radius * visit.max_scale,
        geometric_normal,
        0.0,
        found.slot,
        visit.instance,
        visit.material,
        visit.surface,
        0u,
        0.0,
        0u,
        0u,
    );
}

fn world_normal(normal: vec3<f32>) -> vec3<f32> {
    if visit.is_identity == 1u {
        return normal;
    }
    return normalize(visit.world_from_normal * normal);
}

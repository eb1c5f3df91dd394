// The closest hit of a ray on an octree as a surface, where nothing smaller than a pixel counts.

fn surface_hit(ray: Ray) -> SurfaceHit {
    let nearest = octree_hit(ray, frame.pixel_at_origin / visits[visit_idx].max_scale, frame.pixel_per_distance);
    if nearest.cell_idx == NONE {
        return missed_surface();
    }
    var slot = 0u;
    var normal = vec3<f32>(0.0);
    if SURFACE == OCTREE {
        query_corners = cell_corners(nearest.cell_idx);
        slot = query_corners.slot;
        normal = corner_normal((ray_at(ray, nearest.distance) - nearest.cube.low) / nearest.cube.size);
        let squared = dot(normal, normal);
        normal = select(-ray.direction, normal / sqrt(max(squared, 1e-30)), 1e-30 < squared);
    } else {
        slot = plane_slot(nearest.cell_idx);
        normal = cell_plane(nearest.cell_idx).xyz;
    }
    normal = select(normal, -normal, 0.0 < dot(normal, ray.direction));
    let point = slot_point(slot, ray.origin);
    // New rays keep their distance from cells that are larger than the discs.
    let radius = max(point.radius, nearest.cube.size);
    let is_backface = 0.0 < dot(point.normal, ray.direction);
    return point_hit(nearest.distance, slot, radius, normal, slot_color(slot), is_backface);
}

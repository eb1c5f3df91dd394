// The closest hit of a ray on the field of weighted planes, found in its kd-tree, that the edge test accepts.

fn surface_hit(whole_ray: Ray) -> SurfaceHit {
    var ray = whole_ray;
    for (var n_rejected = 0u; n_rejected < MAX_REJECTED_HITS; n_rejected++) {
        let found = first_field_hit(ray);
        if !found.is_hit {
            break;
        }
        let point = slot_point(found.slot, ray.origin);
        let squared = dot(found.normal, found.normal);
        var normal = normalize(point.normal);
        if 1e-30 < squared {
            normal = found.normal / sqrt(squared);
        }
        normal = facing(normal, ray.direction);
        let position = ray_at(ray, found.distance);
        let candidate = CandidateHit(position, normal, ray.direction, point.radius);
        if visits[visit_idx].has_edge_test == 0u || is_enclosed(candidate, false) {
            let is_backface = 0.0 < dot(point.normal, ray.direction);
            let color = field_color(found);
            return point_hit(found.distance, found.slot, point.radius, normal, color, is_backface);
        }
        let behind = found.distance + RESTART_OFFSET * point.radius;
        ray.t_min = max(behind, found.distance * (1.0 + 2.0 * EPSILON));
    }
    return missed_surface();
}

fn field_color(found: FieldHit) -> vec3<f32> {
    if !HAS_COLORS {
        return vec3<f32>(0.0);
    }
    if 0.0 < found.color.w {
        return found.color.xyz / found.color.w;
    }
    return slot_color(found.slot);
}

// Returns the first zero of the field on a ray, leaf by leaf.
fn first_field_hit(ray: Ray) -> FieldHit {
    start_walk(ray);
    loop {
        let interval = next_leaf();
        if interval.idx == NONE {
            return no_field_hit();
        }
        // Neighbouring leaves find the zeros between them.
        let margin = FIELD_OVERLAP * interval.leave;
        let length = interval.leave - interval.enter + 2.0 * margin;
        let entries = vec2<u32>(leaf_start(interval.idx), leaf_start(interval.idx + 1u));
        let found = first_zero(ray, RaySegment(interval.enter - margin, length, entries.x, entries.y));
        if found.is_hit {
            return found;
        }
    }
    return no_field_hit();
}

// The closest hit of a ray on the surface of moving least squares.

fn surface_hit(whole_ray: Ray) -> SurfaceHit {
    var ray = whole_ray;
    for (var n_tried = 0u; n_tried < MAX_TRIED_BALLS; n_tried++) {
        let nearest = closest_hit(ray);
        if nearest.slot == NONE {
            break;
        }
        let radius = slot_point(nearest.slot, ray.origin).radius;
        let found = find_surface(whole_ray, nearest.distance, radius);
        if found.is_hit {
            return finished_hit(whole_ray, found, radius);
        }
        ray.t_min = max(found.restart, nearest.distance * (1.0 + 2.0 * EPSILON) + 1e-37);
    }
    return missed_surface();
}

// Returns a hit with the colour and the sides of the points around.
fn finished_hit(ray: Ray, found: MlsHit, ball_radius: f32) -> SurfaceHit {
    let radius = ball_radius / visits[visit_idx].radius_factor;
    if !HAS_COLORS || nearest_slot == NONE {
        return point_hit(found.distance, 0u, radius, found.normal, vec3<f32>(0.0), false);
    }
    var color = slot_color(nearest_slot);
    if 0.0 < color_sum.w {
        color = color_sum.xyz / color_sum.w;
    }
    let is_backface = 0.0 < dot(slot_point(nearest_slot, ray.origin).normal, ray.direction);
    return point_hit(found.distance, nearest_slot, radius, found.normal, color, is_backface);
}

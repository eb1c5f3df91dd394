// Cameras: the ray through a position in the picture.

// Returns the ray through a position in pixels from the picture's upper left corner, as far as the planes show it.
fn camera_ray(position: vec2<f32>) -> Ray {
    let across = position.x - frame.center.x;
    let along = frame.center.y - position.y;
    var ray = Ray(frame.position, 0.0, frame.forward, NO_LIMIT);
    if frame.lens == PANORAMA {
        let azimuth = cos_sin(frame.pixel_width * across);
        let elevation = cos_sin(frame.pixel_height * along);
        let level = azimuth.x * frame.forward + azimuth.y * frame.right;
        ray.direction = normalize(elevation.x * level + elevation.y * frame.up);
    } else {
        let offset = frame.pixel_width * across * frame.right + frame.pixel_height * along * frame.up;
        if frame.lens == PERSPECTIVE {
            ray.direction = normalize(frame.forward + offset);
        } else {
            ray.origin += offset;
        }
    }
    for (var i = 0u; i < frame.n_planes; i++) {
        ray = limited(ray, frame.planes[i]);
    }
    return ray;
}

// Returns a ray that ends where a plane begins to hide, and begins where it ends.
fn limited(ray: Ray, plane: vec4<f32>) -> Ray {
    let height = dot(plane.xyz, ray.origin) - plane.w;
    let rise = dot(plane.xyz, ray.direction);
    var part = ray;
    if rise < 0.0 {
        part.t_min = max(ray.t_min, min(-height / rise, NO_LIMIT));
    } else if 0.0 < rise {
        part.t_max = min(ray.t_max, -height / rise);
    } else if 0.0 < height {
        part.t_max = ray.t_min;
    }
    return part;
}

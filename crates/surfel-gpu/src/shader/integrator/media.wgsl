// Participating media: the nested solid dielectrics that a ray is inside of, and their absorption.

// The media on both sides of a hit.
struct Interface {
    near: vec4<u32>,
    far: vec4<u32>,
    // Index of refraction on the near side over that on the far side.
    eta: f32,
    // Transmittance from the ray's origin to the hit.
    transmittance: vec3<f32>,
}

fn contains_medium(media: vec4<u32>, instance: u32) -> bool {
    return any(media == vec4<u32>(instance));
}

fn push_medium(media: vec4<u32>, instance: u32) -> vec4<u32> {
    return vec4<u32>(instance, media.xyz);
}

// Returns the stack with `instance` as the outermost one, or unchanged if it is full.
fn push_outer_medium(media: vec4<u32>, instance: u32) -> vec4<u32> {
    var pushed = media;
    for (var i = 0u; i < 4u; i++) {
        if pushed[i] == NONE {
            pushed[i] = instance;
            return pushed;
        }
    }
    return pushed;
}

// Returns the stack outside of `instance`, wherever it stands in the stack.
fn remove_medium(media: vec4<u32>, instance: u32) -> vec4<u32> {
    var others = vec4<u32>(NONE);
    var n_others = 0u;
    for (var i = 0u; i < 4u; i++) {
        if media[i] != instance {
            others[n_others] = media[i];
            n_others += 1u;
        }
    }
    return others;
}

fn ior_of(media: vec4<u32>) -> f32 {
    if media.x == NONE {
        return 1.0;
    }
    return materials[instances[media.x].material].ior;
}

// Returns the media on both sides of a hit.
fn interface_at(path: Path, shading: Shading, hit: HitRecord) -> Interface {
    let media = path.media;
    if !is_solid_dielectric(shading) {
        // Matte surfaces have an index of 1 and stay matte under water.
        let eta = select(ior_of(media) / shading.ior, 1.0, shading.ior == 1.0);
        return Interface(media, media, eta, medium_transmittance(path, media, hit.distance));
    }
    let was_entered = contains_medium(media, hit.instance);
    let is_outward = instances[hit.instance].has_outward_normals == 1u;
    let is_inside = select(was_entered, hit.is_backface == 1u, is_outward);
    var near = media;
    if is_inside && !was_entered {
        near = push_outer_medium(media, hit.instance);
    } else if !is_inside && was_entered {
        // The ray left the body through a hole.
        near = remove_medium(media, hit.instance);
    }
    var far = push_medium(near, hit.instance);
    if is_inside {
        far = remove_medium(near, hit.instance);
    }
    return Interface(near, far, ior_of(near) / ior_of(far), medium_transmittance(path, near, hit.distance));
}

// Returns the transmittance up to `distance`, where a hit shows that the ray is inside of `near`.
fn medium_transmittance(path: Path, near: vec4<u32>, distance: f32) -> vec3<f32> {
    if path.media.x != NONE {
        return beer_lambert(path.media.x, path.origin_offset + distance);
    }
    if near.x != NONE {
        // The ray started inside of the body, which extends no farther than its box.
        return beer_lambert(near.x, length_in(path, near.x, distance));
    }
    return vec3<f32>(1.0);
}

// Returns the transmittance of a ray that hits nothing. A body that it never leaves extends no farther than its box.
fn transmittance_to_end(path: Path) -> vec3<f32> {
    let medium = path.media.x;
    if medium == NONE {
        return vec3<f32>(1.0);
    }
    if NO_LIMIT <= path.ray.t_max {
        return beer_lambert(medium, length_in(path, medium, NO_LIMIT));
    }
    return beer_lambert(medium, path.origin_offset + path.ray.t_max);
}

// Returns the length of the ray up to `end` within the box of an instance.
fn length_in(path: Path, instance: u32, end: f32) -> f32 {
    var begin = -path.origin_offset;
    var limit = end;
    for (var axis = 0u; axis < 3u; axis++) {
        let direction = path.ray.direction[axis];
        let low = instances[instance].lower[axis] - path.ray.origin[axis];
        let high = instances[instance].upper[axis] - path.ray.origin[axis];
        if direction != 0.0 {
            begin = max(begin, max(min(low / direction, high / direction), -NO_LIMIT));
            limit = min(limit, min(max(low / direction, high / direction), NO_LIMIT));
        } else if 0.0 < low || high < 0.0 {
            return 0.0;
        }
    }
    return max(limit - begin, 0.0);
}

// Returns the transmittance of `length` world units of an instance's medium (Beer-Lambert law).
fn beer_lambert(instance: u32, length: f32) -> vec3<f32> {
    let material = instances[instance].material;
    let distance = materials[material].attenuation_distance;
    if NO_LIMIT <= distance {
        return vec3<f32>(1.0);
    }
    let exponent = length / (distance * instances[instance].max_scale);
    let color = materials[material].attenuation_color;
    let passed = pow(max(color, vec3<f32>(1e-37)), vec3<f32>(exponent));
    // Nothing to the power of nothing is 1, as on the CPU.
    return select(passed, vec3<f32>(0.0), (color <= vec3<f32>(0.0)) & vec3<bool>(0.0 < exponent));
}

fn interface_fresnel(shading: Shading, cos: f32, eta: f32) -> f32 {
    if shading.is_thin {
        return thin_slab_fresnel(cos, eta);
    }
    return fresnel(cos, eta);
}

// Makes a path whose ray left the surface at `shading` into `media`; all else is that of `path`.
fn from_surface(path: Path, shading: Shading, ray: Ray, media: vec4<u32>) -> Path {
    // A ray along the surface would otherwise get an unbounded offset.
    let cos = max(abs(dot(ray.direction, shading.geometric_normal)), MIN_OFFSET_COS);
    let height = abs(dot(ray.origin - shading.position, shading.geometric_normal));
    var next = path;
    next.ray = ray;
    next.media = media;
    next.origin_offset = height / cos;
    return next;
}

// Transmittance along rays toward lights: glass and alpha-blended layers tint them, one surface a pass.

@compute @workgroup_size(WORKGROUP_SIZE)
fn pass_surface(@builtin(global_invocation_id) id: vec3<u32>) {
    if atomicLoad(&counts[FIRST_TAKEN + LIGHT_RAYS]) <= id.x || paths[id.x].pixel == NONE {
        return;
    }
    var path = paths[id.x];
    let hit = hits[id.x];
    if path.state == 0u {
        finish(id.x);
        return;
    }
    if hit.instance == NONE {
        add_radiance(path.pixel, path.weight * path.transmittance * transmittance_to_end(path));
        finish(id.x);
        return;
    }
    let shading = shading_at(path.ray, hit);
    let interface_media = interface_at(path, shading, hit);
    path.transmittance *= interface_media.transmittance
        * surface_transmittance(shading, path.ray.direction, interface_media.eta);
    if largest(path.transmittance) < MIN_TRANSMITTANCE {
        finish(id.x);
        return;
    }
    var ray = spawn(shading, path.ray.direction);
    ray.t_max = NO_LIMIT;
    if path.ray.t_max < NO_LIMIT {
        ray.t_max = max(path.ray.t_max - hit.distance, 0.0);
    }
    paths[id.x] = from_surface(path, shading, ray, interface_media.far);
    hits[id.x].instance = NONE;
    hits[id.x].distance = NO_LIMIT;
}

// Marks a ray whose light has arrived or is lost. No ray hits anything any more.
fn finish(ray_idx: u32) {
    paths[ray_idx].pixel = NONE;
    paths[ray_idx].state = 0u;
    paths[ray_idx].ray.t_max = -1.0;
    atomicSub(&counts[N_ACTIVE], 1u);
}

// Returns the fraction of light that passes a surface. Light is not refracted here, so both sides of a body use the
// angle in the thinner medium.
fn surface_transmittance(shading: Shading, direction: vec3<f32>, eta: f32) -> vec3<f32> {
    let cos = -dot(shading.normal, direction);
    let reflected = interface_fresnel(shading, cos, min(eta, 1.0 / eta));
    let entering = (1.0 - reflected) * (1.0 - shading.metallic);
    let transmitted = entering * shading.transmission * shading.base_color;
    return vec3<f32>(1.0 - shading.alpha) + shading.alpha * transmitted;
}

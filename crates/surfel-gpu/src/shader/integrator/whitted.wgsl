// The light that the surfaces at the ends of camera rays emit.

@compute @workgroup_size(WORKGROUP_SIZE)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray_idx = id.x;
    if frame.n_rays <= ray_idx || hits[ray_idx].instance == NONE {
        return;
    }
    let shading = shading_at(rays[ray_idx], hits[ray_idx]);
    pixels[ray_idx].alpha = 1.0;
    pixels[ray_idx].radiance = select(shading.emission, shading.base_color, shading.is_unlit);
}

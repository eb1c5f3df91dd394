// Random keys of pixels.

fn pixel_of(ray_idx: u32) -> vec2<u32> {
    let pixel = frame.first_pixel + ray_idx;
    return vec2<u32>(pixel % frame.width, pixel / frame.width);
}

fn pixel_key(ray_idx: u32) -> vec2<u32> {
    return hash(frame.seed ^ hash(pixel_of(ray_idx)));
}

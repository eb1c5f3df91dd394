// Positions of pixels, and their random keys.

// Returns the position of a ray's pixel in the picture: pixels are numbered in bands of rows, column by column.
fn pixel_of(ray_idx: u32) -> vec2<u32> {
    let pixel = frame.first_pixel + ray_idx;
    let band = pixel / (BAND_HEIGHT * frame.n_columns);
    let row = BAND_HEIGHT * band;
    let in_band = pixel - row * frame.n_columns;
    let height = min(BAND_HEIGHT, frame.n_rows - row);
    return vec2<u32>(frame.first_column + in_band / height, frame.first_row + row + in_band % height);
}

fn pixel_key(ray_idx: u32) -> vec2<u32> {
    return hash(frame.seed ^ hash(pixel_of(ray_idx)));
}

// Returns the background in the row of a pixel.
fn pixel_background(pixel: u32) -> vec3<f32> {
    let height = (f32(pixel_of(pixel).y) + 0.5) / f32(frame.height);
    return mix(frame.background_top, frame.background_bottom, height);
}

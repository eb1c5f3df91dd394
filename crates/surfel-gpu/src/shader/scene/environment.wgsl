// Environment maps: light from an equirectangular picture, sampled in proportion to its luminance.

// A cell of a distribution, and a uniform offset in it.
struct SampledCell {
    cell: u32,
    offset: f32,
}

fn environment_radiance(light: LightRecord, direction: vec3<f32>) -> vec3<f32> {
    return environment_at(light, environment_position(light, direction));
}

// Returns the density per steradian with which directions are sampled.
fn environment_density(light: LightRecord, direction: vec3<f32>) -> f32 {
    let position = environment_position(light, direction);
    let cell = min(vec2<u32>(position), light.size - 1u);
    let probability =
        cell_probability(row_cdf(light), light.size.y, cell.y) * cell_probability(column_cdf(light, cell.y), light.size.x, cell.x);
    let step = PI / f32(light.size.y);
    let height = 2.0 * cos_sin(step * (f32(cell.y) + 0.5)).y * cos_sin(0.5 * step).y;
    return probability / (TAU / f32(light.size.x) * height);
}

// Returns the position of a direction in the picture, in pixels from its upper left corner.
fn environment_position(light: LightRecord, direction: vec3<f32>) -> vec2<f32> {
    let right = dot(direction, light.direction);
    let middle = dot(direction, light.color);
    let up = dot(direction, light.ground);
    let level = sqrt(right * right + middle * middle);
    let across = select(atan2(right, middle), 0.0, level == 0.0);
    return vec2<f32>(0.5 + across / TAU, atan2(level, up) / PI) * vec2<f32>(light.size);
}

// Interpolates the radiance bilinearly at a position in pixels.
fn environment_at(light: LightRecord, position: vec2<f32>) -> vec3<f32> {
    let at = position - 0.5;
    let corner = floor(at);
    let weight = at - corner;
    // Columns wrap around the sphere; the first and last rows extend to the poles.
    let last = light.size - 1u;
    var left = last.x;
    var right = 0u;
    if 0.0 <= corner.x {
        left = min(u32(corner.x), last.x);
        right = select(0u, left + 1u, left < last.x);
    }
    let top = min(u32(max(corner.y, 0.0)), last.y);
    let bottom = min(u32(max(corner.y + 1.0, 0.0)), last.y);
    let above = mix(environment_pixel(light, left, top), environment_pixel(light, right, top), weight.x);
    let below = mix(environment_pixel(light, left, bottom), environment_pixel(light, right, bottom), weight.x);
    return light.strength * mix(above, below, weight.y);
}

fn environment_pixel(light: LightRecord, x: u32, y: u32) -> vec3<f32> {
    let first = light.first_word + 3u * (y * light.size.x + x);
    return bitcast<vec3<f32>>(vec3<u32>(words[first], words[first + 1u], words[first + 2u]));
}

// Returns the first word of the distribution over rows, which follows the pixels.
fn row_cdf(light: LightRecord) -> u32 {
    return light.first_word + 3u * light.size.x * light.size.y;
}

fn column_cdf(light: LightRecord, y: u32) -> u32 {
    return row_cdf(light) + light.size.y + y * light.size.x;
}

// Returns a direction for a uniform point of the unit square.
fn sample_environment(light: LightRecord, uv: vec2<f32>) -> vec3<f32> {
    let row = sample_cell(row_cdf(light), light.size.y, uv.y);
    let column = sample_cell(column_cdf(light, row.cell), light.size.x, uv.x);
    let azimuth = cos_sin(TAU * ((f32(column.cell) + column.offset) / f32(light.size.x) - 0.5));
    // The angles are those from the nearer pole, where all heights would be one single float.
    let is_below = light.size.y <= 2u * row.cell;
    let begin = select(row.cell, light.size.y - row.cell, is_below);
    let end = select(row.cell + 1u, light.size.y - row.cell - 1u, is_below);
    let half_step = 0.5 * PI / f32(light.size.y);
    let sines = vec2<f32>(cos_sin(half_step * f32(begin)).y, cos_sin(half_step * f32(end)).y);
    let depth = 2.0 * mix(sines.x * sines.x, sines.y * sines.y, row.offset);
    let level = sqrt(max(depth * (2.0 - depth), 0.0));
    let height = select(1.0 - depth, depth - 1.0, is_below);
    return normalize(
        level * azimuth.y * light.direction + level * azimuth.x * light.color + height * light.ground,
    );
}

fn cell_end(first: u32, n_cells: u32, cell: u32) -> u32 {
    if cell + 1u < n_cells {
        return words[first + cell + 1u];
    }
    return NONE;
}

fn cell_probability(first: u32, n_cells: u32, cell: u32) -> f32 {
    return f32(cell_end(first, n_cells, cell) - words[first + cell]) / 4294967295.0;
}

// Maps `u`, uniform in [0, 1), to a cell of a cumulative distribution.
fn sample_cell(first: u32, n_cells: u32, u: f32) -> SampledCell {
    // Random numbers have 24 bits, so the product is exact but for the last step.
    let scaled = u32(u * 16777216.0);
    let step = min((scaled << 8u) - select(0u, 1u, scaled != 0u), NONE - 1u);
    // Several cells may begin here; the last one is meant.
    var low = 0u;
    var high = n_cells;
    while low < high {
        let middle = (low + high) / 2u;
        if words[first + middle] <= step {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    let cell = max(low, 1u) - 1u;
    let start = words[first + cell];
    let width = cell_end(first, n_cells, cell) - start;
    return SampledCell(cell, min(f32(step - start) / f32(max(width, 1u)), 0.99999994));
}

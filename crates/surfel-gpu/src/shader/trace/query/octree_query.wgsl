// The closest hit of a ray on the cells of an octree.

// The nearest cell on a ray so far; its index is NONE if there is none.
struct NearestCell {
    distance: f32,
    cell_idx: u32,
    cube: CellCube,
}

// Returns the nearest cell that the ray hits, or any if that is enough.
fn octree_hit(ray: Ray, at_origin: f32, per_distance: f32) -> NearestCell {
    var nearest = NearestCell(ray.t_max, NONE, CellCube(vec3<f32>(0.0), 0.0));
    start_walk(ray);
    loop {
        let interval = next_cell(nearest.distance, at_origin, per_distance);
        if interval.cell_idx == NONE {
            return nearest;
        }
        let distance = cell_distance(interval, ray);
        let is_tie = distance == nearest.distance && interval.cell_idx < nearest.cell_idx;
        if distance != NO_LIMIT && (distance < nearest.distance || is_tie) {
            nearest = NearestCell(distance, interval.cell_idx, interval.cube);
            // A search without colours asks for any cell.
            if !HAS_COLORS {
                return nearest;
            }
        }
    }
    return nearest;
}

// Returns the distance to the surface in a cell, or NO_LIMIT without a hit.
fn cell_distance(interval: CellInterval, ray: Ray) -> f32 {
    if SURFACE == OCTREE {
        return corner_distance(interval, ray);
    }
    return plane_distance(interval, ray);
}

fn plane_distance(interval: CellInterval, ray: Ray) -> f32 {
    let plane = cell_plane(interval.cell_idx);
    let cube = interval.cube;
    let height = dot(plane.xyz, ray.origin - (cube.low + 0.5 * cube.size)) + plane.w;
    let along = dot(plane.xyz, ray.direction);
    if along == 0.0 {
        return NO_LIMIT;
    }
    let distance = -height / along;
    let margin = MAX_CELL_MARGIN * cube.size;
    let is_inside = interval.enter - margin <= distance && distance <= interval.leave + margin;
    return select(NO_LIMIT, distance, is_inside && ray.t_min <= distance && distance <= ray.t_max);
}

// The corners, and the ray in the coordinates of the cell, in which its sides have length 1.
var<private> query_corners: CellCorners;
var<private> cell_origin: vec3<f32>;
var<private> cell_direction: vec3<f32>;

fn corner_distance(interval: CellInterval, ray: Ray) -> f32 {
    let cube = interval.cube;
    let margin = CORNER_MARGIN * cube.size;
    let start = interval.enter - margin;
    let step = (interval.leave + margin - start) * (1.0 / f32(N_PARTS));
    query_corners = cell_corners(interval.cell_idx);
    cell_origin = (ray.origin - cube.low + start * ray.direction) * (1.0 / cube.size);
    cell_direction = ray.direction * (1.0 / cube.size);
    var before = value_at(0.0);
    for (var part = 0u; part < N_PARTS; part++) {
        let low = f32(part) * step;
        let high = f32(part + 1u) * step;
        let after = value_at(high);
        if (before <= 0.0) != (after <= 0.0) {
            let root = zero_between(vec2<f32>(low, before), vec2<f32>(high, after));
            let rises = (after - before) * dot(corner_normal(cell_origin + root * cell_direction), ray.direction);
            let found = start + root;
            if 0.0 <= rises && ray.t_min <= found && found <= ray.t_max {
                return found;
            }
        }
        before = after;
    }
    return NO_LIMIT;
}

fn value_at(t: f32) -> f32 {
    let c = query_corners.values;
    let low = vec4<f32>(c[0], c[2], c[4], c[6]);
    let high = vec4<f32>(c[1], c[3], c[5], c[7]);
    let position = cell_origin + t * cell_direction;
    let by_x = low + position.x * (high - low);
    let by_y = by_x.xz + position.y * (by_x.yw - by_x.xz);
    return by_y.x + position.z * (by_y.y - by_y.x);
}

// Returns the zero between two distances with values of different signs, by two steps of regula falsi.
fn zero_between(low: vec2<f32>, high: vec2<f32>) -> f32 {
    let guess = zero_of_line(low, high);
    let value = value_at(guess);
    if value == 0.0 {
        return guess;
    }
    let is_like_low = (0.0 < value) == (0.0 < low.y);
    return zero_of_line(vec2<f32>(guess, value), select(low, high, is_like_low));
}

// Returns the distance at which the line through two pairs of distance and value is zero.
fn zero_of_line(a: vec2<f32>, b: vec2<f32>) -> f32 {
    let fall = a.y - b.y;
    return a.x + (b.x - a.x) * select(0.0, a.y / select(fall, 1.0, fall == 0.0), fall != 0.0);
}

// Returns the normal between the corners, not of unit length.
fn corner_normal(position: vec3<f32>) -> vec3<f32> {
    let n = query_corners.normals;
    let low = mix_corners(mix_corners(n[0], n[1], position.x), mix_corners(n[2], n[3], position.x), position.y);
    let high = mix_corners(mix_corners(n[4], n[5], position.x), mix_corners(n[6], n[7], position.x), position.y);
    return mix_corners(low, high, position.z);
}

fn mix_corners(low: vec3<f32>, high: vec3<f32>, fraction: f32) -> vec3<f32> {
    return low + fraction * (high - low);
}

// The field of weighted planes along a part of a ray, where each point's distance is linear and its weight a polynomial.

// A segment of a ray in a leaf.
struct RaySegment {
    start: f32,
    length: f32,
    // The leaf's entries.
    first_entry: u32,
    end_entry: u32,
}

// The interval of a segment in which the field may be zero.
struct Bracket {
    begin: f32,
    end: f32,
    // Support of the first point, 0 without points.
    support: f32,
}

// The field at eight equidistant positions of an interval.
struct Samples {
    begin: f32,
    step: f32,
    values: array<f32, N_SAMPLES>,
    // The places between which and the next ones the field changes its sign, one bit each.
    crossings: u32,
}

// A zero of the field on a ray; the slot is that of the nearest point.
struct FieldHit {
    is_hit: bool,
    distance: f32,
    slot: u32,
    normal: vec3<f32>,
    // Sum of colours, and of their weights.
    color: vec4<f32>,
}

fn no_field_hit() -> FieldHit {
    return FieldHit(false, NO_LIMIT, NONE, vec3<f32>(0.0), vec4<f32>(0.0));
}

// Finds the first zero in a segment of a ray at which the ray crosses the surface.
fn first_zero(ray: Ray, part: RaySegment) -> FieldHit {
    let bracket = bracket_zeros(ray, part);
    if bracket.support <= 0.0 || bracket.end < bracket.begin {
        return no_field_hit();
    }
    let margin = BRACKET_MARGIN * bracket.support;
    var samples = sample_field(ray, part, bracket.begin - margin, bracket.end + margin);
    var crossings = samples.crossings;
    while crossings != 0u {
        let crossing = firstTrailingBit(crossings);
        crossings &= crossings - 1u;
        var root = root_of(&samples, crossing);
        if LINEAR_STEP * bracket.support < samples.step {
            let begin = samples.begin + f32(crossing) * samples.step;
            var finer = sample_field(ray, part, begin, samples.begin + f32(crossing + 1u) * samples.step);
            if finer.crossings != 0u {
                root = root_of(&finer, firstTrailingBit(finer.crossings));
            }
        }
        let distance = part.start + root;
        if distance < ray.t_min || ray.t_max < distance {
            continue;
        }
        let found = hit_at(ray, part, distance, samples.values[crossing + 1u] - samples.values[crossing]);
        if found.is_hit {
            return found;
        }
    }
    return no_field_hit();
}

// Returns the interval between the planes that the ray crosses first and last, where the field may be zero: it is a mean
// of the distances from the planes.
fn bracket_zeros(ray: Ray, part: RaySegment) -> Bracket {
    let start = ray_at(ray, part.start);
    var low = vec2<f32>(NO_LIMIT);
    var high = vec2<f32>(-NO_LIMIT);
    var bracket = Bracket(NO_LIMIT, -NO_LIMIT, 0.0);
    for (var i = part.first_entry; i < part.end_entry; i++) {
        let entry = leaf_entry(i);
        let points = load_points(entry.block_idx, start);
        for (var lanes = entry.lanes; lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            let is_flipped = ((entry.flips >> lane) & 1u) == 1u;
            let point = ray_point(point_at(points, lane), is_flipped, ray.direction, part.length);
            if !point.is_near {
                continue;
            }
            if bracket.support == 0.0 {
                bracket.support = 1.0 / sqrt(point.inverse_support_squared);
            }
            let heights = vec2<f32>(point.height, point.height + part.length * point.slope);
            low = min(low, heights);
            high = max(high, heights);
            // A ray along the plane does not cross it.
            if 1e-30 * abs(point.height) < abs(point.slope) {
                let crossing = -point.height / point.slope;
                bracket.begin = select(bracket.begin, min(bracket.begin, crossing), 0.0 <= crossing);
                bracket.end = select(bracket.end, max(bracket.end, crossing), crossing <= part.length);
            }
        }
    }
    let has_both_signs = (low <= vec2<f32>(0.0)) & (vec2<f32>(0.0) <= high);
    bracket.begin = select(bracket.begin, 0.0, has_both_signs.x);
    bracket.end = select(bracket.end, part.length, has_both_signs.y);
    return bracket;
}

// Returns the field at equidistant positions of an interval.
fn sample_field(ray: Ray, part: RaySegment, begin: f32, end: f32) -> Samples {
    let start = ray_at(ray, part.start);
    let step = (end - begin) / f32(N_SAMPLES - 1u);
    let near_t = begin + step * vec4<f32>(0.0, 1.0, 2.0, 3.0);
    let far_t = begin + step * vec4<f32>(4.0, 5.0, 6.0, 7.0);
    var weights = mat2x4<f32>(vec4<f32>(0.0), vec4<f32>(0.0));
    var heights = weights;
    for (var i = part.first_entry; i < part.end_entry; i++) {
        let entry = leaf_entry(i);
        let points = load_points(entry.block_idx, start);
        for (var lanes = entry.lanes; lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            let is_flipped = ((entry.flips >> lane) & 1u) == 1u;
            let point = ray_point(point_at(points, lane), is_flipped, ray.direction, part.length);
            if point.is_near {
                let own = mat2x4<f32>(weights_at(point, near_t), weights_at(point, far_t));
                weights += own;
                heights[0] += own[0] * (point.height + near_t * point.slope);
                heights[1] += own[1] * (point.height + far_t * point.slope);
            }
        }
    }
    return signs_of(begin, step, weights, heights);
}

// Returns the weights of a point at four distances.
fn weights_at(point: RayPoint, t: vec4<f32>) -> vec4<f32> {
    let squares = point.squared - t * (point.along + point.along - t);
    let inside = max(1.0 - squares * point.inverse_support_squared, vec4<f32>(0.0));
    let squared = inside * inside;
    return squared * squared;
}

// Returns samples with the places at which the sign changes, from sums of weights and of weighted heights.
fn signs_of(begin: f32, step: f32, weights: mat2x4<f32>, heights: mat2x4<f32>) -> Samples {
    let near = heights[0] / max(weights[0], vec4<f32>(1e-30));
    let far = heights[1] / max(weights[1], vec4<f32>(1e-30));
    let values = array<f32, N_SAMPLES>(near.x, near.y, near.z, near.w, far.x, far.y, far.z, far.w);
    let valid = mask_of(vec4<f32>(MIN_FIELD_WEIGHT) <= weights[0], vec4<f32>(MIN_FIELD_WEIGHT) <= weights[1]);
    let above = mask_of(vec4<f32>(0.0) < near, vec4<f32>(0.0) < far);
    let crossings = (above ^ (above >> 1u)) & valid & (valid >> 1u) & 0x7fu;
    return Samples(begin, step, values, crossings);
}

// Returns eight bits.
fn mask_of(low: vec4<bool>, high: vec4<bool>) -> u32 {
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), low)
        + select(vec4<u32>(0u), vec4<u32>(16u, 32u, 64u, 128u), high);
    return bits.x + bits.y + bits.z + bits.w;
}

// Returns the zero of the line through the field at both ends of a crossing.
fn root_of(samples: ptr<function, Samples>, crossing: u32) -> f32 {
    let a = (*samples).values[crossing];
    let b = (*samples).values[crossing + 1u];
    let begin = (*samples).begin + f32(crossing) * (*samples).step;
    let end = (*samples).begin + f32(crossing + 1u) * (*samples).step;
    return begin + (end - begin) * (a / (a - b));
}

// Returns the hit at a zero of the field, unless the field grows against the normals there: between two sheets that face
// the same way it changes its sign without a surface.
fn hit_at(ray: Ray, part: RaySegment, distance: f32, slope: f32) -> FieldHit {
    let start = ray_at(ray, part.start);
    let position = ray_at(ray, distance);
    var hit = no_field_hit();
    var nearest_squared = NO_LIMIT;
    for (var i = part.first_entry; i < part.end_entry; i++) {
        let entry = leaf_entry(i);
        let points = load_points(entry.block_idx, start);
        for (var lanes = entry.lanes; lanes != 0u; lanes &= lanes - 1u) {
            let lane = firstTrailingBit(lanes);
            let is_flipped = ((entry.flips >> lane) & 1u) == 1u;
            if !ray_point(point_at(points, lane), is_flipped, ray.direction, part.length).is_near {
                continue;
            }
            let slot = 8u * entry.block_idx + lane;
            let point = slot_point(slot, position);
            let squared = dot(point.center, point.center);
            let weight = support_weight(squared, inverse_support_squared(point.radius));
            hit.normal += weight * side_normal(point.normal, is_flipped);
            if squared < nearest_squared || squared == nearest_squared && slot < hit.slot {
                nearest_squared = squared;
                hit.slot = slot;
            }
            if HAS_COLORS && visits[visit_idx].blends_colors == 1u && FIELD_MIN_COLOR_WEIGHT <= weight {
                hit.color += weight * weight * weight * vec4<f32>(slot_color(slot), 1.0);
            }
        }
    }
    hit.is_hit = hit.slot != NONE && 0.0 <= dot(hit.normal, ray.direction) * slope;
    hit.distance = distance;
    return hit;
}

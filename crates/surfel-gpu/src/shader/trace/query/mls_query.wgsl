// The surface of moving least squares along a ray: from the ball that the ray enters to the polynomial fitted to the
// points around.

// The position around which points count, and the radius of the ball that the ray entered.
var<private> listed_position: vec3<f32>;
var<private> ball_radius: f32;
// The colour of the last hit that was accepted, and its nearest point.
var<private> color_sum: vec4<f32>;
var<private> nearest_slot: u32;

struct MlsHit {
    is_hit: bool,
    distance: f32,
    normal: vec3<f32>,
    // Distance along the ray at which the search goes on without a hit.
    restart: f32,
}

// The weighted sum of the colours around a hit, and its nearest point.
struct HitColor {
    sum: vec4<f32>,
    nearest_squared: f32,
    nearest_slot: u32,
}

// Lists the blocks within reach of the listed position.
fn list_points() {
    let reach = (MLS_SUPPORT + LIST_MARGIN) * ball_radius;
    list_blocks(listed_position - reach, listed_position + reach, 0.0);
}

// Returns the lanes of a block whose points may count.
fn listed_lanes(points: BlockPoints) -> u32 {
    // The exact test follows, in radii.
    let max_distance = (MLS_SUPPORT + LIST_MARGIN) * (1.0 + 8.0 * EPSILON) * ball_radius;
    return lanes_within(points, max_distance * max_distance);
}

// A point near the position of a fit.
struct ListedPoint {
    is_used: bool,
    // Offset from the position in radii of the ball.
    offset: vec3<f32>,
    weight: f32,
}

// Returns the point in a lane, for a fit at a distance along the ray behind the listed position.
fn listed_point(points: BlockPoints, lane: u32, shift: vec3<f32>) -> ListedPoint {
    let max_squared = (MLS_SUPPORT + LIST_MARGIN) * (MLS_SUPPORT + LIST_MARGIN);
    let point = point_at(points, lane);
    let listed = point.center * (1.0 / ball_radius);
    let offset = listed - shift;
    let inverse = ball_radius / (MLS_SUPPORT * max(point.radius, 1e-18));
    let is_used = 0.0 < point.radius && dot(listed, listed) < max_squared;
    return ListedPoint(is_used, offset, support_weight(dot(offset, offset), inverse * inverse));
}

// Fits a plane or a polynomial at a distance along the ray behind the listed position.
fn fit_at(ray: Ray, behind: f32, is_plane: bool, normal: vec3<f32>) -> FitHit {
    let shift = ray.direction * (behind / ball_radius);
    var plane_sums = no_plane_points();
    var polynomial_sums = no_polynomial_points(normal);
    list_points();
    loop {
        for (var i = 0u; i < n_listed; i++) {
            let points = load_points(listed_blocks[i], listed_position);
            for (var lanes = listed_lanes(points); lanes != 0u; lanes &= lanes - 1u) {
                let point = listed_point(points, firstTrailingBit(lanes), shift);
                if !point.is_used {
                    continue;
                }
                if is_plane {
                    plane_sums = with_plane_point(plane_sums, point.offset, point.weight);
                } else {
                    add_polynomial_point(&polynomial_sums, point.offset, point.weight);
                }
            }
        }
        if !list_more() {
            break;
        }
    }
    if is_plane {
        return intersect_plane(plane_sums, ray.direction);
    }
    return intersect_polynomial(polynomial_sums, ray.direction);
}

// Adds the points of a block to what is known of a hit.
fn finish_with_block(
    stats: ptr<function, NeighborhoodStats>,
    color: ptr<function, HitColor>,
    block_idx: u32,
    shift: vec3<f32>,
) {
    let points = load_points(block_idx, listed_position);
    for (var lanes = listed_lanes(points); lanes != 0u; lanes &= lanes - 1u) {
        let lane = firstTrailingBit(lanes);
        let point = listed_point(points, lane, shift);
        if !point.is_used {
            continue;
        }
        let from_hit = point.offset * ball_radius;
        if is_neighbor((*stats).hit, from_hit) {
            add_neighbor(stats, from_hit, vec3<f32>(0.0));
        }
        if HAS_COLORS {
            add_color(color, point, 8u * block_idx + lane);
        }
    }
}

fn add_color(color: ptr<function, HitColor>, point: ListedPoint, slot: u32) {
    let cubed = point.weight * point.weight * point.weight;
    if visits[visit_idx].blends_colors == 1u && MLS_MIN_COLOR_WEIGHT < cubed {
        (*color).sum += cubed * vec4<f32>(slot_color(slot), 1.0);
    }
    let squared = dot(point.offset, point.offset);
    let other = (*color).nearest_squared;
    if squared < other || squared == other && slot < (*color).nearest_slot {
        (*color).nearest_squared = squared;
        (*color).nearest_slot = slot;
    }
}

// Finds where a ray hits the surface near the ball that it enters.
fn find_surface(ray: Ray, start: f32, radius: f32) -> MlsHit {
    ball_radius = radius;
    var hit = MlsHit(false, start, -ray.direction, start);
    // Most surfaces lie behind the position where the ball is met.
    var listed = start + LIST_MARGIN * radius;
    var last_step = 0.0;
    for (var fit = 1u; fit <= MLS_MAX_FITS; fit++) {
        listed_position = ray_at(ray, listed);
        let fits_plane = DEGREE == 1u || fit <= N_PLANES;
        let fitted = fit_at(ray, hit.distance - listed, fits_plane, hit.normal);
        if fit == 1u {
            let clearance = RESTART_FRACTION * min(abs(fitted.height), MLS_MAX_STEP);
            hit.restart += max(clearance, MLS_RESTART_OFFSET) * radius;
        }
        let step = damped(fitted.step, last_step);
        last_step = select(step, 0.0, DEGREE != 1u && fit == N_PLANES);
        let moved = hit.distance + step * radius;
        let is_near = abs(step) <= MLS_MAX_STEP && abs(moved - start) <= MAX_DISTANCE_FROM_BALL * radius;
        if !fitted.is_hit || !is_near {
            return hit;
        }
        hit.distance = moved;
        hit.normal = fitted.normal;
        if (DEGREE == 1u || !fits_plane) && abs(fitted.step) <= MLS_TOLERANCE {
            let is_in_range = ray.t_min <= moved && moved <= ray.t_max;
            hit.normal = rounded_normal(hit.normal);
            hit.is_hit = is_in_range && is_accepted(ray, moved - listed, hit);
            return hit;
        }
        if LIST_MARGIN * radius < abs(moved - listed) {
            listed = moved;
        }
    }
    return hit;
}

// Returns true if the points enclose a hit, and finds its nearest point and its colour.
fn is_accepted(ray: Ray, behind: f32, hit: MlsHit) -> bool {
    let has_edge_test = visits[visit_idx].has_edge_test == 1u;
    if !HAS_COLORS && !has_edge_test {
        return true;
    }
    let radius = ball_radius / visits[visit_idx].radius_factor;
    let position = ray_at(ray, hit.distance);
    let shift = ray.direction * (behind / ball_radius);
    let candidate = CandidateHit(position, hit.normal, ray.direction, radius);
    var stats = no_neighbors(candidate);
    var color = HitColor(vec4<f32>(0.0), NO_LIMIT, NONE);
    list_points();
    loop {
        for (var i = 0u; i < n_listed; i++) {
            finish_with_block(&stats, &color, listed_blocks[i], shift);
        }
        if !list_more() {
            break;
        }
    }
    color_sum = color.sum;
    nearest_slot = color.nearest_slot;
    if !has_edge_test || is_surrounded(stats, false) && !is_sparse(stats) {
        return true;
    }
    let wider = visits[visit_idx].edge_retest_factor * radius;
    return is_enclosed(CandidateHit(position, hit.normal, ray.direction, wider), false);
}

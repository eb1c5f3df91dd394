// The surface of moving least squares along a ray: from the ball that the ray enters to the polynomial fitted to the
// points around.

// The question that a query for blocks answers.
const PLANE: u32 = 0u;
const POLYNOMIAL: u32 = 1u;
const FINISH: u32 = 2u;
const NEIGHBORS: u32 = 3u;

var<private> question: u32;
var<private> plane_sums: PlaneSums;
var<private> polynomial_sums: PolynomialSums;
// The position around which points count, the radius of the ball that the ray entered, and the position of the fit
// relative to the former in units of the latter.
var<private> listed_position: vec3<f32>;
var<private> ball_radius: f32;
var<private> fit_shift: vec3<f32>;
var<private> color_sum: vec4<f32>;
var<private> nearest_squared: f32;
var<private> nearest_slot: u32;

struct MlsHit {
    is_hit: bool,
    distance: f32,
    normal: vec3<f32>,
    // Distance along the ray at which the search goes on without a hit.
    restart: f32,
}

fn visit_region_block(block_idx: u32) {
    if question == NEIGHBORS {
        add_neighbors(block_idx);
        return;
    }
    let max_squared = (MLS_SUPPORT + LIST_MARGIN) * (MLS_SUPPORT + LIST_MARGIN);
    let head = load_head(block_idx);
    // The exact test follows, in radii.
    let max_distance = (MLS_SUPPORT + LIST_MARGIN) * (1.0 + 8.0 * EPSILON) * ball_radius;
    var lanes = lanes_within(block_idx, head, listed_position, max_distance * max_distance);
    for (; lanes != 0u; lanes &= lanes - 1u) {
        let lane = firstTrailingBit(lanes);
        let point = block_point(block_idx, head, lane, listed_position);
        let listed = point.center * (1.0 / ball_radius);
        if 0.0 < point.radius && dot(listed, listed) < max_squared {
            add_listed_point(listed - fit_shift, point.radius, 8u * block_idx + lane);
        }
    }
}

// Adds a point at `offset` from the position of the fit, in radii of the ball.
fn add_listed_point(offset: vec3<f32>, radius: f32, slot: u32) {
    let inverse = ball_radius / (MLS_SUPPORT * radius);
    let weight = mls_weight(offset, inverse * inverse);
    if question == PLANE {
        plane_sums = with_plane_point(plane_sums, offset, weight);
        return;
    }
    if question == POLYNOMIAL {
        add_polynomial_point(&polynomial_sums, offset, weight);
        return;
    }
    let from_hit = offset * ball_radius;
    if is_neighbor(neighborhood.hit, from_hit) {
        add_neighbor(&neighborhood, from_hit, vec3<f32>(0.0));
    }
    if !HAS_COLORS {
        return;
    }
    let cubed = weight * weight * weight;
    if visits[visit_idx].blends_colors == 1u && MLS_MIN_COLOR_WEIGHT < cubed {
        color_sum += cubed * vec4<f32>(slot_color(slot), 1.0);
    }
    let squared = dot(offset, offset);
    if squared < nearest_squared || squared == nearest_squared && slot < nearest_slot {
        nearest_squared = squared;
        nearest_slot = slot;
    }
}

// Asks for the points around the listed position, for a fit at a distance along the ray behind it.
fn query_listed(task: u32, ray: Ray, behind: f32) {
    question = task;
    fit_shift = ray.direction * (behind / ball_radius);
    let reach = (MLS_SUPPORT + LIST_MARGIN) * ball_radius;
    query_box(listed_position - reach, listed_position + reach, 0.0);
    question = NEIGHBORS;
}

// Fits a plane or a polynomial at a distance along the ray behind the listed position.
fn fit_at(ray: Ray, behind: f32, is_plane: bool, normal: vec3<f32>) -> FitHit {
    if is_plane {
        plane_sums = no_plane_points();
        query_listed(PLANE, ray, behind);
        return intersect_plane(plane_sums, ray.direction);
    }
    polynomial_sums = no_polynomial_points(normal);
    query_listed(POLYNOMIAL, ray, behind);
    return intersect_polynomial(polynomial_sums, ray.direction);
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
    neighborhood = no_neighbors(CandidateHit(position, hit.normal, ray.direction, radius));
    color_sum = vec4<f32>(0.0);
    nearest_squared = NO_LIMIT;
    nearest_slot = NONE;
    query_listed(FINISH, ray, behind);
    if !has_edge_test || is_surrounded(neighborhood, false) && !is_sparse(neighborhood) {
        return true;
    }
    let wider = visits[visit_idx].edge_retest_factor * radius;
    return is_enclosed(CandidateHit(position, hit.normal, ray.direction, wider), false);
}

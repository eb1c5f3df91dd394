// The smooth surface along a ray: from the disc that the ray hits to the sphere fitted to the points around.

// The question that a query for blocks answers.
const FIT: u32 = 0u;
const FINISH: u32 = 1u;
const NEIGHBORS: u32 = 2u;
// Distance in radii between the first fit and later ones up to which they find their points in the same list.
const FIT_MARGIN: f32 = 0.25;

var<private> question: u32 = NEIGHBORS;
var<private> sphere_sums: SphereSums;
var<private> overhang: OverhangSums;
var<private> colors: ColorSums;
var<private> nearest_squared: f32;
var<private> nearest_slot: u32;
// The position that points are relative to.
var<private> fit_position: vec3<f32>;
// Square of the distance from this position beyond which no point counts.
var<private> fit_max_squared: f32;

struct SmoothHit {
    is_hit: bool,
    distance: f32,
    normal: vec3<f32>,
}

fn visit_region_block(block_idx: u32) {
    if question == NEIGHBORS {
        add_neighbors(block_idx);
        return;
    }
    let head = load_head(block_idx);
    if question == FIT {
        add_fit_points(&sphere_sums, four_points(block_idx, head, 0u, fit_position));
        add_fit_points(&sphere_sums, four_points(block_idx, head, 1u, fit_position));
        return;
    }
    for (var lanes = lanes_within(block_idx, head, fit_position, fit_max_squared); lanes != 0u; lanes &= lanes - 1u) {
        let lane = firstTrailingBit(lanes);
        let point = block_point(block_idx, head, lane, fit_position);
        if 0.0 < point.radius {
            finish_with_point(point, 8u * block_idx + lane);
        }
    }
}

fn finish_with_point(point: Point, slot: u32) {
    let fit = fit_point(point);
    if !is_within_reach(fit, overhang.per_radius) {
        return;
    }
    if is_neighbor(neighborhood.hit, point.center) {
        add_neighbor(&neighborhood, point.center, point.normal);
    }
    add_overhang_point(&overhang, fit);
    if !HAS_COLORS {
        return;
    }
    if visits[visit_idx].blends_colors == 1u {
        colors = with_color(colors, fit, slot_color(slot));
    }
    let squared = dot(point.center, point.center);
    if squared < nearest_squared || squared == nearest_squared && slot < nearest_slot {
        nearest_squared = squared;
        nearest_slot = slot;
    }
}

// Asks for the points within reach of a position.
fn query_points(task: u32, position: vec3<f32>, radius: f32) {
    question = task;
    fit_position = position;
    let reach = FIT_REACH * radius;
    // The exact test follows, in radii.
    fit_max_squared = reach * reach * (1.0 + 8.0 * EPSILON);
    query_box(position - reach, position + reach, FIT_MARGIN * radius);
    question = NEIGHBORS;
}

// Finds where a ray hits the surface near the disc that it hits.
fn find_surface(ray: Ray, disc_distance: f32, disc: Surfel) -> SmoothHit {
    let missed = SmoothHit(false, 0.0, vec3<f32>(0.0));
    var normal = facing(disc.normal, ray.direction);
    var distance = disc_distance;
    var last_step = 0.0;
    for (var fit = 1u; fit <= MAX_FITS; fit++) {
        sphere_sums = no_fit_points(normal, disc.radius);
        query_points(FIT, ray_at(ray, distance), disc.radius);
        let sphere = intersect_fit(sphere_sums, ray.direction);
        let step = damped(sphere.step, last_step);
        last_step = step;
        let moved = distance + step;
        if !sphere.is_hit || MAX_DISTANCE_FROM_DISC * disc.radius < abs(moved - disc_distance) {
            return missed;
        }
        distance = moved;
        normal = facing(sphere.normal, ray.direction);
        if abs(sphere.step) <= FIT_TOLERANCE * disc.radius {
            break;
        }
        if fit == MAX_FITS && MAX_LAST_STEP * disc.radius < abs(sphere.step) {
            return missed;
        }
    }
    let is_in_range = ray.t_min <= distance && distance <= ray.t_max;
    if !is_in_range || !is_accepted(ray, distance, normal, disc) {
        return missed;
    }
    return SmoothHit(true, distance, normal);
}

// Returns true if the points enclose a hit, and finds its nearest point and its colour.
fn is_accepted(ray: Ray, distance: f32, normal: vec3<f32>, disc: Surfel) -> bool {
    if !HAS_COLORS && visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    let position = ray_at(ray, distance);
    let hit = CandidateHit(position, normal, ray.direction, disc.radius);
    neighborhood = no_neighbors(hit);
    overhang = no_overhang(normal, disc.center - position, disc.radius);
    colors = ColorSums(0.0, vec3<f32>(0.0));
    nearest_squared = NO_LIMIT;
    query_points(FINISH, position, disc.radius);
    if visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    if sticks_out(overhang) {
        return false;
    }
    if is_surrounded(neighborhood, false) && !is_sparse(neighborhood) {
        return true;
    }
    let radius = visits[visit_idx].edge_retest_factor * disc.radius;
    return is_enclosed(CandidateHit(position, normal, ray.direction, radius), false);
}

// The smooth surface along a ray: from the disc that the ray hits to the sphere fitted to the points around.

// Distance in radii between the first fit and later ones up to which they find their points in the same list.
const FIT_MARGIN: f32 = 0.1;

// The colour of the last hit that was accepted, and its nearest point.
var<private> colors: ColorSums;
var<private> nearest_slot: u32;

struct SmoothHit {
    is_hit: bool,
    distance: f32,
    normal: vec3<f32>,
}

// The colour of a hit, and its nearest point.
struct HitColor {
    sums: ColorSums,
    nearest_squared: f32,
    nearest_slot: u32,
}

// Lists the blocks within reach of a position.
fn list_points(position: vec3<f32>, radius: f32) {
    let reach = FIT_REACH * radius;
    list_blocks(position - reach, position + reach, FIT_MARGIN * radius);
}

// Sums up the points around a position, with the normals on the side of `guide`.
fn fit_sums(position: vec3<f32>, guide: vec3<f32>, radius: f32) -> SphereSums {
    var sums = no_fit_points(guide, radius);
    list_points(position, radius);
    loop {
        for (var i = 0u; i < n_listed; i++) {
            let block_idx = listed_blocks[i];
            let head = load_head(block_idx);
            add_fit_points(&sums, four_points(block_idx, head, 0u, position));
            add_fit_points(&sums, four_points(block_idx, head, 1u, position));
        }
        if !list_more() {
            break;
        }
    }
    return sums;
}

// Adds the points of a block to what is known of a hit.
fn finish_with_block(
    stats: ptr<function, NeighborhoodStats>,
    overhang: ptr<function, OverhangSums>,
    color: ptr<function, HitColor>,
    block_idx: u32,
) {
    let hit = (*stats).hit;
    let points = load_points(block_idx, hit.position);
    let reach = FIT_REACH * hit.radius;
    // The exact test follows, in radii.
    let max_squared = reach * reach * (1.0 + 8.0 * EPSILON);
    for (var lanes = lanes_within(points, max_squared); lanes != 0u; lanes &= lanes - 1u) {
        let lane = firstTrailingBit(lanes);
        let point = point_at(points, lane);
        let fit = fit_point(point);
        if point.radius <= 0.0 || !is_within_reach(fit, (*overhang).per_radius) {
            continue;
        }
        if is_neighbor(hit, point.center) {
            add_neighbor(stats, point.center, point.normal);
        }
        add_overhang_point(overhang, fit);
        if HAS_COLORS {
            add_color(color, fit, 8u * block_idx + lane);
        }
    }
}

fn add_color(color: ptr<function, HitColor>, point: FitPoint, slot: u32) {
    if visits[visit_idx].blends_colors == 1u {
        (*color).sums = with_color((*color).sums, point, slot_color(slot));
    }
    // A wide disc's neighbours reach less far than it does.
    let squared = dot(point.offset, point.offset) * point.inverse_support_squared;
    let other = (*color).nearest_squared;
    if squared < other || squared == other && slot < (*color).nearest_slot {
        (*color).nearest_squared = squared;
        (*color).nearest_slot = slot;
    }
}

// Finds where a ray hits the surface near the disc that it hits.
fn find_surface(ray: Ray, disc_distance: f32, disc: Surfel) -> SmoothHit {
    let missed = SmoothHit(false, 0.0, vec3<f32>(0.0));
    var normal = facing(disc.normal, ray.direction);
    var distance = disc_distance;
    var last_step = 0.0;
    var inside = ray_at(ray, distance);
    for (var fit = 1u; fit <= MAX_FITS; fit++) {
        let sums = fit_sums(ray_at(ray, distance), normal, disc.radius);
        let sphere = intersect_fit(sums, ray.direction);
        inside = ray_at(ray, distance) + mean_offset(sums);
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
    if !is_in_range || !is_accepted(ray, distance, normal, inside, disc) {
        return missed;
    }
    return SmoothHit(true, distance, normal);
}

// Returns true if the points enclose a hit, and finds its nearest point and its colour. `inside` is the mean of the points
// of the last fit.
fn is_accepted(ray: Ray, distance: f32, normal: vec3<f32>, inside: vec3<f32>, disc: Surfel) -> bool {
    if !HAS_COLORS && visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    let position = ray_at(ray, distance);
    let hit = CandidateHit(position, normal, ray.direction, disc.radius);
    var stats = no_neighbors(hit);
    var overhang = no_overhang(normal, inside - position, disc.radius);
    var color = HitColor(ColorSums(0.0, vec3<f32>(0.0)), NO_LIMIT, nearest_slot);
    list_points(position, disc.radius);
    loop {
        for (var i = 0u; i < n_listed; i++) {
            finish_with_block(&stats, &overhang, &color, listed_blocks[i]);
        }
        if !list_more() {
            break;
        }
    }
    colors = color.sums;
    nearest_slot = color.nearest_slot;
    if visits[visit_idx].has_edge_test == 0u {
        return true;
    }
    if sticks_out(overhang) {
        return false;
    }
    if is_surrounded(stats, false) && !is_sparse(stats) {
        return true;
    }
    let radius = visits[visit_idx].edge_retest_factor * disc.radius;
    return is_enclosed(CandidateHit(position, normal, ray.direction, radius), false);
}

// The angular-gap test decides whether the points surround a hit or it lies beyond the edge of the surface.

struct CandidateHit {
    position: vec3<f32>,
    // Unit normal, which faces the ray's origin.
    normal: vec3<f32>,
    // Unit direction of the ray.
    direction: vec3<f32>,
    radius: f32,
}

// Statistics of the points around a hit.
struct NeighborhoodStats {
    hit: CandidateHit,
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    n_neighbors: u32,
    n_passed: u32,
    // The clockwise and the counterclockwise end of the interval of directions, if there is any.
    first: vec2<f32>,
    last: vec2<f32>,
    has_interval: bool,
    // True if the directions leave no gap of 180 degrees.
    is_full: bool,
    // Sum of the normals of passed points, weighted by the ray's heights above their planes: it points into the free
    // space through which the ray came.
    free_side: vec3<f32>,
}

fn no_neighbors(hit: CandidateHit) -> NeighborhoodStats {
    let basis = tangent_basis(hit.normal);
    var stats: NeighborhoodStats;
    stats.hit = hit;
    stats.tangent = basis.tangent;
    stats.bitangent = basis.bitangent;
    return stats;
}

// Adds those of four points relative to a hit that are its neighbours.
fn add_neighbors(stats: ptr<function, NeighborhoodStats>, four: FourPoints) {
    let hit = (*stats).hit;
    let reach = NEIGHBORHOOD_RADIUS_FACTOR * hit.radius;
    let squared = four.x * four.x + four.y * four.y + four.z * four.z;
    let height = abs(dot_four(four.x, four.y, four.z, hit.normal));
    let is_neighbor = (squared < vec4<f32>(reach * reach))
        & (height < vec4<f32>(EDGE_MAX_PLANE_DISTANCE * hit.radius))
        & (vec4<f32>(0.0) < four.radius);
    if !any(is_neighbor) {
        return;
    }
    let neighbors = lane_bits(is_neighbor);
    (*stats).n_neighbors += countOneBits(neighbors);
    add_passed(stats, four, is_neighbor);
    let x = dot_four(four.x, four.y, four.z, (*stats).tangent);
    let y = dot_four(four.x, four.y, four.z, (*stats).bitangent);
    let is_beside = x * x + y * y <= vec4<f32>(1e-6 * hit.radius * hit.radius);
    // The lower half of the directions is rotated a little, so that points of a grid are never exactly opposite to each
    // other.
    let none = vec4<f32>(0.0);
    let is_below = (y < none) | ((y <= none) & (x < none));
    let angle = select(none, vec4<f32>(TIE_BREAK_ANGLE), is_below);
    let direction_x = x - angle * y;
    let direction_y = y + angle * x;
    let has_direction = is_neighbor & !is_beside;
    for (var lane = 0u; lane < 4u; lane++) {
        if has_direction[lane] {
            add_direction(stats, vec2<f32>(direction_x[lane], direction_y[lane]));
        }
    }
}

// Adds what tells the side from which the ray came: the neighbours that it has passed.
fn add_passed(stats: ptr<function, NeighborhoodStats>, four: FourPoints, is_neighbor: vec4<bool>) {
    let hit = (*stats).hit;
    let along = dot_four(four.x, four.y, four.z, hit.direction);
    let is_passed = is_neighbor & (along < vec4<f32>(-MIN_PASSED_DISTANCE * hit.radius));
    let n_passed = countOneBits(lane_bits(is_passed));
    if n_passed == 0u {
        return;
    }
    (*stats).n_passed += n_passed;
    let above = four.normal_x * (along * hit.direction.x - four.x)
        + four.normal_y * (along * hit.direction.y - four.y)
        + four.normal_z * (along * hit.direction.z - four.z);
    // Heights are rounded to integers, so that the sum over points does not depend on their order.
    let steps = select(vec4<f32>(0.0), round(above * (HEIGHT_STEPS / hit.radius)), is_passed);
    (*stats).free_side +=
        vec3<f32>(dot(steps, four.normal_x), dot(steps, four.normal_y), dot(steps, four.normal_z));
}

fn add_direction(stats: ptr<function, NeighborhoodStats>, direction: vec2<f32>) {
    if !(*stats).has_interval {
        (*stats).has_interval = true;
        (*stats).first = direction;
        (*stats).last = direction;
        return;
    }
    let first = (*stats).first;
    let last = (*stats).last;
    // Positive if the vector lies counterclockwise of the end.
    let from_first = first.x * direction.y - first.y * direction.x;
    let from_last = last.x * direction.y - last.y * direction.x;
    if from_first < 0.0 && 0.0 < from_last {
        (*stats).is_full = true;
    }
    if 0.0 <= from_first && 0.0 < from_last {
        (*stats).last = direction;
    }
    if from_first < 0.0 && from_last <= 0.0 {
        (*stats).first = direction;
    }
}

fn is_sparse(stats: NeighborhoodStats) -> bool {
    return stats.n_neighbors < MIN_DENSE;
}

// Returns true if the points leave no gap of 180 degrees; with `rejects_backfaces` only if the hit is no back face,
// that is, if the ray came on the side to which the normals of the points that it passed point.
fn is_surrounded(stats: NeighborhoodStats, rejects_backfaces: bool) -> bool {
    let free_side = stats.free_side;
    let cosine_times_length = dot(free_side, stats.hit.normal);
    let is_backface = cosine_times_length < MAX_BACKFACE_COSINE * sqrt(dot(free_side, free_side))
        && 1u < stats.n_passed;
    let is_enclosed = stats.is_full && MIN_NEIGHBORS <= stats.n_neighbors;
    return is_enclosed && !(rejects_backfaces && is_backface);
}

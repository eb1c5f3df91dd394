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

// Returns true if a point at `offset` from a hit is its neighbour.
fn is_neighbor(hit: CandidateHit, offset: vec3<f32>) -> bool {
    let max_distance = NEIGHBORHOOD_RADIUS_FACTOR * hit.radius;
    let height = abs(dot(hit.normal, offset));
    return dot(offset, offset) < max_distance * max_distance
        && height < EDGE_MAX_PLANE_DISTANCE * hit.radius;
}

// Adds a neighbour at `offset` from the hit. Its normal has integer components.
fn add_neighbor(stats: ptr<function, NeighborhoodStats>, offset: vec3<f32>, normal: vec3<f32>) {
    let hit = (*stats).hit;
    (*stats).n_neighbors += 1u;
    let along = dot(offset, hit.direction);
    if along < -MIN_PASSED_DISTANCE * hit.radius {
        (*stats).n_passed += 1u;
        // Heights are rounded to integers, so that the sum over points does not depend on their order.
        let above = dot(normal, along * hit.direction - offset);
        (*stats).free_side += round(above * (HEIGHT_STEPS / hit.radius)) * normal;
    }
    let x = dot(offset, (*stats).tangent);
    let y = dot(offset, (*stats).bitangent);
    if x * x + y * y <= MIN_SQUARED_OFFSET * hit.radius * hit.radius {
        return;
    }
    // The lower half of the directions is rotated a little, so that points of a grid are never exactly opposite to each
    // other.
    let is_below = y < 0.0 || y <= 0.0 && x < 0.0;
    let angle = select(0.0, TIE_BREAK_ANGLE, is_below);
    add_direction(stats, vec2<f32>(x - angle * y, y + angle * x));
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

// The nearest Gaussians of a ray that have not been composited yet.

// A Gaussian that a ray passes.
struct GaussianHit {
    // Distance along the ray in world space at which the Gaussian is densest.
    distance: f32,
    visit: u32,
    slot: u32,
    // Square of the distance from the Gaussian's centre, in deviations.
    squared: f32,
}

// The hits behind `composited`, nearest first.
var<private> buffered: array<GaussianHit, BUFFER_SIZE>;
var<private> n_buffered: u32;
// The last hit that has been composited.
var<private> composited: GaussianHit;

// Returns the distance beyond which no hit is among the nearest.
fn buffer_bound() -> f32 {
    return select(NO_LIMIT, buffered[BUFFER_SIZE - 1u].distance, n_buffered == BUFFER_SIZE);
}

fn comes_before(a: GaussianHit, b: GaussianHit) -> bool {
    if a.distance != b.distance {
        return a.distance < b.distance;
    }
    return a.visit < b.visit || a.visit == b.visit && a.slot < b.slot;
}

// Inserts a hit if it is among the nearest.
fn insert_gaussian(hit: GaussianHit) {
    var at = min(n_buffered, BUFFER_SIZE - 1u);
    if n_buffered == BUFFER_SIZE && !comes_before(hit, buffered[at]) {
        return;
    }
    while 0u < at && comes_before(hit, buffered[at - 1u]) {
        buffered[at] = buffered[at - 1u];
        at -= 1u;
    }
    buffered[at] = hit;
    n_buffered = min(n_buffered + 1u, BUFFER_SIZE);
}

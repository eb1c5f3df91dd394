// Planes through the centres of the discs nearest to a hit.

// Leaves the ray the discs whose centres are nearest to its hit, the earlier of equally near ones.
fn keep_nearest_discs(position: vec3<f32>, radius: f32) {
    var squares: array<f32, MAX_GATHERED>;
    var n_kept = 0u;
    for (var i = 0u; i < n_gathered; i++) {
        let slot = gathered_slots[i];
        let distance = gathered_distances[i];
        let offset = center_offset(slot, position, radius);
        let squared = dot(offset, offset);
        var at = n_kept;
        if n_kept == MAX_GATHERED {
            at = MAX_GATHERED - 1u;
            if !is_nearer_center(squared, slot, squares[at], gathered_slots[at]) {
                continue;
            }
        } else {
            n_kept += 1u;
        }
        while 0u < at && is_nearer_center(squared, slot, squares[at - 1u], gathered_slots[at - 1u]) {
            squares[at] = squares[at - 1u];
            gathered_slots[at] = gathered_slots[at - 1u];
            gathered_distances[at] = gathered_distances[at - 1u];
            at -= 1u;
        }
        squares[at] = squared;
        gathered_slots[at] = slot;
        gathered_distances[at] = distance;
    }
    n_gathered = n_kept;
}

fn is_nearer_center(squared: f32, slot: u32, other: f32, other_slot: u32) -> bool {
    return squared < other || squared == other && slot < other_slot;
}

// Returns the centre of a disc relative to a hit, in radii.
fn center_offset(slot: u32, position: vec3<f32>, radius: f32) -> vec3<f32> {
    return slot_point(slot, position).center / radius;
}

// Returns the normal of the plane through the discs' centres, on the side of `facing_normal`, which it is where the
// centres span no plane.
fn fitted_normal(position: vec3<f32>, radius: f32, facing_normal: vec3<f32>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    var covariance = Covariance(vec3<f32>(0.0), vec3<f32>(0.0));
    for (var i = 0u; i < n_gathered; i++) {
        let offset = center_offset(gathered_slots[i], position, radius);
        sum += offset;
        covariance = with_outer(covariance, offset, 1.0);
    }
    let n = f32(n_gathered);
    covariance = with_outer(covariance, sum / n, -n);
    let found = smallest_eigenvector(covariance);
    if !found.is_plane {
        return facing_normal;
    }
    return rounded_normal(flip_to_hemisphere(found.vector, facing_normal));
}

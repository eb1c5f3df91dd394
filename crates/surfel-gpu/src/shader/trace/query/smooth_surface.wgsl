// The first hits of rays on the smooth surface. The rays of a workgroup share the fits.

const MAX_NOTED: u32 = WORKGROUP_SIZE;

// A hit near a disc.
struct HitOnDisc {
    distance: f32,
    normal: vec3<f32>,
    color: vec3<f32>,
    // Slot of the nearest point.
    slot: u32,
    radius: f32,
    is_backface: u32,
}

// For each ray, the least distance of the discs near which it hits the surface, as bits, and its hit near this disc.
var<workgroup> least_distances: array<atomic<u32>, WORKGROUP_SIZE>;
var<workgroup> hits_on_discs: array<HitOnDisc, WORKGROUP_SIZE>;

// The first disc that the own ray passed, from its front where front sides are known.
var<private> passed: NearestHit;
// The own ray behind the discs that it noted, and their number.
var<private> ray_behind: Ray;
var<private> n_discs: u32;

fn surface_hit_in_group(ray: Ray, starts: bool, local_idx: u32) -> SurfaceHit {
    own_idx = local_idx;
    group_rays[own_idx] = ray;
    atomicStore(&least_distances[own_idx], NONE);
    passed = NearestHit(NO_LIMIT, NONE);
    ray_behind = ray;
    n_discs = 0u;
    var is_searching = starts;
    loop {
        let n_rays = begin_round(is_searching);
        if n_rays == 0u {
            break;
        }
        if is_searching {
            is_searching = note_discs(MAX_NOTED / n_rays);
        }
        workgroupBarrier();
        fit_near_discs();
        workgroupBarrier();
        is_searching = is_searching && atomicLoad(&least_distances[own_idx]) == NONE;
    }
    if !starts {
        return missed_surface();
    }
    return own_hit(ray);
}

// Notes the next discs on the own ray, each behind the last. Returns true if there may be more.
fn note_discs(n_wanted: u32) -> bool {
    for (var i = 0u; i < n_wanted; i++) {
        if n_discs == MAX_REJECTED_HITS {
            return false;
        }
        n_discs += 1u;
        let nearest = closest_hit(ray_behind);
        if nearest.slot == NONE {
            return false;
        }
        note_hit(nearest.distance, nearest.slot);
        let disc = slot_point(nearest.slot, vec3<f32>(0.0));
        if passed.slot == NONE && counts_as_passed(disc, ray_behind.direction) {
            passed = nearest;
        }
        ray_behind.t_min = behind_disc(nearest.distance, disc);
    }
    return true;
}

// Finds where rays hit the surface near the discs of the round.
fn fit_near_discs() {
    var hit: HitOnDisc;
    var distance_bits = NONE;
    var ray_idx = 0u;
    if own_idx < atomicLoad(&n_noted) {
        ray_idx = noted_rays[own_idx];
        let ray = group_rays[ray_idx];
        let found = hit_near_disc(ray, noted_distances[own_idx], noted_slots[own_idx]);
        if found.is_hit {
            let is_backface = select(0u, 1u, found.is_backface);
            hit = HitOnDisc(found.distance, found.normal, found.color.xyz, found.slot, found.radius, is_backface);
            // Minus zero would count as the farthest.
            distance_bits = bitcast<u32>(abs(noted_distances[own_idx]));
            atomicMin(&least_distances[ray_idx], distance_bits);
        }
    }
    workgroupBarrier();
    if distance_bits != NONE && atomicLoad(&least_distances[ray_idx]) == distance_bits {
        hits_on_discs[ray_idx] = hit;
    }
}

// Returns the hit of the own ray: that near the first disc that has one, or the disc before a slit that the ray went
// through.
fn own_hit(ray: Ray) -> SurfaceHit {
    var hit = missed_surface();
    let distance_bits = atomicLoad(&least_distances[own_idx]);
    var is_passed = passed.slot != NONE;
    if distance_bits != NONE {
        let found = hits_on_discs[own_idx];
        hit = point_hit(found.distance, found.slot, found.radius, found.normal, found.color, found.is_backface == 1u);
        is_passed = is_passed && passed.distance < bitcast<f32>(distance_bits);
    }
    if !is_passed {
        return hit;
    }
    return hit_before_slit(hit, passed.slot, passed.distance, ray);
}

//! Discs that up to sixteen rays pierce.

use super::hit::Hit;
use crate::flat::Slot;
use crate::math::{LaneMask, WIDE, Wide};
use crate::surface::MAX_GATHERED;

/// A disc and where each ray pierces it; NaN in the lanes of rays that do not.
#[derive(Clone, Copy)]
pub struct Sighting {
    pub slot: Slot,
    pub distances: [f32; WIDE],
}

impl Sighting {
    /// Of no ray.
    pub const NONE: Self = Self { slot: 0, distances: [f32::NAN; WIDE] };

    /// Of the ray in one lane.
    #[inline(always)]
    pub fn by_one(lane: usize, hit: Hit) -> Self {
        let mut distances = [f32::NAN; WIDE];
        distances[lane] = hit.distance;
        Self { slot: hit.slot, distances }
    }

    /// The lanes of the rays that pierce it.
    #[inline(always)]
    pub fn is_seen<W: Wide>(&self) -> W::Mask {
        W::load(&self.distances).less_equal(W::splat(f32::MAX))
    }
}

/// Drops what lies beyond the rays' limits and what is not among the nearest `MAX_GATHERED` of a ray, and
/// sorts by slot: sums over the rest do not depend on the way they were found.
#[inline(always)]
pub fn settle<W: Wide>(sightings: &mut Vec<Sighting>, limits: &[f32; WIDE]) {
    let limits = W::load(limits);
    let (mut n_kept, mut counts) = (0, W::splat(0.0));
    for place in 0..sightings.len() {
        let Sighting { slot, distances } = sightings[place];
        let distances = W::load(&distances);
        let is_kept = distances.less_equal(limits);
        let distances = W::select(is_kept, distances, W::splat(f32::NAN)).store();
        sightings[n_kept] = Sighting { slot, distances };
        n_kept += usize::from(is_kept.bits() != 0);
        counts = counts + W::select(is_kept, W::splat(1.0), W::splat(0.0));
    }
    sightings.truncate(n_kept);
    let is_full = W::splat(MAX_GATHERED as f32).less(counts).bits();
    if is_full != 0 {
        thin_out(sightings, is_full);
    }
    sort(sightings);
}

/// Leaves each of these lanes its nearest `MAX_GATHERED`.
#[cold]
fn thin_out(sightings: &mut [Sighting], mut lanes: u32) {
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let hits = sightings.iter().enumerate().map(|(place, sighting)| {
            (Hit { distance: sighting.distances[lane], slot: sighting.slot }, place)
        });
        let mut hits: Vec<_> = hits.filter(|(hit, _)| !hit.distance.is_nan()).collect();
        hits.sort_unstable_by_key(|(hit, _)| hit.key());
        for (_, place) in &hits[MAX_GATHERED..] {
            sightings[*place].distances[lane] = f32::NAN;
        }
    }
}

/// Few, and mostly in order: blocks are met from near to far, their points by slot.
#[inline(always)]
fn sort(sightings: &mut [Sighting]) {
    for end in 1..sightings.len() {
        let next = sightings[end];
        let mut place = end;
        while 0 < place && next.slot < sightings[place - 1].slot {
            sightings[place] = sightings[place - 1];
            place -= 1;
        }
        sightings[place] = next;
    }
}

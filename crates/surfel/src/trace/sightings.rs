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

/// Leaves each of these lanes its nearest `MAX_GATHERED`, and no sighting of no ray: what is to be sorted are
/// few, also of discs that lie thousands over each other.
#[cold]
fn thin_out(sightings: &mut Vec<Sighting>, mut lanes: u32) {
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let hits = sightings.iter().enumerate().map(|(place, sighting)| {
            (Hit { distance: sighting.distances[lane], slot: sighting.slot }, place)
        });
        let mut hits: Vec<_> = hits.filter(|(hit, _)| !hit.distance.is_nan()).collect();
        let (.., farther) = hits.select_nth_unstable_by_key(MAX_GATHERED - 1, |(hit, _)| hit.key());
        for (_, place) in farther {
            sightings[*place].distances[lane] = f32::NAN;
        }
    }
    sightings.retain(|sighting| sighting.distances.iter().any(|distance| !distance.is_nan()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Lanes, PortableLanes};

    #[test]
    fn of_thousands_each_ray_keeps_its_nearest_by_slot() {
        // A lane of rays from the front, one from behind, and one that meets only a few.
        let sighting = |slot: u32| {
            let mut distances = [f32::NAN; WIDE];
            (distances[0], distances[5]) = (slot as f32, 5000.0 - slot as f32);
            if slot % 1000 == 7 {
                distances[9] = 3.0;
            }
            Sighting { slot, distances }
        };
        // In no order: 7919 has no divisor in common with 5000.
        let mut sightings: Vec<Sighting> = (0..5000).map(|i| sighting(i * 7919 % 5000)).collect();
        settle::<<PortableLanes as Lanes>::Wide>(&mut sightings, &[f32::MAX; WIDE]);
        let slots = |lane: usize| -> Vec<u32> {
            let seen = sightings.iter().filter(|sighting| !sighting.distances[lane].is_nan());
            seen.map(|sighting| sighting.slot).collect()
        };
        assert_eq!(slots(0), (0..MAX_GATHERED as u32).collect::<Vec<_>>());
        assert_eq!(slots(5), (5000 - MAX_GATHERED as u32..5000).collect::<Vec<_>>());
        assert_eq!(slots(9), [7, 1007, 2007, 3007, 4007]);
        assert!(sightings.is_sorted_by_key(|sighting| sighting.slot) && sightings.len() < 40);
    }
}

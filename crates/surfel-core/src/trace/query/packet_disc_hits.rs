//! The discs that the rays of a packet hit.

use crate::flat::Slot;
use crate::math::{LaneMask, PACKET_WIDTH, PacketLanes, set_bits};
use crate::trace::query::hit::Hit;

/// Maximum number of discs that are sorted by insertion: moving a hit costs more than moving a key.
const MAX_INSERTION_SORT: usize = 24;

/// A disc and the distances at which the rays of a packet hit it.
#[derive(Clone, Copy)]
pub struct PacketDiscHit {
    /// The slot of the disc.
    pub slot: Slot,
    /// Distance along each ray, NaN for those that miss.
    pub distances: [f32; PACKET_WIDTH],
}

impl PacketDiscHit {
    /// A disc that no ray hits.
    pub const NONE: Self = Self { slot: 0, distances: [f32::NAN; PACKET_WIDTH] };

    /// Returns the hit of a single ray.
    #[inline(always)]
    pub fn single(lane: usize, hit: Hit) -> Self {
        let mut distances = [f32::NAN; PACKET_WIDTH];
        distances[lane] = hit.distance;
        Self { slot: hit.slot, distances }
    }

    /// Returns the mask of the rays that hit the disc.
    #[inline(always)]
    pub fn hit_mask<W: PacketLanes>(&self) -> W::Mask {
        W::load(&self.distances).le(W::splat(f32::MAX))
    }
}

/// Drops what lies beyond the rays' limits and what is not among the nearest `max_hits` of a ray, and sorts by slot: sums
/// over the rest then do not depend on the order in which they were found.
#[inline(always)]
pub fn cull_and_sort<W: PacketLanes>(
    hits: &mut Vec<PacketDiscHit>,
    limits: &[f32; PACKET_WIDTH],
    max_hits: usize,
) {
    let limits = W::load(limits);
    let (mut n_kept, mut counts) = (0, W::splat(0.0));
    for i in 0..hits.len() {
        let PacketDiscHit { slot, distances } = hits[i];
        let distances = W::load(&distances);
        let is_kept = distances.le(limits);
        let distances = W::select(is_kept, distances, W::splat(f32::NAN)).store();
        hits[n_kept] = PacketDiscHit { slot, distances };
        n_kept += usize::from(is_kept.bits() != 0);
        counts = counts + W::select(is_kept, W::splat(1.0), W::splat(0.0));
    }
    hits.truncate(n_kept);
    let is_full = W::splat(max_hits as f32).lt(counts).bits();
    if is_full != 0 {
        keep_nearest_k(hits, is_full, max_hits);
    }
    sort(hits);
}

/// Leaves each of these lanes its nearest `max_hits` hits, and drops discs that no ray hits any more: few
/// remain to be sorted, also of discs that lie thousands over each other.
#[cold]
fn keep_nearest_k(hits: &mut Vec<PacketDiscHit>, lanes: u32, max_hits: usize) {
    for lane in set_bits::<PACKET_WIDTH>(lanes) {
        let of_lane = hits
            .iter()
            .enumerate()
            .map(|(i, hit)| (Hit { distance: hit.distances[lane], slot: hit.slot }, i));
        let mut of_lane: Vec<_> = of_lane.filter(|(hit, _)| !hit.distance.is_nan()).collect();
        let (.., farther) = of_lane.select_nth_unstable_by_key(max_hits - 1, |(hit, _)| hit.key());
        for (_, i) in farther {
            hits[*i].distances[lane] = f32::NAN;
        }
    }
    hits.retain(|hit| hit.distances.iter().any(|distance| !distance.is_nan()));
}

/// Sorts by slot. The hits are mostly in order: blocks are visited from near to far, their points by slot.
#[inline(always)]
fn sort(hits: &mut Vec<PacketDiscHit>) {
    if MAX_INSERTION_SORT < hits.len() {
        return sort_by_keys(hits);
    }
    for end in 1..hits.len() {
        let next = hits[end];
        let mut i = end;
        while 0 < i && next.slot < hits[i - 1].slot {
            hits[i] = hits[i - 1];
            i -= 1;
        }
        hits[i] = next;
    }
}

/// Sorts by slot, and moves each hit only once.
fn sort_by_keys(hits: &mut Vec<PacketDiscHit>) {
    if hits.is_sorted_by_key(|hit| hit.slot) {
        return;
    }
    let key = |(i, hit): (usize, &PacketDiscHit)| u64::from(hit.slot) << 32 | i as u64;
    let mut keys: Vec<u64> = hits.iter().enumerate().map(key).collect();
    keys.sort_unstable();
    let mut sorted = Vec::with_capacity(hits.capacity());
    sorted.extend(keys.iter().map(|key| hits[*key as u32 as usize]));
    *hits = sorted;
}

#[cfg(test)]
mod tests {
    //! Each ray keeps its nearest discs, in the order of their slots.

    use super::*;
    use crate::math::{Lanes, PortableLanes};
    use crate::surface::MAX_GATHERED;

    #[test]
    fn each_ray_keeps_its_nearest_of_thousands_of_discs() {
        // Lane 0 looks from the front, lane 5 from behind, and lane 9 hits only a few discs.
        let disc_hit = |slot: u32| {
            let mut distances = [f32::NAN; PACKET_WIDTH];
            (distances[0], distances[5]) = (slot as f32, 5000.0 - slot as f32);
            if slot % 1000 == 7 {
                distances[9] = 3.0;
            }
            PacketDiscHit { slot, distances }
        };
        // The order is a permutation: 7919 and 5000 are coprime.
        let mut hits: Vec<PacketDiscHit> = (0..5000).map(|i| disc_hit(i * 7919 % 5000)).collect();
        cull_and_sort::<<PortableLanes as Lanes>::PacketLanes>(
            &mut hits,
            &[f32::MAX; PACKET_WIDTH],
            MAX_GATHERED,
        );
        let slots = |lane: usize| -> Vec<u32> {
            let of_lane = hits.iter().filter(|hit| !hit.distances[lane].is_nan());
            of_lane.map(|hit| hit.slot).collect()
        };
        assert_eq!(slots(0), (0..MAX_GATHERED as u32).collect::<Vec<_>>());
        assert_eq!(slots(5), (5000 - MAX_GATHERED as u32..5000).collect::<Vec<_>>());
        assert_eq!(slots(9), [7, 1007, 2007, 3007, 4007]);
        assert!(hits.is_sorted_by_key(|hit| hit.slot) && hits.len() < 40);
    }
}

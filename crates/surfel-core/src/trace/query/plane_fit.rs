//! Planes through the centres of the discs nearest to a hit, for sixteen rays at once.

use crate::math::{
    CovarianceLanes, LaneMask, PACKET_WIDTH, PacketLanes, Vec3, Vec3Lanes, rounded_normal, set_bits,
};
use crate::surface::{MAX_GATHERED, Surfel};
use crate::trace::counts::{Counted, count};
use crate::trace::query::edge_test::lane_mask;
use crate::trace::query::packet_disc_hits::PacketDiscHit;

/// Distance behind a rejected crossing, and behind the first point without one, at which a search goes on, in radii.
const BEHIND_CROSSING: f32 = 0.125;
const MIN_RESTART: f32 = 0.25;
/// Number of places at which the hits' nearest discs are counted, before those of each ray are sorted.
const MAX_COUNTS: usize = 12;

/// Positions of hits and their discs, one ray per lane: `discs[i]` is that of `hits[i]`.
pub struct FittedDiscs<'d, W> {
    /// The discs.
    pub discs: &'d mut Vec<Surfel>,
    /// Their distances along the rays.
    pub hits: &'d mut Vec<PacketDiscHit>,
    /// Positions of the nearest hits.
    pub position: Vec3Lanes<W>,
    /// Reciprocals of the radii of the nearest discs.
    pub per_radius: W,
}

impl<W: PacketLanes> FittedDiscs<'_, W> {
    /// Returns the centre of a disc relative to the hits, in radii.
    #[inline(always)]
    fn offset(&self, disc: &Surfel) -> Vec3Lanes<W> {
        Vec3Lanes::splat(disc.center).minus(self.position).scaled(self.per_radius)
    }

    /// Leaves each ray the `MAX_GATHERED` discs whose centres are nearest to its hit. The first of equally near ones
    /// count. Discs that no ray is left are dropped.
    #[inline(always)]
    pub fn keep_nearest(&mut self) {
        let none = W::splat(f32::NAN);
        // A loop, not a closure: code that `collect` calls is not compiled for the wider vectors.
        let mut squared: Vec<[f32; PACKET_WIDTH]> = Vec::with_capacity(self.discs.len());
        for (disc, hit) in self.discs.iter().zip(&*self.hits) {
            let offset = self.offset(disc);
            squared.push(W::select(hit.hit_mask::<W>(), offset.dot(offset), none).store());
        }
        let Limits { limits, ties } = limits_of_nearest::<W>(&squared);
        for lane in set_bits::<PACKET_WIDTH>(ties) {
            self.keep_nearest_of_lane(&squared, lane);
        }
        let mut n_kept = 0;
        for (i, squared) in squared.iter().enumerate() {
            let distances = W::load(&self.hits[i].distances);
            let distances = W::select(W::load(squared).le(limits), distances, none);
            self.hits[n_kept] =
                PacketDiscHit { slot: self.hits[i].slot, distances: distances.store() };
            self.discs[n_kept] = self.discs[i];
            n_kept += usize::from(distances.le(W::splat(f32::MAX)).bits() != 0);
        }
        self.hits.truncate(n_kept);
        self.discs.truncate(n_kept);
    }

    /// Leaves one ray its nearest discs.
    #[cold]
    fn keep_nearest_of_lane(&mut self, squared: &[[f32; PACKET_WIDTH]], lane: usize) {
        let squared = squared.iter().map(|squared| squared[lane]).enumerate();
        // The bits of positive floats have the order of the floats.
        let key = |(i, squared): (usize, f32)| u64::from(squared.to_bits()) << 32 | i as u64;
        let mut keys: Vec<u64> =
            squared.filter(|(_, squared)| !squared.is_nan()).map(key).collect();
        let (.., farther) = keys.select_nth_unstable(MAX_GATHERED - 1);
        for key in farther {
            self.hits[*key as u32 as usize].distances[lane] = f32::NAN;
        }
    }

    /// Returns planes through the discs' centres, whose normals are on the side of `facing`, which they are where the
    /// centres span no plane.
    #[inline(always)]
    pub fn planes(&self, facing: Vec3Lanes<W>) -> FittedPlanes<W> {
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        count(Counted::Terms, PACKET_WIDTH * self.hits.len());
        let (mut weight, mut sum) = (zero, Vec3Lanes::splat(Vec3::ZERO));
        let mut covariance = CovarianceLanes::zero();
        for (disc, hit) in self.discs.iter().zip(&*self.hits) {
            let own = W::select(hit.hit_mask::<W>(), one, zero);
            let offset = self.offset(disc);
            weight = weight + own;
            sum = sum.plus(offset.scaled(own));
            covariance.add_outer(offset, own);
        }
        let middle = sum.scaled(one / weight);
        covariance.add_outer(sum.scaled(one / weight), zero - weight);
        let (normal, is_plane) = covariance.smallest_eigenvector();
        let is_away = normal.dot(facing).lt(zero);
        let normal = normal.scaled(W::select(is_away, zero - one, one));
        FittedPlanes { normal: Vec3Lanes::select(is_plane, rounded_normal(normal), facing), middle }
    }
}

/// Squared distances within which the nearest discs of rays lie.
struct Limits<W> {
    /// Limits, infinite in lanes with few discs.
    limits: W,
    /// Lanes for which none was found, because discs are equally near or nearly so.
    ties: u32,
}

/// Finds the limits of the `MAX_GATHERED` least of squared distances, NaN for those that do not count. The discs of evenly
/// spaced points grow in number as the square does, so that the first guess is close.
#[inline(always)]
fn limits_of_nearest<W: PacketLanes>(squared: &[[f32; PACKET_WIDTH]]) -> Limits<W> {
    let (zero, one, wanted) = (W::splat(0.0), W::splat(1.0), W::splat(MAX_GATHERED as f32));
    let (mut low, mut n_low) = (zero, zero);
    let (mut high, mut n_high) = (zero, zero);
    for squared in squared {
        let squared = W::load(squared);
        let counts = squared.le(W::splat(f32::MAX));
        n_high = n_high + W::select(counts, one, zero);
        high = W::select(counts & high.lt(squared), squared, high);
    }
    let mut limits = W::splat(f32::INFINITY);
    let mut open = wanted.lt(n_high).bits();
    for _ in 0..MAX_COUNTS {
        if open == 0 {
            break;
        }
        let fraction = (wanted + W::splat(0.5) - n_low) / (n_high - n_low);
        let fraction = fraction.max(W::splat(0.05)).min(W::splat(0.95));
        let guess = low + (high - low) * fraction;
        let mut n = zero;
        for squared in squared {
            n = n + W::select(W::load(squared).le(guess), one, zero);
        }
        let found = open & (n.le(wanted) & wanted.le(n)).bits();
        limits = W::select(lane_mask::<W>(found), guess, limits);
        open &= !found;
        let is_low = n.lt(wanted);
        (low, n_low) = (W::select(is_low, guess, low), W::select(is_low, n, n_low));
        (high, n_high) = (W::select(is_low, high, guess), W::select(is_low, n_high, n));
    }
    Limits { limits, ties: open }
}

/// Planes near the hits of rays, one per lane.
pub struct FittedPlanes<W> {
    /// Unit normals.
    pub normal: Vec3Lanes<W>,
    /// A position on each plane relative to the hit, in radii.
    middle: Vec3Lanes<W>,
}

/// Distances from hits to the places where rays cross planes.
pub struct PlaneCrossing<W> {
    /// Distances along the rays, in radii.
    pub step: W,
    /// Lanes of the rays that cross their plane near the hit.
    pub lanes: u32,
    /// Distances along the rays, in radii, from which on the surface may be crossed if it is not at `step`.
    pub restart: W,
}

impl<W: PacketLanes> FittedPlanes<W> {
    /// Returns where rays cross the planes, at most a radius away.
    #[inline(always)]
    pub fn crossing(&self, direction: Vec3Lanes<W>) -> PlaneCrossing<W> {
        let step = self.normal.dot(self.middle) / self.normal.dot(direction);
        // A ray along its plane gives NaN or infinity, and fails the test.
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let is_near = step.abs().le(one);
        let step = W::select(is_near | one.lt(step), step, zero);
        // Points are met long before a plane at a slant: the next ones are those around its crossing.
        let behind = step + W::splat(BEHIND_CROSSING);
        let restart = W::select(is_near, behind, (step - one).min(one));
        PlaneCrossing {
            step: W::select(is_near, step, zero),
            lanes: is_near.bits(),
            restart: restart.max(W::splat(MIN_RESTART)),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Each ray keeps the discs that sorting finds.

    use super::*;
    use crate::math::{Lanes, PortableLanes, Random};

    type Wide = <PortableLanes as Lanes>::PacketLanes;

    /// Distances of which some are missing and, in lane 3, many equal.
    fn distances(n: usize, seed: u64) -> Vec<[f32; PACKET_WIDTH]> {
        let mut random = Random::new(seed, 0);
        let mut row = || {
            std::array::from_fn(|lane| match random.next_f32() {
                value if value < 0.2 => f32::NAN,
                value if lane == 3 => (4.0 * value).round(),
                value => value,
            })
        };
        (0..n).map(|_| row()).collect()
    }

    #[test]
    fn limits_leave_the_nearest() {
        for (n, seed) in [(0, 1), (10, 2), (19, 3), (40, 4), (128, 5)] {
            let squared = distances(n, seed);
            let Limits { limits, ties } = limits_of_nearest::<Wide>(&squared);
            let limits = limits.store();
            for lane in 0..PACKET_WIDTH {
                let all = squared.iter().map(|row| row[lane]).filter(|value| !value.is_nan());
                let mut all: Vec<f32> = all.collect();
                all.sort_by(f32::total_cmp);
                let is_open = ties >> lane & 1 == 1;
                assert!(!is_open || lane == 3, "{n} {lane}");
                if !is_open {
                    let kept = all.iter().filter(|value| **value <= limits[lane]).count();
                    assert_eq!(kept, all.len().min(MAX_GATHERED), "{n} {lane}");
                }
            }
        }
    }
}

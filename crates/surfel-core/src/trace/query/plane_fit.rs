//! Planes through the centres of the discs nearest to a hit, for sixteen rays at once.

use crate::math::{
    CovarianceLanes, LaneMask, PACKET_WIDTH, PacketLanes, Vec3, Vec3Lanes, rounded_normal, set_bits,
};
use crate::surface::{MAX_GATHERED, Surfel};
use crate::trace::query::packet_disc_hits::PacketDiscHit;

/// Positions of hits and their discs, one ray per lane: `discs[i]` is that of `hits[i]`.
pub struct FittedDiscs<'d, W> {
    /// The discs.
    pub discs: &'d [Surfel],
    /// Their distances along the rays.
    pub hits: &'d mut [PacketDiscHit],
    /// Positions of the nearest hits.
    pub position: Vec3Lanes<W>,
    /// Radii of the nearest discs.
    pub radius: W,
}

impl<W: PacketLanes> FittedDiscs<'_, W> {
    /// Returns the centre of a disc relative to the hits, in radii.
    #[inline(always)]
    fn offset(&self, disc: &Surfel) -> Vec3Lanes<W> {
        let per_radius = W::splat(1.0) / self.radius;
        Vec3Lanes::splat(disc.center).minus(self.position).scaled(per_radius)
    }

    /// Leaves each ray the `MAX_GATHERED` discs whose centres are nearest to its hit. The first of equally near ones
    /// count.
    #[inline(always)]
    pub fn keep_nearest(&mut self) {
        let mut counts = W::splat(0.0);
        for hit in &*self.hits {
            counts = counts + W::select(hit.hit_mask::<W>(), W::splat(1.0), W::splat(0.0));
        }
        let full = W::splat(MAX_GATHERED as f32).lt(counts).bits();
        if full == 0 {
            return;
        }
        let squared = self.discs.iter().map(|disc| {
            let offset = self.offset(disc);
            offset.dot(offset).store()
        });
        let squared: Vec<[f32; PACKET_WIDTH]> = squared.collect();
        let mut keys = Vec::with_capacity(self.discs.len());
        for lane in set_bits::<PACKET_WIDTH>(full) {
            keys.clear();
            for (i, (hit, squared)) in self.hits.iter().zip(&squared).enumerate() {
                if !hit.distances[lane].is_nan() {
                    // The bits of positive floats have the order of the floats.
                    keys.push(u64::from(squared[lane].to_bits()) << 32 | i as u64);
                }
            }
            let (.., farther) = keys.select_nth_unstable(MAX_GATHERED - 1);
            for key in farther {
                self.hits[*key as u32 as usize].distances[lane] = f32::NAN;
            }
        }
    }

    /// Returns the normals of planes through the discs' centres, on the side of `facing`, which they are where the centres
    /// span no plane.
    #[inline(always)]
    pub fn normals(&self, facing: Vec3Lanes<W>) -> Vec3Lanes<W> {
        let (zero, one) = (W::splat(0.0), W::splat(1.0));
        let (mut weight, mut sum) = (zero, Vec3Lanes::splat(Vec3::ZERO));
        let mut covariance = CovarianceLanes::zero();
        for (disc, hit) in self.discs.iter().zip(&*self.hits) {
            let own = W::select(hit.hit_mask::<W>(), one, zero);
            let offset = self.offset(disc);
            weight = weight + own;
            sum = sum.plus(offset.scaled(own));
            covariance.add_outer(offset, own);
        }
        covariance.add_outer(sum.scaled(one / weight), zero - weight);
        let (normal, is_plane) = covariance.smallest_eigenvector();
        let is_away = normal.dot(facing).lt(zero);
        let normal = normal.scaled(W::select(is_away, zero - one, one));
        Vec3Lanes::select(is_plane, rounded_normal(normal), facing)
    }
}

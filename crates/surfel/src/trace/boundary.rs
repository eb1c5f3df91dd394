//! The points around a hit, collected for the angular-gap test.

use super::traverse::around;
use crate::flat::FlatPoints;
use crate::math::{LANES, LaneMask, Lanes, Vec3, Vec3Lanes};
use crate::surface::{
    Candidate, MAX_NEIGHBORS, NEIGHBOR_REACH, Neighbor, Surroundings, surroundings,
};
use std::ops::ControlFlow;

/// Judges a hit at `position` by all points near it.
#[inline(always)]
pub fn judge<L: Lanes>(points: &FlatPoints, position: Vec3, hit: &Candidate) -> Surroundings {
    let mut neighbors = [Neighbor::NONE; MAX_NEIGHBORS];
    let mut n = 0;
    let reach = NEIGHBOR_REACH * hit.radius;
    around::<L>(points, position, reach, |points, block_idx| {
        let block = &points.blocks[block_idx as usize];
        let centers: Vec3Lanes<L> = block.centers(position);
        let near =
            centers.dot(centers).less_equal(L::splat(reach * reach)).bits() & block.occupied();
        if near == 0 {
            return ControlFlow::Continue(());
        }
        let (offsets, normals) = (centers.store(), block.normals::<L>().store());
        for lane in (0..LANES).filter(|lane| near >> lane & 1 == 1) {
            if n == MAX_NEIGHBORS {
                return ControlFlow::Break(());
            }
            neighbors[n] = Neighbor { offset: offsets[lane], normal: normals[lane] };
            n += 1;
        }
        ControlFlow::Continue(())
    });
    surroundings(hit, &neighbors[..n])
}

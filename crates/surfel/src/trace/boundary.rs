//! The points around a hit, collected for the angular-gap test.

use super::traverse::around;
use crate::flat::FlatPoints;
use crate::math::{LANES, LaneMask, Lanes, Vec3, Vec3Lanes};
use crate::surface::{MAX_NEIGHBORS, NEIGHBOR_REACH, Surroundings, surroundings};
use std::ops::ControlFlow;

/// Judges a hit by all points near it.
#[inline(always)]
pub fn judge<L: Lanes>(
    points: &FlatPoints,
    position: Vec3,
    normal: Vec3,
    radius: f32,
) -> Surroundings {
    let mut offsets = [Vec3::ZERO; MAX_NEIGHBORS];
    let mut n = 0;
    let reach = NEIGHBOR_REACH * radius;
    around::<L>(points, position, reach, |points, block_idx| {
        let block = &points.blocks[block_idx as usize];
        let centers: Vec3Lanes<L> = block.centers(position);
        let near =
            centers.dot(centers).less_equal(L::splat(reach * reach)).bits() & block.occupied();
        let (x, y, z) = (centers.x.store(), centers.y.store(), centers.z.store());
        for lane in (0..LANES).filter(|lane| near >> lane & 1 == 1) {
            if n == MAX_NEIGHBORS {
                return ControlFlow::Break(());
            }
            offsets[n] = Vec3::new(x[lane], y[lane], z[lane]);
            n += 1;
        }
        ControlFlow::Continue(())
    });
    surroundings(normal, radius, &offsets[..n])
}

//! The points around a hit, shown to the angular-gap test.

use super::traverse::{BallVisitor, around};
use crate::flat::FlatPoints;
use crate::math::{LaneMask, Lanes, Vec3, Vec3Lanes};
use crate::surface::{Candidate, Judgement, NEIGHBOR_REACH, Surroundings};
use std::ops::ControlFlow;

/// A neighbourhood with too few points to judge by is looked at once more this many times as wide.
const WIDER: f32 = 2.0;

/// Judges a hit at `position` by all points near it.
#[inline(always)]
pub fn judge<L: Lanes>(points: &FlatPoints, position: Vec3, hit: &Candidate) -> Judgement {
    let found = look_around::<L>(points, position, *hit);
    if !found.is_sparse() {
        return found.judge();
    }
    look_around::<L>(points, position, Candidate { radius: WIDER * hit.radius, ..*hit }).judge()
}

#[inline(always)]
fn look_around<L: Lanes>(points: &FlatPoints, position: Vec3, hit: Candidate) -> Surroundings {
    let reach = NEIGHBOR_REACH * hit.radius;
    let mut found = Neighborhood { position, reach, surroundings: Surroundings::new(hit) };
    around::<L>(points, position, reach, &mut found);
    found.surroundings
}

struct Neighborhood {
    position: Vec3,
    reach: f32,
    surroundings: Surroundings,
}

impl BallVisitor for Neighborhood {
    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let block = &points.blocks[block_idx as usize];
        let centers: Vec3Lanes<L> = block.centers(self.position);
        let reach_squared = L::splat(self.reach * self.reach);
        let near = centers.dot(centers).less_equal(reach_squared).bits();
        let mut near = if near == 0 { 0 } else { near & u32::from(block.occupied()) };
        if near == 0 {
            return ControlFlow::Continue(());
        }
        let (offsets, normals) = (centers.store(), block.normals::<L>().store());
        while near != 0 {
            let lane = near.trailing_zeros() as usize;
            near &= near - 1;
            self.surroundings.add(offsets[lane], normals[lane]);
        }
        ControlFlow::Continue(())
    }
}

//! Points that have moved: the same tree with new boxes, unless it would be slow.

use super::block::PointBlock;
use super::points::FlatPoints;
use super::source::{Source, fits};
use crate::bvh::NO_PRIMITIVE;
use crate::error::Result;
use crate::math::LANES;
use crate::points::PointCloud;
use crate::surface::SurfaceKind;
use rayon::prelude::*;

/// A tree that costs more than this times what it cost when built is unfit.
///
/// Twisted clouds of 173 thousand and 1 million points: at a ratio of 1.06 a ray takes 1.06 to 1.14
/// times as long as in a tree built anew, at 1.3 it takes 1.28 to 1.44 times, at 2.1 to 2.5 it takes
/// 2.2 times. To build takes four times as long as to refit: at 1.3, a million points pay that back
/// with the first million rays.
pub const REBUILD_COST: f64 = 1.3;

/// What became of a tree whose points have moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refit {
    /// The boxes were fitted anew; the tree costs so many times what it cost when built.
    Kept { cost_ratio: f64 },
    /// The tree has to be built anew. What was refitted is of use for nothing but to be refitted again.
    Unfit,
}

impl Refit {
    pub(super) fn of(cost_ratio: f64) -> Self {
        if cost_ratio <= REBUILD_COST { Self::Kept { cost_ratio } } else { Self::Unfit }
    }
}

impl FlatPoints {
    /// Moves the points to where `cloud`, of as many points in the same order, now has them.
    ///
    /// Kind and colors are those of `new`, as is the result for points that have not moved. The tree
    /// is unfit if its cost exceeds `REBUILD_COST`, if a block is no longer precise enough for its points,
    /// or if other points than before can be hit. What comes out depends on the tree and on `cloud` alone,
    /// not on where the points were in between.
    pub fn refit(
        &mut self,
        cloud: &PointCloud,
        kind: SurfaceKind,
        colors: &[[u8; 3]],
    ) -> Result<Refit> {
        let source = Source::new(cloud, kind, colors)?;
        let is_same_set = self.n_points() == source.n_solid();
        if !(is_same_set && self.encode_again(&source)) {
            return Ok(Refit::Unfit);
        }
        Ok(Refit::of(self.fit_boxes(kind) / self.cost))
    }

    fn n_points(&self) -> usize {
        self.ids.par_iter().filter(|&&id| id != NO_PRIMITIVE).count()
    }

    /// Returns whether all blocks can hold their points as they are now.
    fn encode_again(&mut self, source: &Source) -> bool {
        let (ids, _) = self.ids.as_chunks::<LANES>();
        let encode = |(block, ids): (&mut PointBlock, &[u32; LANES])| {
            let members = source.points(ids);
            let points = members.as_slice();
            *block = PointBlock::new(points);
            points.iter().all(|point| source.is_solid(point))
                && fits(source.kind, points.iter().map(|point| (point.position, point.radius)))
        };
        self.blocks.par_iter_mut().zip(ids).map(encode).reduce(|| true, |a, b| a & b)
    }
}

//! The tree's search around all its points, leaf by leaf: points of one leaf share their way through the tree.

use super::found::{Found, Nearest, Within};
use super::knn::{LANES, Subtree, Target, Tree};
use super::surroundings::Surroundings;
use super::{Index, Neighbor};
use crate::error::Result;
use crate::math::{Aabb, Vec3};
use crate::progress::Progress;
use std::ops::Range;

pub(super) struct NearestOfAll<'a> {
    pub tree: &'a Tree<'a>,
    pub k: usize,
}

pub(super) struct WithinOfAll<'a> {
    pub tree: &'a Tree<'a>,
    pub distance_squared: f32,
}

impl Index for NearestOfAll<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn run_length(&self) -> usize {
        128 * LANES
    }

    fn visit_run(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut found = Nearest::new(self.k.min(self.tree.n_points));
        let mut neighbors = Vec::new();
        let mut siblings = Vec::with_capacity(32);
        let mut surroundings = Surroundings::new();
        let mut known = Vec::with_capacity(LANES);
        for leaf in leaves(&slots) {
            progress.check()?;
            self.tree.siblings(leaf, &mut siblings);
            let bounds = self.tree.bounds_of_leaf(leaf);
            let limits = known.iter().map(|sphere: &Sphere| sphere.limit_over(bounds));
            let leaf_limit = limits.fold(f32::INFINITY, f32::min);
            let listed = leaf_limit < f32::INFINITY
                && surroundings.list(self.tree, &siblings, bounds, leaf_limit);
            known.clear();
            for target in self.tree.targets(leaf, &slots) {
                let limit = known.last().map_or(leaf_limit, |last| last.limit_at(target.position));
                found.bound(limit.min(leaf_limit));
                self.tree.scan(leaf, &target, &mut found);
                if listed {
                    surroundings.search(self.tree, &target, &mut found);
                } else {
                    search(self.tree, &siblings, &target, &mut found);
                }
                known.push(Sphere { center: target.position, radius_squared: found.limit() });
                found.finish(&mut neighbors);
                visit(target.own, &neighbors);
            }
        }
        Ok(())
    }
}

impl Index for WithinOfAll<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn run_length(&self) -> usize {
        128 * LANES
    }

    fn visit_run(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut found = Within::new(self.distance_squared);
        let mut neighbors = Vec::new();
        let mut siblings = Vec::with_capacity(32);
        let mut surroundings = Surroundings::new();
        for leaf in leaves(&slots) {
            progress.check()?;
            self.tree.siblings(leaf, &mut siblings);
            let bounds = self.tree.bounds_of_leaf(leaf);
            let listed = surroundings.list(self.tree, &siblings, bounds, self.distance_squared);
            for target in self.tree.targets(leaf, &slots) {
                self.tree.scan(leaf, &target, &mut found);
                if listed {
                    surroundings.search(self.tree, &target, &mut found);
                } else {
                    search(self.tree, &siblings, &target, &mut found);
                }
                found.finish(&mut neighbors);
                visit(target.own, &neighbors);
            }
        }
        Ok(())
    }
}

fn leaves(slots: &Range<usize>) -> Range<u32> {
    (slots.start / LANES) as u32..slots.end.div_ceil(LANES) as u32
}

/// The k nearest points of its center are in it: so they are in a larger one about any place nearby.
struct Sphere {
    center: Vec3,
    radius_squared: f32,
}

impl Sphere {
    /// Squared distance from `position` within which k points are.
    fn limit_at(&self, position: Vec3) -> f32 {
        self.limit(self.center.distance(position))
    }

    /// The same for all positions in a box.
    fn limit_over(&self, bounds: Aabb) -> f32 {
        let farthest = (bounds.max - self.center).max(self.center - bounds.min);
        self.limit(farthest.length())
    }

    /// The factor and the term stand above all rounding, that of squares too small for f32 included.
    fn limit(&self, away: f32) -> f32 {
        let reach = self.radius_squared.sqrt() + away;
        1.0001 * reach * reach + 1e-37
    }
}

/// The tree but for the own leaf, from near to far.
fn search(tree: &Tree, siblings: &[Subtree], target: &Target, found: &mut impl Found) {
    for &sibling in siblings.iter().rev() {
        tree.descend(sibling, target, found);
    }
}

impl Tree<'_> {
    fn bounds_of_leaf(&self, leaf: u32) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        let block = &self.leaves[leaf as usize];
        for lane in 0..LANES.min(self.n_points - leaf as usize * LANES) {
            bounds = bounds.including(block.target(lane).position);
        }
        bounds
    }

    /// The points of a leaf, which the runs before and after leave whole.
    fn targets(&self, leaf: u32, slots: &Range<usize>) -> impl Iterator<Item = Target> + use<> {
        let block = self.leaves[leaf as usize];
        (0..LANES.min(slots.end - leaf as usize * LANES)).map(move |lane| block.target(lane))
    }
}

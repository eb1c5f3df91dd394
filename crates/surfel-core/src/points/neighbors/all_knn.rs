//! Neighbours of all points of a tree, leaf by leaf: the points of a leaf share the traversal of the tree.

use super::candidate_set::{CandidateSet, KNearest, MANY, ManyNearest, NearestSet, WithinDistance};
use super::kd_tree::{KdTree, LANES, Subtree, Target};
use super::nearby_leaves::NearbyLeaves;
use super::neighbor::{Neighbor, Neighborhood, checked_square};
use super::neighbor_index::{NeighborIndex, Visited, visit_in_blocks};
use crate::error::{Error, Result};
use crate::math::{Aabb, Vec3};
use crate::progress::Progress;
use std::ops::Range;

/// Finds the k nearest neighbours of all points.
struct AllKnn<'a> {
    tree: &'a KdTree<'a>,
    k: usize,
}

/// Finds the neighbours within a distance of all points.
struct AllWithinDistance<'a> {
    tree: &'a KdTree<'a>,
    distance_squared: f32,
}

impl NeighborIndex for AllKnn<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn chunk_size(&self) -> usize {
        128 * LANES
    }

    fn visit_slots(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let k = self.k.min(self.tree.n_points);
        if k < MANY {
            self.visit_with(KNearest::new(k), slots, progress, visit)
        } else {
            self.visit_with(ManyNearest::new(k), slots, progress, visit)
        }
    }
}

impl AllKnn<'_> {
    /// Calls `visit` with the neighbours of each point in `slots`, which are collected in `candidates`.
    fn visit_with(
        &self,
        mut candidates: impl NearestSet,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut neighbors = Vec::new();
        let mut siblings = Vec::with_capacity(32);
        let mut nearby_leaves = NearbyLeaves::new();
        let mut spheres = Vec::with_capacity(LANES);
        for leaf in leaves(&slots) {
            progress.check()?;
            self.tree.siblings(leaf, &mut siblings);
            let bounds = self.tree.bounds_of_leaf(leaf);
            let limits = spheres.iter().map(|sphere: &KnnSphere| sphere.limit_over(bounds));
            let leaf_limit = limits.fold(f32::INFINITY, f32::min);
            let is_listed = leaf_limit < f32::INFINITY
                && nearby_leaves.collect(self.tree, &siblings, bounds, leaf_limit);
            spheres.clear();
            for target in self.tree.targets(leaf, &slots) {
                let limit =
                    spheres.last().map_or(leaf_limit, |last| last.limit_at(target.position));
                candidates.limit_to(limit.min(leaf_limit));
                self.tree.scan(leaf, &target, &mut candidates);
                if is_listed {
                    nearby_leaves.search(self.tree, &target, &mut candidates);
                } else {
                    search(self.tree, &siblings, &target, &mut candidates);
                }
                candidates.drain_sorted(&mut neighbors);
                spheres.push(KnnSphere::new(target.position, &neighbors, self.k));
                visit(target.own, &neighbors);
            }
        }
        Ok(())
    }
}

impl NeighborIndex for AllWithinDistance<'_> {
    fn n_slots(&self) -> usize {
        self.tree.n_points
    }

    fn chunk_size(&self) -> usize {
        128 * LANES
    }

    fn visit_slots(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        mut visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()> {
        let mut candidates = WithinDistance::new(self.distance_squared);
        let mut neighbors = Vec::new();
        let mut siblings = Vec::with_capacity(32);
        let mut nearby_leaves = NearbyLeaves::new();
        for leaf in leaves(&slots) {
            progress.check()?;
            self.tree.siblings(leaf, &mut siblings);
            let bounds = self.tree.bounds_of_leaf(leaf);
            let is_listed =
                nearby_leaves.collect(self.tree, &siblings, bounds, self.distance_squared);
            for target in self.tree.targets(leaf, &slots) {
                self.tree.scan(leaf, &target, &mut candidates);
                if is_listed {
                    nearby_leaves.search(self.tree, &target, &mut candidates);
                } else {
                    search(self.tree, &siblings, &target, &mut candidates);
                }
                candidates.drain_sorted(&mut neighbors);
                visit(target.own, &neighbors);
            }
        }
        Ok(())
    }
}

fn leaves(slots: &Range<usize>) -> Range<u32> {
    (slots.start / LANES) as u32..slots.end.div_ceil(LANES) as u32
}

/// A sphere with the k nearest points of its centre. A larger sphere about any nearby position contains them too.
struct KnnSphere {
    center: Vec3,
    radius_squared: f32,
}

impl KnnSphere {
    /// Returns the sphere about a position with these neighbours, which is infinite if there are fewer than k.
    fn new(center: Vec3, neighbors: &[Neighbor], k: usize) -> Self {
        let farthest = neighbors.get(k - 1);
        let radius_squared = farthest.map_or(f32::INFINITY, |farthest| farthest.distance_squared);
        Self { center, radius_squared }
    }

    /// Returns a squared distance from `position` within which there are k points.
    fn limit_at(&self, position: Vec3) -> f32 {
        self.limit(self.center.distance(position))
    }

    /// Returns a squared distance within which there are k points, for all positions in a box.
    fn limit_over(&self, bounds: Aabb) -> f32 {
        let farthest = (bounds.max - self.center).max(self.center - bounds.min);
        self.limit(farthest.length())
    }

    /// Returns the squared radius of a sphere about a position at `distance` from the centre. The factor and the term
    /// exceed all rounding errors, those of squares too small for f32 included.
    fn limit(&self, distance: f32) -> f32 {
        let radius = self.radius_squared.sqrt() + distance;
        1.0001 * radius * radius + 1e-37
    }
}

/// Searches the tree without the target's own leaf, from near to far.
fn search(
    tree: &KdTree,
    siblings: &[Subtree],
    target: &Target,
    candidates: &mut impl CandidateSet,
) {
    for &sibling in siblings.iter().rev() {
        tree.search(sibling, target, candidates);
    }
}

impl KdTree<'_> {
    /// Returns `visit(point, neighbours)` of every point, in the order of the points. Neighbours come nearest first.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a neighbourhood out of range and [`Error::Cancelled`] if `progress` is cancelled.
    pub fn map<T: Copy + Default + Send + Sync>(
        &self,
        neighborhood: Neighborhood,
        progress: &dyn Progress,
        visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
    ) -> Result<Vec<T>> {
        let mut values = vec![T::default(); self.positions().len()];
        let store = |visited: Visited<T>| visited.scatter(&mut values, |value| *value);
        self.visit_in_blocks(neighborhood, progress, visit, store)?;
        Ok(values)
    }

    /// Passes `visit(point, neighbours)` of every point to `store`, many points at a time. Neighbours come nearest first.
    ///
    /// # Errors
    ///
    /// Fails as [`Self::map`] does.
    pub(crate) fn visit_in_blocks<T: Send + Sync>(
        &self,
        neighborhood: Neighborhood,
        progress: &dyn Progress,
        visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
        store: impl FnMut(Visited<T>),
    ) -> Result<()> {
        match neighborhood {
            Neighborhood::Nearest(0) => Err(Error::Setting {
                name: "number of neighbours",
                found: "0".to_owned(),
                expected: "at least 1",
            }),
            Neighborhood::Nearest(k) => {
                visit_in_blocks(&AllKnn { tree: self, k }, self.positions(), progress, visit, store)
            }
            Neighborhood::Within(distance) => {
                let distance_squared = checked_square(distance)?;
                visit_in_blocks(
                    &AllWithinDistance { tree: self, distance_squared },
                    self.positions(),
                    progress,
                    visit,
                    store,
                )
            }
        }
    }

    fn bounds_of_leaf(&self, leaf: u32) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        let block = &self.leaves[leaf as usize];
        for lane in 0..LANES.min(self.n_points - leaf as usize * LANES) {
            bounds = bounds.including(block.target(lane).position);
        }
        bounds
    }

    /// Returns the points of a leaf as targets. Chunks begin and end at leaves.
    fn targets(&self, leaf: u32, slots: &Range<usize>) -> impl Iterator<Item = Target> + use<> {
        let block = self.leaves[leaf as usize];
        (0..LANES.min(slots.end - leaf as usize * LANES)).map(move |lane| block.target(lane))
    }
}

//! Recomputes the boxes of nodes from the blocks up, after building and after primitives have moved.

use super::node::{BvhNode, Child};
use crate::math::{Aabb, LANES};
use rayon::prelude::*;

/// Minimum number of nodes of a subtree that several threads share.
const MIN_PARALLEL: usize = 1024;

/// Computes the boxes of all nodes from the bounding boxes of the blocks. Returns the tree's cost: the expected
/// number of nodes and blocks that a random ray through the root's box visits.
pub fn refit_boxes(nodes: &mut [BvhNode], block_bounds: impl Fn(u32) -> Aabb + Sync) -> f64 {
    let Some((root, below)) = nodes.split_first_mut() else { return 0.0 };
    let subtree = refit_subtree(root, below, &block_bounds);
    subtree.area / f64::from(subtree.bounds.half_area()).max(f64::MIN_POSITIVE)
}

#[derive(Clone, Copy)]
struct SubtreeBounds {
    bounds: Aabb,
    /// Sum of the half areas of all boxes below the subtree's root.
    area: f64,
}

/// Recomputes the boxes of a subtree. `below` holds the nodes below `node`: its children, then the descendants of
/// each child.
fn refit_subtree(
    node: &mut BvhNode,
    below: &mut [BvhNode],
    block_bounds: &(impl Fn(u32) -> Aabb + Sync),
) -> SubtreeBounds {
    let is_large = MIN_PARALLEL <= below.len();
    let (children, rest) = below.split_at_mut(node.n_child_nodes());
    let mut reversed = [SubtreeBounds { bounds: Aabb::EMPTY, area: 0.0 }; LANES];
    let subtrees = reversed.iter_mut().zip(subtrees_from_last(children, rest));
    if is_large {
        let subtrees: Vec<_> = subtrees.collect();
        subtrees.into_par_iter().for_each(|(bounds, (child, below))| {
            *bounds = refit_subtree(child, below, block_bounds)
        });
    } else {
        subtrees.for_each(|(bounds, (child, below))| {
            *bounds = refit_subtree(child, below, block_bounds)
        });
    }
    let mut nodes = reversed[..node.n_child_nodes()].iter().rev();
    let mut boxes = [Aabb::EMPTY; LANES];
    let mut whole = SubtreeBounds { bounds: Aabb::EMPTY, area: 0.0 };
    for (lane, bounds) in boxes.iter_mut().enumerate() {
        let child = match node.child(lane) {
            None => continue,
            Some(Child::Block(block)) => SubtreeBounds { bounds: block_bounds(block), area: 0.0 },
            Some(Child::Node(_)) => *nodes.next().unwrap_or(&whole),
        };
        *bounds = child.bounds;
        whole.bounds = whole.bounds.union(child.bounds);
        whole.area += child.area + f64::from(child.bounds.half_area());
    }
    node.set_boxes(&boxes);
    whole
}

/// Returns each child with the nodes below it, the last child first, because only the end of the last child's
/// range is known.
fn subtrees_from_last<'n>(
    children: &'n mut [BvhNode],
    mut rest: &'n mut [BvhNode],
) -> impl Iterator<Item = (&'n mut BvhNode, &'n mut [BvhNode])> {
    let first = children.first().map_or(0, |child| child.first_node);
    children.iter_mut().rev().map(move |child| {
        let (before, own) =
            std::mem::take(&mut rest).split_at_mut((child.first_node - first) as usize);
        rest = before;
        (child, own)
    })
}

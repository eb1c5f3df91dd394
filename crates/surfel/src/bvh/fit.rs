//! The boxes of nodes, from the blocks up: after building, and again after points have moved.

use super::{Child, Node};
use crate::math::{Aabb, LANES};
use rayon::prelude::*;

/// Below this many nodes a subtree is worked on by one thread.
const PARALLEL_MIN: usize = 1024;

/// Sets the boxes of all nodes from those of the blocks and returns the tree's cost: how many nodes
/// and blocks a random ray that meets the root is expected to visit.
pub fn fit_boxes(nodes: &mut [Node], block_box: impl Fn(u32) -> Aabb + Sync) -> f64 {
    let Some((root, below)) = nodes.split_first_mut() else { return 0.0 };
    let fitted = fit(root, below, &block_box);
    fitted.area / f64::from(fitted.bounds.half_area()).max(f64::MIN_POSITIVE)
}

#[derive(Clone, Copy)]
struct Fitted {
    bounds: Aabb,
    /// Sum of the half areas of all boxes below.
    area: f64,
}

/// `below` holds the nodes under `node`: its children, then what is below each of them.
fn fit(node: &mut Node, below: &mut [Node], block_box: &(impl Fn(u32) -> Aabb + Sync)) -> Fitted {
    let is_large = PARALLEL_MIN <= below.len();
    let (children, rest) = below.split_at_mut(node.n_child_nodes());
    let mut last_first = [Fitted { bounds: Aabb::EMPTY, area: 0.0 }; LANES];
    let subtrees = last_first.iter_mut().zip(subtrees_from_last(children, rest));
    if is_large {
        let subtrees: Vec<_> = subtrees.collect();
        subtrees
            .into_par_iter()
            .for_each(|(fitted, (child, below))| *fitted = fit(child, below, block_box));
    } else {
        subtrees.for_each(|(fitted, (child, below))| *fitted = fit(child, below, block_box));
    }
    let mut nodes = last_first[..node.n_child_nodes()].iter().rev();
    let mut boxes = [Aabb::EMPTY; LANES];
    let mut whole = Fitted { bounds: Aabb::EMPTY, area: 0.0 };
    for (lane, bounds) in boxes.iter_mut().enumerate() {
        let fitted = match node.child(lane) {
            None => continue,
            Some(Child::Block(block)) => Fitted { bounds: block_box(block), area: 0.0 },
            Some(Child::Node(_)) => *nodes.next().unwrap_or(&whole),
        };
        *bounds = fitted.bounds;
        whole.bounds = whole.bounds.union(fitted.bounds);
        whole.area += fitted.area + f64::from(fitted.bounds.half_area());
    }
    node.set_boxes(&boxes);
    whole
}

/// Each child with what is below it, beginning with the last: it alone knows where it ends.
fn subtrees_from_last<'n>(
    children: &'n mut [Node],
    mut rest: &'n mut [Node],
) -> impl Iterator<Item = (&'n mut Node, &'n mut [Node])> {
    let first = children.first().map_or(0, |child| child.first_node);
    children.iter_mut().rev().map(move |child| {
        let (before, own) =
            std::mem::take(&mut rest).split_at_mut((child.first_node - first) as usize);
        rest = before;
        (child, own)
    })
}

//! The traversal of a tree by one packet.

use crate::bvh::Child;
use crate::flat::BlockTree;
use crate::math::Lanes;
use crate::trace::traversal::children::OverlappedChildren;
use crate::trace::traversal::packet::{Packet, PacketVisitor};
use crate::trace::traversal::prefetch::Prefetcher;
use crate::trace::traversal::sparse::test_rays_individually;
use crate::trace::traversal::stack::PacketStack;

/// Passes every block whose box a ray of the packet enters before its limit to `visitor`.
#[inline(always)]
pub fn traverse_packet<L: Lanes, V: PacketVisitor<L>>(
    tree: &V::Tree,
    packet: &Packet<L::PacketLanes>,
    stack: &mut PacketStack,
    visitor: &mut V,
) {
    let prefetcher = Prefetcher::new(tree);
    let mut limit = packet.frustum.limit(&packet.lanes, visitor.limits());
    let mut is_limit_stale = false;
    stack.start::<L>(packet, limit);
    while let Some(next) = stack.pop() {
        if V::IS_ORDERED && limit < next.entry {
            continue;
        }
        let lanes = packet.intersect_box(&next, visitor.limits());
        if lanes == 0 {
            continue;
        }
        match Child::unpack(next.child) {
            Child::Node(node_idx) => {
                // The limit is not updated after each block: that took a tenth of the time of dense clouds.
                if is_limit_stale {
                    limit = packet.frustum.limit(&packet.lanes, visitor.limits());
                    is_limit_stale = false;
                }
                let is_prefetched = stack.is_prefetched(next.child);
                stack.prefetch_next::<L>(tree.nodes(), &prefetcher, limit);
                let node = &tree.nodes()[node_idx as usize];
                let children = OverlappedChildren::<L>::new(node, &packet.frustum, limit);
                if 0.0 < V::SPARSE_THRESHOLD
                    && node.has_only_blocks()
                    && stack.occupancy.is_below(V::SPARSE_THRESHOLD)
                {
                    // The blocks are on their way while the entering rays are found.
                    if !is_prefetched {
                        prefetcher.prefetch_children::<L>(node, children.lanes);
                    }
                    let occupancy = &mut stack.occupancy;
                    test_rays_individually::<L, V>(
                        tree, &children, packet, lanes, occupancy, visitor,
                    );
                    is_limit_stale = true;
                } else {
                    stack.push(&children, &prefetcher, V::IS_ORDERED);
                }
            }
            Child::Block(block_idx) => {
                if lanes.is_power_of_two() {
                    visitor.visit_single(tree, block_idx, lanes.trailing_zeros() as usize);
                } else {
                    visitor.visit(tree, block_idx);
                }
                if 0.0 < V::SPARSE_THRESHOLD {
                    stack.occupancy.add(lanes.count_ones(), 1);
                }
                if V::IS_ORDERED {
                    is_limit_stale = true;
                    continue;
                }
                limit = packet.frustum.limit(&packet.lanes, visitor.limits());
                if limit == f32::NEG_INFINITY {
                    return;
                }
            }
        }
    }
}

//! Batches of rays: the driver that traces coherent rays in packets and the others interleaved.

use crate::flat::BlockTree;
use crate::math::{Lanes, PACKET_WIDTH, Ray, SimdTask};
use crate::trace::traversal::group::{GROUP_SIZE, PacketGroup};
use crate::trace::traversal::interleaved::{RayPool, RayVisitor, trace_interleaved};
use crate::trace::traversal::packet::{Packet, PacketVisitor};
use crate::trace::traversal::packet_traversal::traverse_packet;
use crate::trace::traversal::stack::PacketStack;

/// A question about each ray of a batch.
pub trait RayQuery<L: Lanes> {
    /// The tree that is searched.
    type Tree: BlockTree;
    /// The answer for one ray.
    type Result;
    /// The search along an incoherent ray.
    type RayVisitor<'r>: RayVisitor<Tree = Self::Tree>;
    /// The search along the rays of a packet.
    type PacketVisitor<'p>: PacketVisitor<L, Tree = Self::Tree>;
    /// True if rays' far ends may be closer to each other than their origins, like those of shadow rays at a
    /// light.
    const CONVERGES_AT_END: bool;
    /// True if incoherent rays are traced packet by packet, each followed by `finish_packet`. Otherwise those
    /// of the whole batch are traced together, which hides more reads from memory.
    const IS_PACKETWISE: bool;

    /// Begins the search along one ray.
    fn ray_visitor<'r>(&mut self, ray: &'r Ray) -> Self::RayVisitor<'r>;

    /// Begins the search along the rays of a packet.
    fn packet_visitor<'p>(
        &mut self,
        packet: &'p Packet<'p, L::PacketLanes>,
    ) -> Self::PacketVisitor<'p>;

    /// Takes the results of one to sixteen incoherent rays, which would be those of one packet.
    fn ray_results(&mut self, visitors: &mut [Self::RayVisitor<'_>], results: &mut [Self::Result]);

    /// Takes the results of a packet.
    fn packet_results(
        &mut self,
        visitor: &mut Self::PacketVisitor<'_>,
        results: &mut [Self::Result],
    );

    /// Completes the results of one to sixteen rays, if the query is packetwise.
    #[inline(always)]
    fn finish_packet(&mut self, _rays: &[Ray], _results: &mut [Self::Result]) {}
}

/// Answers a query for all of `rays`, in a function of its own.
#[inline(always)]
pub fn run_query<L: Lanes, Q: RayQuery<L>>(
    mut query: Q,
    tree: &Q::Tree,
    rays: &[Ray],
    results: &mut [Q::Result],
) {
    L::dispatch(RunQuery::<L, Q> { query: &mut query, tree, rays, results });
}

struct RunQuery<'b, L: Lanes, Q: RayQuery<L>> {
    query: &'b mut Q,
    tree: &'b Q::Tree,
    rays: &'b [Ray],
    results: &'b mut [Q::Result],
}

impl<L: Lanes, Q: RayQuery<L>> SimdTask for RunQuery<'_, L, Q> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { query, tree, rays, results } = self;
        // Two locals rather than a struct: the compiler then knows that the pool is newly allocated, so that no
        // visitor lies in it. Otherwise each hit became a mispredicted branch, and any hits 5 % slower.
        let (mut stack, mut pool) = (PacketStack::new(), RayPool::default());
        trace_batch::<L, Q>(&mut stack, &mut pool, query, tree, rays, results);
    }
}

/// Answers a query for all of `rays`. `stack` and `pool` are memory, which callers may reuse from batch to batch.
#[inline(always)]
pub fn trace_batch<L: Lanes, Q: RayQuery<L>>(
    stack: &mut PacketStack,
    pool: &mut RayPool,
    query: &mut Q,
    tree: &Q::Tree,
    rays: &[Ray],
    results: &mut [Q::Result],
) {
    let capacity = if Q::IS_PACKETWISE { PACKET_WIDTH } else { rays.len() };
    let mut incoherent = Vec::with_capacity(capacity);
    // The index of the first ray of each packet of incoherent rays.
    let mut firsts = Vec::with_capacity(capacity / PACKET_WIDTH + 1);
    let mut group = PacketGroup::new(Q::CONVERGES_AT_END);
    for (group_idx, rays) in rays.chunks(GROUP_SIZE).enumerate() {
        group.load::<L, _>(tree, rays);
        for (packet_idx, rays) in rays.chunks(PACKET_WIDTH).enumerate() {
            let first = group_idx * GROUP_SIZE + packet_idx * PACKET_WIDTH;
            if let Some(packet) = group.packet(tree, packet_idx, rays) {
                let mut visitor = query.packet_visitor(&packet);
                traverse_packet::<L, _>(tree, &packet, stack, &mut visitor);
                query.packet_results(&mut visitor, &mut results[first..][..rays.len()]);
            } else {
                for ray in rays {
                    incoherent.push(query.ray_visitor(ray));
                }
                firsts.push(first);
                if Q::IS_PACKETWISE {
                    trace_incoherent::<L, Q>(
                        pool,
                        query,
                        tree,
                        &mut incoherent,
                        &mut firsts,
                        results,
                    );
                }
            }
            if Q::IS_PACKETWISE {
                query.finish_packet(rays, &mut results[first..][..rays.len()]);
            }
        }
    }
    if !Q::IS_PACKETWISE {
        trace_incoherent::<L, Q>(pool, query, tree, &mut incoherent, &mut firsts, results);
    }
}

/// Traces incoherent rays interleaved, and clears them.
#[inline(always)]
fn trace_incoherent<L: Lanes, Q: RayQuery<L>>(
    pool: &mut RayPool,
    query: &mut Q,
    tree: &Q::Tree,
    visitors: &mut Vec<Q::RayVisitor<'_>>,
    firsts: &mut Vec<usize>,
    results: &mut [Q::Result],
) {
    trace_interleaved::<L, _>(pool, tree, visitors);
    for (first, visitors) in firsts.iter().zip(visitors.chunks_mut(PACKET_WIDTH)) {
        let results = &mut results[*first..][..visitors.len()];
        query.ray_results(visitors, results);
    }
    visitors.clear();
    firsts.clear();
}

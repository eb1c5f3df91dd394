//! Rays in a batch: those that go much the same way in packets, the others each alone, in flight.

use super::flight::{Flight, RayVisitor, fly};
use super::group::{GROUP, Group};
use super::packet::{Packet, PacketStack, PacketVisitor, along_packet};
use crate::flat::BlockTree;
use crate::math::{Lanes, Ray, Task, WIDE};

/// What is asked about each ray.
pub trait Query<L: Lanes> {
    type Tree: BlockTree;
    type Answer;
    type Alone<'r>: RayVisitor<Tree = Self::Tree>;
    type InPacket<'p>: PacketVisitor<L, Tree = Self::Tree>;
    /// Whether rays' far ends may be closer to each other than their origins, as at a light.
    const ENDS_MEET: bool;

    fn alone<'r>(&self, ray: &'r Ray) -> Self::Alone<'r>;

    fn in_packet<'p>(&self, packet: &'p Packet<'p, L::Wide>) -> Self::InPacket<'p>;

    /// What a ray alone found.
    fn answer(found: &Self::Alone<'_>) -> Self::Answer;

    /// What the rays of a packet found.
    fn answer_all(found: &Self::InPacket<'_>, answers: &mut [Self::Answer]);
}

/// Asks about all of `rays`, in a function of its own.
#[inline(always)]
pub fn ask<L: Lanes, Q: Query<L>>(
    query: Q,
    tree: &Q::Tree,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) {
    L::call(Batch::<L, Q> { query, tree, rays, answers });
}

struct Batch<'b, L: Lanes, Q: Query<L>> {
    query: Q,
    tree: &'b Q::Tree,
    rays: &'b [Ray],
    answers: &'b mut [Q::Answer],
}

impl<L: Lanes, Q: Query<L>> Task for Batch<'_, L, Q> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { query, tree, rays, answers } = self;
        let mut stack = PacketStack::new();
        let mut loose = Vec::with_capacity(rays.len());
        let mut indices = Vec::with_capacity(rays.len());
        let mut group = Group::new(Q::ENDS_MEET);
        for (group_idx, rays) in rays.chunks(GROUP).enumerate() {
            group.take::<L, _>(tree, rays);
            for (place, rays) in rays.chunks(WIDE).enumerate() {
                let first = group_idx * GROUP + place * WIDE;
                if let Some(packet) = group.packet(tree, place, rays) {
                    let mut found = query.in_packet(&packet);
                    along_packet::<L, _>(tree, &packet, &mut stack, &mut found);
                    Q::answer_all(&found, &mut answers[first..][..rays.len()]);
                    continue;
                }
                for (lane, ray) in rays.iter().enumerate() {
                    loose.push(query.alone(ray));
                    indices.push(first + lane);
                }
            }
        }
        fly::<L, _>(&mut Flight::default(), tree, &mut loose);
        for (ray_idx, found) in indices.into_iter().zip(&loose) {
            answers[ray_idx] = Q::answer(found);
        }
    }
}

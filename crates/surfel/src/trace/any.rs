//! Whether any shape lies in each ray's range, each point on its own.

use super::block::{BlockForPacket, BlockHits};
use super::flight::fly;
use super::packet::{Packet, PacketStack, PacketVisitor, along_packet};
use super::traverse::RayVisitor;
use crate::flat::{FlatPoints, FlatScene};
use crate::math::{Floats, LANES, LaneMask, Lanes, Ray, WIDE, Wide};
use crate::surface::{Disc, Shape, Sphere};
use std::marker::PhantomData;
use std::ops::ControlFlow;

#[inline(always)]
pub(super) fn any_hits<L: Lanes>(scene: &FlatScene, rays: &[Ray], occluded: &mut [bool]) {
    if scene.surface.is_oriented() {
        any_of_shape::<L, Disc>(&scene.points, rays, occluded);
    } else {
        any_of_shape::<L, Sphere>(&scene.points, rays, occluded);
    }
}

#[inline(always)]
fn any_of_shape<L: Lanes, S: Shape>(points: &FlatPoints, rays: &[Ray], occluded: &mut [bool]) {
    let mut stack = PacketStack::new();
    let mut loose = Vec::with_capacity(rays.len());
    let mut indices = Vec::with_capacity(rays.len());
    for (first, rays) in rays.chunks(WIDE).enumerate() {
        if let Some(packet) = Packet::new(&points.nodes[0], rays, true) {
            let occluded = &mut occluded[first * WIDE..][..rays.len()];
            any_in_packet::<L, S>(points, &packet, &mut stack, occluded);
            continue;
        }
        for (lane, ray) in rays.iter().enumerate() {
            loose.push(Any { ray, shape: PhantomData::<S>, is_hit: false });
            indices.push(first * WIDE + lane);
        }
    }
    fly::<L, _>(points, &mut loose);
    for (ray_idx, any) in indices.into_iter().zip(loose) {
        occluded[ray_idx] = any.is_hit;
    }
}

struct Any<'r, S> {
    ray: &'r Ray,
    shape: PhantomData<S>,
    is_hit: bool,
}

impl<S: Shape> RayVisitor for Any<'_, S> {
    const IS_ORDERED: bool = false;

    #[inline(always)]
    fn ray(&self) -> &Ray {
        self.ray
    }

    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.t_max
    }

    #[inline(always)]
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()> {
        let hits = BlockHits::<L>::find::<S>(points, block_idx, self.ray);
        self.is_hit = hits.lanes(self.ray.t_max) != 0;
        if self.is_hit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[inline(always)]
fn any_in_packet<L: Lanes, S: Shape>(
    points: &FlatPoints,
    packet: &Packet<L::Wide>,
    stack: &mut PacketStack,
    occluded: &mut [bool],
) {
    let limits = packet.limits();
    let mut any = AnyInPacket::<L, S> { packet, shape: PhantomData, limits, is_hit: 0 };
    along_packet::<L, false>(points, packet, stack, &mut any);
    for (lane, occluded) in occluded.iter_mut().enumerate() {
        *occluded = any.is_hit >> lane & 1 == 1;
    }
}

struct AnyInPacket<'p, L: Lanes, S> {
    packet: &'p Packet<'p, L::Wide>,
    shape: PhantomData<S>,
    /// Below all distances for rays that have hit something.
    limits: [f32; WIDE],
    is_hit: u32,
}

impl<L: Lanes, S: Shape> PacketVisitor<L> for AnyInPacket<'_, L, S> {
    #[inline(always)]
    fn limits(&self) -> &[f32; WIDE] {
        &self.limits
    }

    #[inline(always)]
    fn visit(&mut self, points: &FlatPoints, block_idx: u32) {
        let block = BlockForPacket::<L>::new(&points.blocks[block_idx as usize], self.packet);
        let mut limits = L::Wide::load(&self.limits);
        let blocked = L::Wide::splat(f32::NEG_INFINITY);
        for lane in 0..LANES {
            let (distance, mask) = block.intersect::<S>(lane);
            let hits = mask & distance.less_equal(limits);
            self.is_hit |= hits.bits();
            limits = L::Wide::select(hits, blocked, limits);
        }
        self.limits = limits.store();
    }

    #[inline(always)]
    fn visit_alone(&mut self, points: &FlatPoints, block_idx: u32, lane: usize) {
        let hits = BlockHits::<L>::find::<S>(points, block_idx, &self.packet.rays[lane]);
        if hits.lanes(self.limits[lane]) != 0 {
            self.is_hit |= 1 << lane;
            self.limits[lane] = f32::NEG_INFINITY;
        }
    }
}

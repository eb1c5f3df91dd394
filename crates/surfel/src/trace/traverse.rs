//! Walking the tree with an explicit stack: blocks on a ray from near to far, blocks near a place.

use super::node::{BoxRay, ball_overlaps, ray_entries};
use crate::bvh::{Child, STACK_SIZE};
use crate::flat::FlatPoints;
use crate::math::{LaneMask, Lanes, Ray, Vec3};
use std::ops::ControlFlow;

/// What a search of one ray has still to look at: where each box is entered and the packed child. Kept
/// from ray to ray, as clearing it takes longer than many a search.
pub struct RayStack([(f32, u32); STACK_SIZE]);

impl RayStack {
    pub fn new() -> Self {
        Self([(0.0, 0); STACK_SIZE])
    }
}

/// Looks at the blocks that a ray comes by.
pub trait RayVisitor {
    /// Whether near blocks are better seen first.
    const IS_ORDERED: bool;

    fn ray(&self) -> &Ray;

    /// Boxes entered beyond this distance are left out.
    fn limit(&self) -> f32;

    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()>;
}

/// Shows `visitor` every block whose box `ray` enters before the visitor's limit, nearest
/// boxes first.
#[inline(always)]
pub fn along_ray<L: Lanes>(
    points: &FlatPoints,
    ray: &Ray,
    RayStack(stack): &mut RayStack,
    visitor: &mut impl RayVisitor,
) {
    let box_ray = BoxRay::new(&points.nodes[0], ray);
    stack[0] = (ray.t_min, Child::Node(0).pack());
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let (entry, child) = stack[size];
        if visitor.limit() < entry {
            continue;
        }
        let node = match Child::unpack(child) {
            Child::Node(node_idx) => &points.nodes[node_idx as usize],
            Child::Block(block_idx) => {
                if visitor.visit::<L>(points, block_idx).is_break() {
                    return;
                }
                continue;
            }
        };
        let (lanes, entries) = ray_entries::<L>(node, &box_ray, visitor.limit());
        let (mut lanes, entries) = (lanes.bits(), entries.store());
        let first = size;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(child) = node.child(lane) else { continue };
            // Kept sorted, the nearest on top; equal entries stay in lane order.
            let mut place = size;
            while first < place && stack[place - 1].0 <= entries[lane] {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = (entries[lane], child.pack());
            size += 1;
        }
    }
}

/// Looks at the blocks around a place.
pub trait BallVisitor {
    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()>;
}

/// Shows `visitor` every block whose box comes within `radius` of `center`.
#[inline(always)]
pub fn around<L: Lanes>(
    points: &FlatPoints,
    center: Vec3,
    radius: f32,
    visitor: &mut impl BallVisitor,
) {
    if points.nodes.is_empty() {
        return;
    }
    let mut stack = [0u32; STACK_SIZE];
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &points.nodes[stack[size] as usize];
        let mut lanes = ball_overlaps::<L>(node, center, radius);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            match node.child(lane) {
                Some(Child::Node(node_idx)) => {
                    stack[size] = node_idx;
                    size += 1;
                }
                Some(Child::Block(block_idx))
                    if visitor.visit::<L>(points, block_idx).is_break() =>
                {
                    return;
                }
                _ => {}
            }
        }
    }
}

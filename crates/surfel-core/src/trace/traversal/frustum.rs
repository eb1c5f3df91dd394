//! The frustum around the rays of packets: slopes and offsets along the axis that the rays mostly follow.

use crate::bvh::BvhNode;
use crate::math::{LANES, LaneMask, Lanes, PACKET_WIDTH, PacketLanes, Ray, Vec3};
use crate::trace::simd::node_boxes::slack;
use crate::trace::simd::packet_rays::PacketRays;

/// Rays whose slopes spread more than this form no packet.
const MAX_SLOPE_SPREAD: f32 = 0.25;
/// Rays that end farther than this, in scene units, have no frustum that converges at their ends.
const MAX_END_DISTANCE: f32 = 1e18;
/// The mask of all rays.
const ALL_RAYS: u32 = (1 << PACKET_WIDTH) - 1;

/// False for most sets of incoherent rays, judged by a few of them before any work on all.
///
/// It is not inlined: mixed with that work it cost packets a fifth of their time.
#[inline(never)]
pub fn is_probably_coherent(rays: &[Ray]) -> bool {
    // The cosine of the largest angle between directions whose slopes differ by `MAX_SLOPE_SPREAD` on both
    // axes.
    const TANGENT_SQUARED: f32 = MAX_SLOPE_SPREAD * MAX_SLOPE_SPREAD / 2.0;
    const COSINE: f32 = (1.0 - TANGENT_SQUARED) / (1.0 + TANGENT_SQUARED);
    let first = rays[0].direction;
    let least = COSINE * COSINE * first.length_squared();
    let mut is_coherent = true;
    let last = rays.len() - 1;
    for ray_idx in [last / 3, 2 * last / 3, last] {
        let other = rays[ray_idx].direction;
        let along = first.dot(other);
        is_coherent &= least * other.length_squared() <= along * along.max(0.0);
    }
    is_coherent
}

/// The origin and the main axis of the coordinates of a frustum, shared by adjacent packets.
#[derive(Clone, Copy)]
pub struct FrustumApex {
    position: Vec3,
    main_axis: usize,
    /// 1 or -1: the sign of the rays' directions along the main axis.
    axis_sign: f32,
    /// True if the apex is where the rays end rather than where they start.
    is_end: bool,
}

impl FrustumApex {
    /// Chooses the apex of rays in lanes, of which `first` is one. Returns `None` unless all have the same
    /// sign along the main axis of `first`.
    ///
    /// `converges_at_end` says that the rays' far ends may be closer to each other than their origins, like
    /// those of shadow rays at a light.
    #[inline(always)]
    pub fn new<W: PacketLanes>(
        first: &Ray,
        rays: &[PacketRays<W>],
        converges_at_end: bool,
    ) -> Option<Self> {
        let main = main_axis(first.direction);
        let sign = 1f32.copysign(first.direction[main]);
        let (mut ahead, mut ending) = (ALL_RAYS, ALL_RAYS);
        for rays in rays {
            ahead &= W::splat(0.0).lt(rays.direction[main] * W::splat(sign)).bits();
            ending &= rays.t_max.lt(W::splat(MAX_END_DISTANCE)).bits();
        }
        if ahead != ALL_RAYS {
            return None;
        }
        let is_end = converges_at_end && ending == ALL_RAYS;
        let mut position = if is_end { first.at(first.t_max) } else { first.origin };
        // The plane at which the main axis is zero lies before all starts, or behind all ends.
        let mut starts = LaneRange::empty();
        for rays in rays {
            let start = if is_end {
                rays.origin[main] + rays.direction[main] * rays.t_max
            } else {
                rays.origin[main]
            };
            starts.include(start);
        }
        position[main] = match is_end == (0.0 < sign) {
            true => starts.1.reduce_max(),
            false => starts.0.reduce_min(),
        };
        Some(Self { position, main_axis: main, axis_sign: sign, is_end })
    }
}

/// A frustum around rays.
///
/// At distance x from the apex along the main axis, the rays lie within
/// `offset.0 + slope.0 x .. offset.1 + slope.1 x` on each of the other two axes.
pub struct Frustum {
    /// Origin of the frustum's coordinates.
    pub apex: Vec3,
    /// The main axis, then the others. Boxes are brought to this order when they are read: to look up axes in
    /// registers would go through memory, for which the next node waits.
    pub axes: [usize; 3],
    /// 1 or -1: the direction along the main axis in which the frustum opens.
    axis_sign: f32,
    slope: [(f32, f32); 2],
    offset: [(f32, f32); 2],
    /// Largest distance of an origin from the plane of the apex.
    origin_depth: f32,
    /// Largest distance of any point of a ray from the plane of the apex.
    max_depth: f32,
    /// Allowance for rounding, by which boxes are widened.
    slack: f32,
}

/// The boxes of a node's children relative to the frustum's apex, widened for rounding, with axes in the
/// order of `Frustum::axes`.
pub struct ChildBoxes<L> {
    /// Lower corners.
    pub min: [L; 3],
    /// Upper corners.
    pub max: [L; 3],
}

impl<L: Lanes> ChildBoxes<L> {
    /// Writes lower and upper corners, axis by axis.
    #[inline(always)]
    pub fn store(&self) -> ([[f32; LANES]; 3], [[f32; LANES]; 3]) {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.min, self.max);
        ([x0.store(), y0.store(), z0.store()], [x1.store(), y1.store(), z1.store()])
    }
}

impl Frustum {
    /// Builds the frustum around rays in lanes, or returns `None` if they are not coherent.
    #[inline(always)]
    pub fn new<W: PacketLanes>(
        root: &BvhNode,
        apex: &FrustumApex,
        rays: &[PacketRays<W>],
    ) -> Option<Self> {
        let FrustumApex { position, main_axis: main, axis_sign, is_end } = *apex;
        let across = [(main + 1) % 3, (main + 2) % 3];
        let mut slope = [LaneRange::<W>::empty(); 2];
        let mut offset = [LaneRange::<W>::empty(); 2];
        let mut distance = [W::splat(0.0); 3];
        let mut finite = ALL_RAYS;
        for rays in rays {
            let inverse = W::splat(1.0) / rays.direction[main];
            let start = [
                rays.origin[0] - W::splat(position.x),
                rays.origin[1] - W::splat(position.y),
                rays.origin[2] - W::splat(position.z),
            ];
            let mut sum = start[main];
            for i in 0..2 {
                let slopes = rays.direction[across[i]] * inverse;
                let start = (start[main], start[across[i]]);
                slope[i].include(slopes);
                offset[i].include(start.1 - start.0 * slopes);
                sum = sum + start.1 + slopes;
            }
            for (distance, start) in distance.iter_mut().zip(start) {
                *distance = start.abs().max(*distance);
            }
            // With a NaN in a lane, the least and greatest lanes may be those of only some lanes.
            let is_finite = sum.lt(W::splat(f32::INFINITY)) & W::splat(f32::NEG_INFINITY).lt(sum);
            finite &= is_finite.bits();
        }
        let slope = [slope[0].reduce(), slope[1].reduce()];
        let spreads = [slope[0].1 - slope[0].0, slope[1].1 - slope[1].0];
        if !(spreads[0] < MAX_SLOPE_SPREAD && spreads[1] < MAX_SLOPE_SPREAD) || finite != ALL_RAYS {
            return None;
        }
        let [x, y, z] = distance;
        let distance = Vec3::new(x.reduce_max(), y.reduce_max(), z.reduce_max());
        let runs_down = is_end == (0.0 < axis_sign);
        Some(Self {
            apex: position,
            axes: [main, across[0], across[1]],
            axis_sign: if runs_down { -1.0 } else { 1.0 },
            slope: if runs_down { [negated(slope[0]), negated(slope[1])] } else { slope },
            offset: [offset[0].reduce(), offset[1].reduce()],
            origin_depth: distance[main],
            max_depth: if is_end { distance[main] } else { f32::INFINITY },
            slack: slack(root, position.into()) + 1e-6 * distance.max_element(),
        })
    }

    /// Returns the distance along the main axis beyond which no ray goes.
    pub fn max_limit(&self) -> f32 {
        self.max_depth + self.slack
    }

    /// True if the frustum is narrower than a box, given like `ChildBoxes`, at the far side of that box.
    #[inline(always)]
    pub fn is_narrower_than(&self, min: &[f32; 3], max: &[f32; 3]) -> bool {
        let x = min[0].abs().max(max[0].abs());
        let mut is_narrower = false;
        for i in 0..2 {
            let (slope, offset) = (self.slope[i], self.offset[i]);
            let width = (slope.1 - slope.0) * x + (offset.1 - offset.0);
            is_narrower |= width < max[1 + i] - min[1 + i];
        }
        is_narrower
    }

    /// Returns the boxes of a node's children.
    #[inline(always)]
    pub fn child_boxes<L: Lanes>(&self, node: &BvhNode) -> ChildBoxes<L> {
        let [a, b, c] = self.axes;
        let (a, b, c) = (self.sides(node, a), self.sides(node, b), self.sides(node, c));
        ChildBoxes { min: [a.0, b.0, c.0], max: [a.1, b.1, c.1] }
    }

    /// Returns lower and upper bounds of a node's children along an axis.
    #[inline(always)]
    fn sides<L: Lanes>(&self, node: &BvhNode, axis: usize) -> (L, L) {
        let corner = node.origin[axis] - self.apex[axis];
        let step = L::splat(node.step_along(axis));
        (
            L::from_u8(&node.lower[axis]).mul_add(step, L::splat(corner - self.slack)),
            L::from_u8(&node.upper[axis]).mul_add(step, L::splat(corner + self.slack)),
        )
    }

    /// Returns the lanes whose boxes overlap the frustum up to `limit` along the main axis, and the distances
    /// along it at which the boxes begin.
    #[inline(always)]
    pub fn overlaps<L: Lanes>(&self, boxes: &ChildBoxes<L>, limit: f32) -> (u32, [f32; LANES]) {
        let zero = L::splat(0.0);
        let (min, max) = (boxes.min[0], boxes.max[0]);
        let (near, far) = if 0.0 < self.axis_sign { (min, max) } else { (zero - max, zero - min) };
        let entry = near.max(zero);
        let mut overlaps = zero.le(far) & entry.le(L::splat(limit));
        for i in 0..2 {
            let (min, max) = (boxes.min[1 + i], boxes.max[1 + i]);
            let (low, high) = (L::splat(self.slope[i].0), L::splat(self.slope[i].1));
            let upper = L::splat(self.offset[i].1) + (high * entry).max(high * far);
            let lower = L::splat(self.offset[i].0) + (low * entry).min(low * far);
            overlaps = overlaps & min.le(upper) & lower.le(max);
        }
        (overlaps.bits(), entry.store())
    }

    /// Returns the lanes whose triangles, given corner by corner and axis by axis, may overlap the frustum,
    /// judged by the boxes around them.
    #[inline(always)]
    pub fn overlapping_triangles<L: Lanes>(&self, corners: &[[[f32; LANES]; 3]; 3]) -> u32 {
        let [a, b, c] = self.axes;
        let a = self.triangle_sides(corners, a);
        let (b, c) = (self.triangle_sides(corners, b), self.triangle_sides(corners, c));
        let boxes = ChildBoxes { min: [a.0, b.0, c.0], max: [a.1, b.1, c.1] };
        self.overlaps::<L>(&boxes, f32::INFINITY).0
    }

    #[inline(always)]
    fn triangle_sides<L: Lanes>(&self, [a, b, c]: &[[[f32; LANES]; 3]; 3], axis: usize) -> (L, L) {
        let (a, b, c) = (L::load(&a[axis]), L::load(&b[axis]), L::load(&c[axis]));
        let apex = self.apex[axis];
        (
            a.min(b).min(c) - L::splat(apex + self.slack),
            a.max(b).max(c) - L::splat(apex - self.slack),
        )
    }

    /// Returns the distance along the main axis beyond which no ray needs to search, from the limits of each
    /// ray.
    #[inline(always)]
    pub fn limit<W: PacketLanes>(&self, rays: &PacketRays<W>, limits: &[f32; PACKET_WIDTH]) -> f32 {
        let along = rays.direction[self.axes[0]];
        let along = along.max(W::splat(0.0) - along);
        let limit = (W::load(limits) * along).reduce_max() + self.origin_depth;
        limit.min(self.max_depth) + self.slack
    }
}

fn main_axis(direction: Vec3) -> usize {
    let size = direction.abs();
    match (size.y <= size.x, size.z <= size.x, size.z <= size.y) {
        (true, true, _) => 0,
        (_, _, true) => 1,
        _ => 2,
    }
}

/// The least and the greatest values of each lane.
#[derive(Clone, Copy)]
struct LaneRange<W>(W, W);

impl<W: PacketLanes> LaneRange<W> {
    #[inline(always)]
    fn empty() -> Self {
        Self(W::splat(f32::INFINITY), W::splat(f32::NEG_INFINITY))
    }

    #[inline(always)]
    fn include(&mut self, values: W) {
        *self = Self(values.min(self.0), values.max(self.1));
    }

    /// Returns the least and the greatest value of all lanes.
    #[inline(always)]
    fn reduce(&self) -> (f32, f32) {
        (self.0.reduce_min(), self.1.reduce_max())
    }
}

fn negated((low, high): (f32, f32)) -> (f32, f32) {
    (-high, -low)
}

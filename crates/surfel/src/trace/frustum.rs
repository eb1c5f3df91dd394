//! The room that a packet's rays take up: slopes and offsets along the axis they mostly follow.

use super::node::slack;
use super::packet::WideRays;
use crate::bvh::Node;
use crate::math::{LANES, LaneMask, Lanes, Ray, Vec3, WIDE, Wide};

/// Rays whose slopes differ by more than this are no packet.
const WIDEST: f32 = 0.25;
/// Ends beyond this are no place to count from.
const FAR: f32 = 1e18;
/// The lanes of all rays.
const ALL: u32 = (1 << WIDE) - 1;

/// False for most rays that go different ways, told from a few of them before any work on all.
///
/// Not inlined: mixed with that work it cost packets a fifth of their time.
#[inline(never)]
pub fn may_be_alike(rays: &[Ray]) -> bool {
    // The cosine of the widest angle that slopes can make which differ by `WIDEST` on both axes.
    const TANGENT_SQUARED: f32 = WIDEST * WIDEST / 2.0;
    const COSINE: f32 = (1.0 - TANGENT_SQUARED) / (1.0 + TANGENT_SQUARED);
    let first = rays[0].direction;
    let least = COSINE * COSINE * first.length_squared();
    let mut are_alike = true;
    for ray_idx in [5, 10, 15] {
        let other = rays[ray_idx.min(rays.len() - 1)].direction;
        let along = first.dot(other);
        are_alike &= least * other.length_squared() <= along * along.max(0.0);
    }
    are_alike
}

/// Along the main axis, at `x` in the rays' sense from the anchor, the rays lie in
/// `offset.0 + slope.0 x .. offset.1 + slope.1 x` on each of the other two axes.
pub struct Frustum {
    pub anchor: Vec3,
    /// The main axis, then the others. Boxes are put in this order where they are read: axes looked up in
    /// registers would go by way of memory, for which the next node waits.
    pub axes: [usize; 3],
    /// 1 or -1: where the frustum opens to.
    sense: f32,
    slope: [(f32, f32); 2],
    offset: [(f32, f32); 2],
    /// Largest distance of an origin from the anchor plane.
    depth: f32,
    /// Nothing beyond this is on any ray.
    farthest: f32,
    /// Boxes are widened by this, for rounding.
    slack: f32,
}

/// The boxes of a node's children, relative to the frustum's anchor, widened by rounding; axes are in the order
/// of `Frustum::axes`.
pub struct Boxes<L> {
    pub min: [L; 3],
    pub max: [L; 3],
}

impl<L: Lanes> Boxes<L> {
    #[inline(always)]
    pub fn store(&self) -> ([[f32; LANES]; 3], [[f32; LANES]; 3]) {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.min, self.max);
        ([x0.store(), y0.store(), z0.store()], [x1.store(), y1.store(), z1.store()])
    }
}

impl Frustum {
    /// Around rays in lanes, of which `first` is one, unless they go too different ways.
    #[inline(always)]
    pub fn new<W: Wide>(
        root: &Node,
        first: &Ray,
        rays: &WideRays<W>,
        ends_meet: bool,
    ) -> Option<Self> {
        let main = main_axis(first.direction);
        let sense = 1f32.copysign(first.direction[main]);
        let along = rays.direction[main] * W::splat(sense);
        if W::splat(0.0).less(along).bits() != ALL {
            return None;
        }
        let across = [(main + 1) % 3, (main + 2) % 3];
        let inverse = W::splat(1.0) / rays.direction[main];
        let slopes = [rays.direction[across[0]] * inverse, rays.direction[across[1]] * inverse];
        let slope = [range(slopes[0]), range(slopes[1])];
        if !(slope[0].1 - slope[0].0 < WIDEST && slope[1].1 - slope[1].0 < WIDEST) {
            return None;
        }
        let is_backward = ends_meet && rays.t_max.less(W::splat(FAR)).bits() == ALL;
        let mut anchor = if is_backward { first.at(first.t_max) } else { first.origin };
        // The plane from which x counts lies before all starts, or behind all ends.
        let starts = if is_backward {
            rays.origin[main] + rays.direction[main] * rays.t_max
        } else {
            rays.origin[main]
        };
        anchor[main] = match is_backward == (0.0 < sense) {
            true => starts.max_lane(),
            false => starts.min_lane(),
        };
        let start = [
            rays.origin[0] - W::splat(anchor.x),
            rays.origin[1] - W::splat(anchor.y),
            rays.origin[2] - W::splat(anchor.z),
        ];
        // Lowest and highest of lanes, one of which is not a number, may be those of only some.
        let all = start[0] + start[1] + start[2] + slopes[0] + slopes[1];
        let is_finite = all.less(W::splat(f32::INFINITY)) & W::splat(f32::NEG_INFINITY).less(all);
        if is_finite.bits() != ALL {
            return None;
        }
        let distance = Vec3::new(largest(start[0]), largest(start[1]), largest(start[2]));
        let offset = [
            range(start[across[0]] - start[main] * slopes[0]),
            range(start[across[1]] - start[main] * slopes[1]),
        ];
        let runs_down = is_backward == (0.0 < sense);
        Some(Self {
            anchor,
            axes: [main, across[0], across[1]],
            sense: if runs_down { -1.0 } else { 1.0 },
            slope: if runs_down { [flipped(slope[0]), flipped(slope[1])] } else { slope },
            offset,
            depth: distance[main],
            farthest: if is_backward { distance[main] } else { f32::INFINITY },
            slack: slack(root, anchor.into()) + 1e-6 * distance.max_element(),
        })
    }

    #[inline(always)]
    pub fn boxes<L: Lanes>(&self, node: &Node) -> Boxes<L> {
        let [a, b, c] = self.axes;
        let (a, b, c) = (self.sides(node, a), self.sides(node, b), self.sides(node, c));
        Boxes { min: [a.0, b.0, c.0], max: [a.1, b.1, c.1] }
    }

    /// Lower and upper bounds along an axis.
    #[inline(always)]
    fn sides<L: Lanes>(&self, node: &Node, axis: usize) -> (L, L) {
        let corner = node.origin[axis] - self.anchor[axis];
        let step = L::splat(node.step_along(axis));
        (
            L::from_u8(&node.lower[axis]).times_plus(step, L::splat(corner - self.slack)),
            L::from_u8(&node.upper[axis]).times_plus(step, L::splat(corner + self.slack)),
        )
    }

    /// The lanes whose boxes reach into the frustum up to `limit` along the main axis, and where they begin.
    #[inline(always)]
    pub fn meets<L: Lanes>(&self, boxes: &Boxes<L>, limit: f32) -> (u32, [f32; LANES]) {
        let zero = L::splat(0.0);
        let (min, max) = (boxes.min[0], boxes.max[0]);
        let (near, far) = if 0.0 < self.sense { (min, max) } else { (zero - max, zero - min) };
        let entry = near.max(zero);
        let mut meets = zero.less_equal(far) & entry.less_equal(L::splat(limit));
        for i in 0..2 {
            let (min, max) = (boxes.min[1 + i], boxes.max[1 + i]);
            let (low, high) = (L::splat(self.slope[i].0), L::splat(self.slope[i].1));
            let upper = L::splat(self.offset[i].1) + (high * entry).max(high * far);
            let lower = L::splat(self.offset[i].0) + (low * entry).min(low * far);
            meets = meets & min.less_equal(upper) & lower.less_equal(max);
        }
        (meets.bits(), entry.store())
    }

    /// The lanes whose triangles, given corner by corner and axis by axis, may reach into the frustum, told by
    /// the boxes around them.
    #[inline(always)]
    pub fn meets_triangles<L: Lanes>(&self, corners: &[[[f32; LANES]; 3]; 3]) -> u32 {
        let [a, b, c] = self.axes;
        let a = self.triangle_sides(corners, a);
        let (b, c) = (self.triangle_sides(corners, b), self.triangle_sides(corners, c));
        let boxes = Boxes { min: [a.0, b.0, c.0], max: [a.1, b.1, c.1] };
        self.meets::<L>(&boxes, f32::INFINITY).0
    }

    #[inline(always)]
    fn triangle_sides<L: Lanes>(&self, [a, b, c]: &[[[f32; LANES]; 3]; 3], axis: usize) -> (L, L) {
        let (a, b, c) = (L::load(&a[axis]), L::load(&b[axis]), L::load(&c[axis]));
        let anchor = self.anchor[axis];
        (
            a.min(b).min(c) - L::splat(anchor + self.slack),
            a.max(b).max(c) - L::splat(anchor - self.slack),
        )
    }

    /// How far along the main axis any ray still looks.
    #[inline(always)]
    pub fn limit<W: Wide>(&self, rays: &WideRays<W>, limits: &[f32; WIDE]) -> f32 {
        let along = rays.direction[self.axes[0]];
        let along = along.max(W::splat(0.0) - along);
        let limit = (W::load(limits) * along).max_lane() + self.depth;
        limit.min(self.farthest) + self.slack
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

#[inline(always)]
fn range<W: Wide>(values: W) -> (f32, f32) {
    (values.min_lane(), values.max_lane())
}

#[inline(always)]
fn largest<W: Wide>(values: W) -> f32 {
    values.max(W::splat(0.0) - values).max_lane()
}

fn flipped((low, high): (f32, f32)) -> (f32, f32) {
    (-high, -low)
}

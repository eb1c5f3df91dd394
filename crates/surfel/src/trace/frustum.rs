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
    let last = rays.len() - 1;
    for ray_idx in [last / 3, 2 * last / 3, last] {
        let other = rays[ray_idx].direction;
        let along = first.dot(other);
        are_alike &= least * other.length_squared() <= along * along.max(0.0);
    }
    are_alike
}

/// The place and the axis by which the rays of a frustum are counted, the same for packets side by side.
#[derive(Clone, Copy)]
pub struct Anchor {
    place: Vec3,
    main: usize,
    /// 1 or -1, as the rays go along the main axis.
    sense: f32,
    /// Whether `place` is where the rays end.
    is_end: bool,
}

impl Anchor {
    /// For rays in lanes, of which `first` is one, if all go the same way along the axis that it follows.
    /// `ends_meet` says that their far ends may be closer to each other than their origins, as at a light.
    #[inline(always)]
    pub fn new<W: Wide>(first: &Ray, rays: &[WideRays<W>], ends_meet: bool) -> Option<Self> {
        let main = main_axis(first.direction);
        let sense = 1f32.copysign(first.direction[main]);
        let (mut ahead, mut ending) = (ALL, ALL);
        for rays in rays {
            ahead &= W::splat(0.0).less(rays.direction[main] * W::splat(sense)).bits();
            ending &= rays.t_max.less(W::splat(FAR)).bits();
        }
        if ahead != ALL {
            return None;
        }
        let is_end = ends_meet && ending == ALL;
        let mut place = if is_end { first.at(first.t_max) } else { first.origin };
        // The plane from which x counts lies before all starts, or behind all ends.
        let mut starts = Range::none();
        for rays in rays {
            let start = if is_end {
                rays.origin[main] + rays.direction[main] * rays.t_max
            } else {
                rays.origin[main]
            };
            starts.take(start);
        }
        place[main] = match is_end == (0.0 < sense) {
            true => starts.1.max_lane(),
            false => starts.0.min_lane(),
        };
        Some(Self { place, main, sense, is_end })
    }
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
    /// Around rays in lanes, unless they go too different ways.
    #[inline(always)]
    pub fn new<W: Wide>(root: &Node, anchor: &Anchor, rays: &[WideRays<W>]) -> Option<Self> {
        let Anchor { place, main, sense, is_end } = *anchor;
        let across = [(main + 1) % 3, (main + 2) % 3];
        let mut slope = [Range::<W>::none(); 2];
        let mut offset = [Range::<W>::none(); 2];
        let mut distance = [W::splat(0.0); 3];
        let mut finite = ALL;
        for rays in rays {
            let inverse = W::splat(1.0) / rays.direction[main];
            let start = [
                rays.origin[0] - W::splat(place.x),
                rays.origin[1] - W::splat(place.y),
                rays.origin[2] - W::splat(place.z),
            ];
            let mut all = start[main];
            for i in 0..2 {
                let slopes = rays.direction[across[i]] * inverse;
                let start = (start[main], start[across[i]]);
                slope[i].take(slopes);
                offset[i].take(start.1 - start.0 * slopes);
                all = all + start.1 + slopes;
            }
            for (distance, start) in distance.iter_mut().zip(start) {
                *distance = start.abs().max(*distance);
            }
            // Lowest and highest of lanes, one of which is not a number, may be those of only some.
            let is_finite =
                all.less(W::splat(f32::INFINITY)) & W::splat(f32::NEG_INFINITY).less(all);
            finite &= is_finite.bits();
        }
        let slope = [slope[0].ends(), slope[1].ends()];
        if !(slope[0].1 - slope[0].0 < WIDEST && slope[1].1 - slope[1].0 < WIDEST) || finite != ALL
        {
            return None;
        }
        let [x, y, z] = distance;
        let distance = Vec3::new(x.max_lane(), y.max_lane(), z.max_lane());
        let runs_down = is_end == (0.0 < sense);
        Some(Self {
            anchor: place,
            axes: [main, across[0], across[1]],
            sense: if runs_down { -1.0 } else { 1.0 },
            slope: if runs_down { [flipped(slope[0]), flipped(slope[1])] } else { slope },
            offset: [offset[0].ends(), offset[1].ends()],
            depth: distance[main],
            farthest: if is_end { distance[main] } else { f32::INFINITY },
            slack: slack(root, place.into()) + 1e-6 * distance.max_element(),
        })
    }

    /// How far along the main axis any ray goes.
    pub fn reach(&self) -> f32 {
        self.farthest + self.slack
    }

    /// Whether a box, as in `Boxes`, is wider than the frustum is there.
    #[inline(always)]
    pub fn is_narrower(&self, min: &[f32; 3], max: &[f32; 3]) -> bool {
        let x = min[0].abs().max(max[0].abs());
        let mut is_narrower = false;
        for i in 0..2 {
            let (slope, offset) = (self.slope[i], self.offset[i]);
            let width = (slope.1 - slope.0) * x + (offset.1 - offset.0);
            is_narrower |= width < max[1 + i] - min[1 + i];
        }
        is_narrower
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

/// The lowest and the highest values in each lane.
#[derive(Clone, Copy)]
struct Range<W>(W, W);

impl<W: Wide> Range<W> {
    #[inline(always)]
    fn none() -> Self {
        Self(W::splat(f32::INFINITY), W::splat(f32::NEG_INFINITY))
    }

    #[inline(always)]
    fn take(&mut self, values: W) {
        *self = Self(values.min(self.0), values.max(self.1));
    }

    /// Of all lanes.
    #[inline(always)]
    fn ends(&self) -> (f32, f32) {
        (self.0.min_lane(), self.1.max_lane())
    }
}

fn flipped((low, high): (f32, f32)) -> (f32, f32) {
    (-high, -low)
}

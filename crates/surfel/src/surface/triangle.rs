//! Triangles: flat between three corners, without gaps where they share an edge.

use super::RayLanes;
use crate::math::{Aabb, Floats, LANES, Lanes, Vec3, Vec3Lanes, tangents};

pub struct Triangle;

/// What of triangles does not depend on rays.
#[derive(Clone, Copy)]
pub struct TriangleLanes<V> {
    corners: [V; 3],
    /// Not of unit length.
    normal: V,
}

/// Triangles as rays from one place meet them: eight before one ray, or one before sixteen rays.
#[derive(Clone, Copy)]
pub struct TrianglesSeen<V, F> {
    /// Relative to the rays' origin.
    corners: [V; 3],
    normal: V,
    /// The way to the triangle's plane, times the normal's length.
    away: F,
}

/// A ray as it meets triangles: with the plane across it, in which it is a point.
#[derive(Clone, Copy)]
pub struct LineLanes<F> {
    ray: RayLanes<F>,
    across: [Vec3Lanes<F>; 2],
}

/// Eight triangles, from which single ones are taken.
pub type Rows = [[f32; LANES]; 3];

impl<F: Floats> LineLanes<F> {
    #[inline(always)]
    pub fn new(ray: RayLanes<F>) -> Self {
        Self { ray, across: tangents(ray.direction) }
    }

    /// Where a corner is seen in the plane across the line, which is its zero.
    #[inline(always)]
    fn seen(&self, corner: Vec3Lanes<F>) -> (F, F) {
        (corner.dot(self.across[0]), corner.dot(self.across[1]))
    }
}

/// On which side of the zero an edge passes.
#[inline(always)]
fn side<F: Floats>(from: (F, F), to: (F, F)) -> F {
    from.0 * to.1 - from.1 * to.0
}

impl<F: Floats> TriangleLanes<Vec3Lanes<F>> {
    #[inline(always)]
    pub fn new(corners: [Vec3Lanes<F>; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, normal: b.minus(a).cross(a.minus(c)) }
    }

    #[inline(always)]
    pub fn seen_from(&self, origin: Vec3Lanes<F>) -> TrianglesSeen<Vec3Lanes<F>, F> {
        let [a, b, c] = self.corners;
        let corners = [a.minus(origin), b.minus(origin), c.minus(origin)];
        TrianglesSeen { corners, normal: self.normal, away: self.normal.dot(corners[0]) }
    }
}

impl<F: Floats> TrianglesSeen<Vec3Lanes<F>, F> {
    /// From `origin` instead of zero.
    #[inline(always)]
    pub fn seen_from(&self, origin: Vec3Lanes<F>) -> Self {
        TriangleLanes { corners: self.corners, normal: self.normal }.seen_from(origin)
    }

    /// Distances at and beyond the rays' `t_min`, and the lanes that are hit.
    ///
    /// Two-sided, and watertight as Woop, Benthin and Wald (2013) have it: each corner is seen at one place
    /// by all triangles that share it, and the side on which an edge between two such places passes is
    /// exact or zero, as the greater of two products is never rounded below the other. (Their axes, which
    /// have to be chosen for each ray, are replaced by tangents. Sides from cross products of edges, after
    /// Davidovic et al. 2012, are of one mind about edges, but not about corners: rounding may have a ray
    /// pass all edges around a corner on their outer side.)
    #[inline(always)]
    pub fn intersect(&self, line: &LineLanes<F>) -> (F, F::Mask) {
        let [a, b, c] = self.corners;
        let (seen_a, seen_b, seen_c) = (line.seen(a), line.seen(b), line.seen(c));
        let (at_a, at_b, at_c) = (side(seen_b, seen_c), side(seen_c, seen_a), side(seen_a, seen_b));
        let zero = F::splat(0.0);
        let least = at_a.min(at_b).min(at_c);
        let most = at_a.max(at_b).max(at_c);
        let distance = self.away / self.normal.dot(line.ray.direction);
        // A ray in the triangle's plane gives NaN or infinity here, and fails the last tests.
        let is_hit = (zero.less_equal(least) | most.less_equal(zero))
            & line.ray.t_min.less_equal(distance)
            & distance.less(F::splat(f32::INFINITY));
        (distance, is_hit)
    }
}

impl<L: Lanes> TrianglesSeen<Vec3Lanes<L>, L> {
    #[inline(always)]
    pub fn store(&self) -> TrianglesSeen<Rows, [f32; LANES]> {
        let [a, b, c] = self.corners;
        TrianglesSeen {
            corners: [a.store(), b.store(), c.store()],
            normal: self.normal.store(),
            away: self.away.store(),
        }
    }
}

impl TrianglesSeen<Rows, [f32; LANES]> {
    /// The triangle in `lane` before many rays.
    #[inline(always)]
    pub fn splat<F: Floats>(&self, lane: usize) -> TrianglesSeen<Vec3Lanes<F>, F> {
        TrianglesSeen {
            corners: splat_corners(&self.corners, lane),
            normal: Vec3Lanes::splat_lane(&self.normal, lane),
            away: F::splat(self.away[lane]),
        }
    }
}

#[inline(always)]
fn splat_corners<F: Floats>([a, b, c]: &[Rows; 3], lane: usize) -> [Vec3Lanes<F>; 3] {
    [Vec3Lanes::splat_lane(a, lane), Vec3Lanes::splat_lane(b, lane), Vec3Lanes::splat_lane(c, lane)]
}

/// Shares of the three corners in the place where a line of `direction` meets the triangle of `corners`
/// relative to the line's origin; they add up to 1.
pub fn barycentric(corners: [Vec3; 3], direction: Vec3) -> [f32; 3] {
    let [a, b, c] = corners;
    let side = |from: Vec3, to: Vec3| (to - from).cross(from + to).dot(direction);
    let sides = [side(b, c), side(c, a), side(a, b)];
    let sum = sides[0] + sides[1] + sides[2];
    if sum == 0.0 { [1.0, 0.0, 0.0] } else { sides.map(|side| side / sum) }
}

pub fn bounds(corners: [Vec3; 3]) -> Aabb {
    Aabb::of_points(corners)
}

//! Triangles: flat between three corners, without gaps where they share an edge.

use super::RayLanes;
use crate::math::{Aabb, Floats, Vec3, Vec3Lanes, tangents};

pub struct Triangle;

/// Triangles as a kernel meets them: eight before one ray, or one before sixteen rays.
pub struct TriangleLanes<F> {
    /// Relative to the ray's origin.
    pub corners: [Vec3Lanes<F>; 3],
}

/// A ray as it meets triangles: with the plane across it, in which it is a point.
#[derive(Clone, Copy)]
pub struct LineLanes<F> {
    ray: RayLanes<F>,
    across: [Vec3Lanes<F>; 2],
}

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

impl<F: Floats> TriangleLanes<F> {
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
        let ray = &line.ray;
        let normal = b.minus(a).cross(a.minus(c));
        let distance = normal.dot(a) / normal.dot(ray.direction);
        // A ray in the triangle's plane gives NaN or infinity here, and fails the last tests.
        let is_hit = (zero.less_equal(least) | most.less_equal(zero))
            & ray.t_min.less_equal(distance)
            & distance.less(F::splat(f32::INFINITY));
        (distance, is_hit)
    }
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

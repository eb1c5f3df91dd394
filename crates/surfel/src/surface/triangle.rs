//! Triangles: flat between three corners, without gaps where they share an edge.

use super::RayLanes;
use crate::math::{Aabb, Floats, Vec3, Vec3Lanes};

pub struct Triangle;

/// Triangles as a kernel meets them: eight before one ray, or one before sixteen rays.
pub struct TriangleLanes<F> {
    /// Relative to the ray's origin.
    pub corners: [Vec3Lanes<F>; 3],
}

/// On which side of each edge a line passes, seen along it: of one sign where it meets the triangle. Each
/// is the share of the corner opposite, but for their sum.
struct Sides<F>([F; 3]);

impl<F: Floats> TriangleLanes<F> {
    /// Two-sided, and watertight as Woop, Benthin and Wald (2013) have it: a line that passes an edge has
    /// the same side of it, but for the sign, in both triangles that share it, as all that enters are the
    /// edge's ends relative to the ray's origin, and no rounding depends on their order. (In the form of
    /// Davidovic et al. 2012, which needs no axis to be chosen for each ray.)
    #[inline(always)]
    pub fn intersect(&self, ray: &RayLanes<F>) -> (F, F::Mask) {
        let [a, b, c] = self.corners;
        let edges = [c.minus(b), a.minus(c), b.minus(a)];
        let Sides([at_a, at_b, at_c]) = self.sides(&edges, ray.direction);
        let zero = F::splat(0.0);
        let least = at_a.min(at_b).min(at_c);
        let most = at_a.max(at_b).max(at_c);
        let normal = edges[2].cross(edges[1]);
        let distance = normal.dot(a) / normal.dot(ray.direction);
        // A ray in the triangle's plane gives NaN or infinity here, and fails the last tests.
        let is_hit = (zero.less_equal(least) | most.less_equal(zero))
            & ray.t_min.less_equal(distance)
            & distance.less(F::splat(f32::INFINITY));
        (distance, is_hit)
    }

    #[inline(always)]
    fn sides(&self, [bc, ca, ab]: &[Vec3Lanes<F>; 3], direction: Vec3Lanes<F>) -> Sides<F> {
        let [a, b, c] = self.corners;
        Sides([
            bc.cross(b.plus(c)).dot(direction),
            ca.cross(c.plus(a)).dot(direction),
            ab.cross(a.plus(b)).dot(direction),
        ])
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

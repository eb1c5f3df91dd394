//! Triangles: flat between three corners, without gaps where they share an edge.

use super::RayLanes;
use crate::math::{Aabb, Floats, LANES, Lanes, Vec3, Vec3Lanes};

pub struct Triangle;

/// What of triangles does not depend on rays.
#[derive(Clone, Copy)]
pub struct TriangleLanes<F> {
    corners: [Vec3Lanes<F>; 3],
    /// From each corner's successor to its predecessor: each lies opposite a corner.
    edges: [Vec3Lanes<F>; 3],
    /// Not of unit length.
    normal: Vec3Lanes<F>,
}

/// Triangles as rays from one place meet them: eight before one ray, or one before sixteen rays.
///
/// Two-sided, and watertight as Woop, Benthin and Wald (2013) have it: a line that passes an edge is on the
/// same side of it, but for the sign, in both triangles that share it, as all that enters are the edge's
/// ends, and no rounding depends on their order. (In the form of Davidovic et al. 2012, which needs no axis
/// to be chosen for each ray.)
#[derive(Clone, Copy)]
pub struct TrianglesSeen<F> {
    /// The sides of the pyramid over each triangle: a line's place among them are the shares of the corners
    /// opposite, but for their sum.
    sides: [Vec3Lanes<F>; 3],
    normal: Vec3Lanes<F>,
    /// The normal's share in the way to the triangle's plane.
    away: F,
}

impl<F: Floats> TriangleLanes<F> {
    #[inline(always)]
    pub fn new(corners: [Vec3Lanes<F>; 3]) -> Self {
        let [a, b, c] = corners;
        let edges = [c.minus(b), a.minus(c), b.minus(a)];
        Self { corners, edges, normal: edges[2].cross(edges[1]) }
    }

    #[inline(always)]
    pub fn seen_from(&self, origin: Vec3Lanes<F>) -> TrianglesSeen<F> {
        let [a, b, c] = self.corners;
        let (a, b, c) = (a.minus(origin), b.minus(origin), c.minus(origin));
        let [bc, ca, ab] = self.edges;
        TrianglesSeen {
            sides: [bc.cross(b.plus(c)), ca.cross(c.plus(a)), ab.cross(a.plus(b))],
            normal: self.normal,
            away: self.normal.dot(a),
        }
    }
}

impl<L: Lanes> TriangleLanes<L> {
    /// Row by row, to take single triangles from.
    #[inline(always)]
    pub fn store(&self) -> TriangleLanes<[f32; LANES]> {
        let [a, b, c] = self.corners;
        let [bc, ca, ab] = self.edges;
        TriangleLanes {
            corners: [rows(a), rows(b), rows(c)],
            edges: [rows(bc), rows(ca), rows(ab)],
            normal: rows(self.normal),
        }
    }
}

impl TriangleLanes<[f32; LANES]> {
    /// The triangle in `lane` before many rays.
    #[inline(always)]
    pub fn splat<F: Floats>(&self, lane: usize) -> TriangleLanes<F> {
        let [a, b, c] = &self.corners;
        let [bc, ca, ab] = &self.edges;
        TriangleLanes {
            corners: [in_all(a, lane), in_all(b, lane), in_all(c, lane)],
            edges: [in_all(bc, lane), in_all(ca, lane), in_all(ab, lane)],
            normal: in_all(&self.normal, lane),
        }
    }
}

impl<L: Lanes> TrianglesSeen<L> {
    /// Row by row, to take single triangles from.
    #[inline(always)]
    pub fn store(&self) -> TrianglesSeen<[f32; LANES]> {
        let [a, b, c] = self.sides;
        TrianglesSeen {
            sides: [rows(a), rows(b), rows(c)],
            normal: rows(self.normal),
            away: self.away.store(),
        }
    }
}

impl TrianglesSeen<[f32; LANES]> {
    /// The triangle in `lane` before many rays.
    #[inline(always)]
    pub fn splat<F: Floats>(&self, lane: usize) -> TrianglesSeen<F> {
        let [a, b, c] = &self.sides;
        TrianglesSeen {
            sides: [in_all(a, lane), in_all(b, lane), in_all(c, lane)],
            normal: in_all(&self.normal, lane),
            away: F::splat(self.away[lane]),
        }
    }
}

#[inline(always)]
fn rows<L: Lanes>(vector: Vec3Lanes<L>) -> Vec3Lanes<[f32; LANES]> {
    Vec3Lanes { x: vector.x.store(), y: vector.y.store(), z: vector.z.store() }
}

#[inline(always)]
fn in_all<F: Floats>(rows: &Vec3Lanes<[f32; LANES]>, lane: usize) -> Vec3Lanes<F> {
    Vec3Lanes { x: F::splat(rows.x[lane]), y: F::splat(rows.y[lane]), z: F::splat(rows.z[lane]) }
}

impl<F: Floats> TrianglesSeen<F> {
    /// Distances at and beyond the rays' `t_min`, and the lanes that are hit.
    #[inline(always)]
    pub fn intersect(&self, ray: &RayLanes<F>) -> (F, F::Mask) {
        let [a, b, c] = self.sides;
        let at = [a.dot(ray.direction), b.dot(ray.direction), c.dot(ray.direction)];
        let zero = F::splat(0.0);
        let least = at[0].min(at[1]).min(at[2]);
        let most = at[0].max(at[1]).max(at[2]);
        let distance = self.away / self.normal.dot(ray.direction);
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

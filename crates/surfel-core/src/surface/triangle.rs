//! Triangles: flat between three corners, without gaps at shared edges.

use super::shape::RayLanes;
use crate::math::{Aabb, Floats, LANES, Lanes, Vec3, Vec3Lanes, tangents};

/// The shape of a triangle.
pub struct Triangle;

/// Ray-independent triangle data.
#[derive(Clone, Copy)]
pub struct TriangleLanes<V> {
    corners: [V; 3],
    /// Cross product of two edges, not of unit length.
    normal: V,
}

/// Triangles relative to a ray origin: eight triangles for one ray, or one triangle for sixteen rays.
#[derive(Clone, Copy)]
pub struct RayRelativeTriangles<V, F> {
    /// Corners relative to the rays' origin.
    corners: [V; 3],
    /// Cross product of two edges, not of unit length.
    normal: V,
    /// Distance from the rays' origin to the triangle's plane, times the length of `normal`.
    plane_offset: F,
}

/// A ray with two axes perpendicular to it. Corners are projected along the ray onto the plane of these axes,
/// where the ray is the origin.
#[derive(Clone, Copy)]
pub struct RayFrame<F> {
    ray: RayLanes<F>,
    tangents: [Vec3Lanes<F>; 2],
}

/// Eight vectors in memory, one row per axis.
pub type StoredVec3Lanes = [[f32; LANES]; 3];

impl<F: Floats> RayFrame<F> {
    /// Returns `ray` with two axes perpendicular to its direction.
    #[inline(always)]
    pub fn new(ray: RayLanes<F>) -> Self {
        Self { ray, tangents: tangents(ray.direction) }
    }

    /// Projects a corner along the ray onto the plane of the two axes.
    #[inline(always)]
    fn project(&self, corner: Vec3Lanes<F>) -> (F, F) {
        (corner.dot(self.tangents[0]), corner.dot(self.tangents[1]))
    }
}

/// Returns the edge function at the origin: its sign tells on which side the edge passes.
#[inline(always)]
fn edge_function<F: Floats>(from: (F, F), to: (F, F)) -> F {
    from.0 * to.1 - from.1 * to.0
}

impl<F: Floats> TriangleLanes<Vec3Lanes<F>> {
    /// Computes the normals of triangles with these corners.
    #[inline(always)]
    pub fn new(corners: [Vec3Lanes<F>; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, normal: b.minus(a).cross(a.minus(c)) }
    }

    /// Returns the triangles relative to `origin`.
    #[inline(always)]
    pub fn relative_to(&self, origin: Vec3Lanes<F>) -> RayRelativeTriangles<Vec3Lanes<F>, F> {
        let [a, b, c] = self.corners;
        let corners = [a.minus(origin), b.minus(origin), c.minus(origin)];
        let plane_offset = self.normal.dot(corners[0]);
        RayRelativeTriangles { corners, normal: self.normal, plane_offset }
    }
}

impl<F: Floats> RayRelativeTriangles<Vec3Lanes<F>, F> {
    /// Returns the triangles relative to `origin`, which is given relative to their current origin.
    #[inline(always)]
    pub fn relative_to(&self, origin: Vec3Lanes<F>) -> Self {
        TriangleLanes { corners: self.corners, normal: self.normal }.relative_to(origin)
    }

    /// Returns the hit distance in each lane, at least the ray's `t_min`, and the mask of the lanes that are
    /// hit.
    ///
    /// The test is two-sided, and watertight after Woop, Benthin and Wald (2013): all triangles that share a
    /// corner project it to the same point, and the sign of the edge function between two such points is
    /// exact or zero, because the greater of two products is never rounded below the other. Tangents replace
    /// their axes, which have to be chosen for each ray. Edge functions from cross products of edges
    /// (Davidovic et al. 2012) agree at shared edges but not at shared corners: rounding can let a ray pass
    /// all edges around a corner on their outer side.
    #[inline(always)]
    pub fn intersect(&self, frame: &RayFrame<F>) -> (F, F::Mask) {
        let [a, b, c] = self.corners;
        let (a, b, c) = (frame.project(a), frame.project(b), frame.project(c));
        let edges = [edge_function(b, c), edge_function(c, a), edge_function(a, b)];
        let zero = F::splat(0.0);
        let min = edges[0].min(edges[1]).min(edges[2]);
        let max = edges[0].max(edges[1]).max(edges[2]);
        let distance = self.plane_offset / self.normal.dot(frame.ray.direction);
        // A ray in the triangle's plane gives NaN or infinity here, and fails the last tests.
        let is_hit = (zero.le(min) | max.le(zero))
            & frame.ray.t_min.le(distance)
            & distance.lt(F::splat(f32::INFINITY));
        (distance, is_hit)
    }
}

impl<L: Lanes> RayRelativeTriangles<Vec3Lanes<L>, L> {
    /// Stores the triangles in memory, so that `splat` can take single ones.
    #[inline(always)]
    pub fn store(&self) -> RayRelativeTriangles<StoredVec3Lanes, [f32; LANES]> {
        let [a, b, c] = self.corners;
        RayRelativeTriangles {
            corners: [a.store(), b.store(), c.store()],
            normal: self.normal.store(),
            plane_offset: self.plane_offset.store(),
        }
    }
}

impl RayRelativeTriangles<StoredVec3Lanes, [f32; LANES]> {
    /// Returns the triangle of `lane` in every lane.
    #[inline(always)]
    pub fn splat<F: Floats>(&self, lane: usize) -> RayRelativeTriangles<Vec3Lanes<F>, F> {
        RayRelativeTriangles {
            corners: splat_corners(&self.corners, lane),
            normal: Vec3Lanes::splat_lane(&self.normal, lane),
            plane_offset: F::splat(self.plane_offset[lane]),
        }
    }
}

#[inline(always)]
fn splat_corners<F: Floats>([a, b, c]: &[StoredVec3Lanes; 3], lane: usize) -> [Vec3Lanes<F>; 3] {
    [Vec3Lanes::splat_lane(a, lane), Vec3Lanes::splat_lane(b, lane), Vec3Lanes::splat_lane(c, lane)]
}

/// Returns the barycentric coordinates of the point where the line along `direction` intersects the triangle.
/// `corners` are relative to the line's origin. The coordinates add up to 1.
pub fn barycentrics(corners: [Vec3; 3], direction: Vec3) -> [f32; 3] {
    let [a, b, c] = corners;
    let edge_function = |from: Vec3, to: Vec3| (to - from).cross(from + to).dot(direction);
    let edges = [edge_function(b, c), edge_function(c, a), edge_function(a, b)];
    let sum = edges[0] + edges[1] + edges[2];
    if sum == 0.0 { [1.0, 0.0, 0.0] } else { edges.map(|edge| edge / sum) }
}

/// Returns the bounding box of a triangle.
pub fn bounds(corners: [Vec3; 3]) -> Aabb {
    Aabb::of_points(corners)
}

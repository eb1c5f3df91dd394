//! The interface between kernels and the shape of a single point.

#[cfg(test)]
use crate::math::Vec3;
use crate::math::{Floats, Ray, Vec3Lanes};

/// The largest absolute component of every stored point normal. Stored normals have integer components and
/// are not of unit length.
pub const MAX_NORMAL_COMPONENT: f32 = 511.0;

/// Points in the lanes of a kernel: eight points for one ray, or one point for sixteen rays.
pub struct PointLanes<F> {
    /// Centres relative to the ray's origin.
    pub center: Vec3Lanes<F>,
    /// Normals with integer components of at most `MAX_NORMAL_COMPONENT`.
    pub normal: Vec3Lanes<F>,
    /// Radii in the units of the centres.
    pub radius: F,
}

/// A ray spread over lanes. Its origin is the zero of the points' centres.
#[derive(Clone, Copy)]
pub struct RayLanes<F> {
    /// Unit direction.
    pub direction: Vec3Lanes<F>,
    /// The distance before which hits are ignored.
    pub t_min: F,
}

impl<F: Floats> RayLanes<F> {
    /// Returns `ray` in every lane.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        Self { direction: Vec3Lanes::splat(ray.direction), t_min: F::splat(ray.t_min) }
    }
}

/// The shape of a single point.
pub trait Shape {
    /// Returns the hit distance in each lane, at least `t_min`, and the mask of the lanes that are hit.
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask);
}

/// Returns the distance at which a ray hits the shape of one point.
#[cfg(test)]
pub(super) fn hit<S: Shape>(center: Vec3, normal: Vec3, radius: f32, ray: &Ray) -> Option<f32> {
    let center = Vec3Lanes::splat(center - ray.origin);
    let points = PointLanes { center, normal: Vec3Lanes::splat(normal), radius };
    let (distance, is_hit) = S::intersect::<f32>(&points, &RayLanes::new(ray));
    is_hit.then_some(distance)
}

//! Signed distance fields (SDFs), scenes of them, and sphere tracing.

use crate::classes::UNCLASSIFIED;
use surfel_core::math::DVec3;
use surfel_core::math::Vec3;

/// A signed distance field with colours. Points are in its own frame, in metres, with Z up.
pub trait Sdf: Send + Sync {
    /// Returns the signed distance to the surface, negative inside. Outside it may be too short, but never much too long.
    fn distance(&self, point: DVec3) -> f64;

    /// Returns the sRGB-encoded colour of the surface in [0, 1]. `normal` is in world space.
    fn color(&self, point: DVec3, normal: DVec3) -> Vec3;

    /// Returns a box that contains the surface.
    fn bounds(&self) -> DAabb;

    /// Returns the ASPRS class; the default is 1, unclassified.
    fn class(&self) -> u8 {
        UNCLASSIFIED
    }
}

/// An axis-aligned box in double precision, which may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DAabb {
    /// Corner of the lowest coordinates.
    pub min: DVec3,
    /// Corner of the highest coordinates.
    pub max: DVec3,
}

/// A ray in double precision.
#[derive(Clone, Copy, Debug)]
pub struct DRay {
    /// Origin of the ray.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// The first surface along a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SdfHit {
    /// Distance along the ray in metres.
    pub distance: f64,
    /// Index of the SDF in its scene.
    pub part_idx: usize,
}

/// A scene of signed distance fields.
#[derive(Default)]
pub struct SdfScene {
    parts: Vec<(DAabb, Box<dyn Sdf>)>,
}

impl SdfScene {
    /// Adds an SDF. Rays test SDFs in this order, so large ground should come last, as most rays end before it.
    pub fn add(&mut self, sdf: impl Sdf + 'static) {
        self.parts.push((sdf.bounds(), Box::new(sdf)));
    }

    /// Returns the scene with another SDF.
    #[cfg(test)]
    pub fn with(mut self, sdf: impl Sdf + 'static) -> Self {
        self.add(sdf);
        self
    }

    /// Returns the number of SDFs.
    pub fn n_parts(&self) -> usize {
        self.parts.len()
    }

    /// Returns an SDF by its index.
    pub fn part(&self, part_idx: usize) -> &dyn Sdf {
        &*self.parts[part_idx].1
    }

    /// Returns the signed distance to the nearest SDF.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.parts.iter().map(|(_, sdf)| sdf.distance(point)).fold(f64::INFINITY, f64::min)
    }

    /// Finds the first surface along `ray` nearer than `max_range`.
    pub fn first_hit(&self, ray: &DRay, max_range: f64) -> Option<SdfHit> {
        let mut nearest = None;
        let mut limit = max_range;
        for (part_idx, (bounds, sdf)) in self.parts.iter().enumerate() {
            let Some((enter, leave)) = bounds.span(ray, limit) else { continue };
            if let Some(distance) = sphere_trace(&**sdf, ray, enter, leave) {
                limit = distance;
                nearest = Some(SdfHit { distance, part_idx });
            }
        }
        nearest
    }

    /// Returns true if no surface lies between `viewpoint` and `point` on a surface.
    pub fn is_visible_from(&self, viewpoint: DVec3, point: DVec3) -> bool {
        const TOLERANCE: f64 = 0.02;
        let offset = point - viewpoint;
        let distance = offset.length();
        let ray = DRay { origin: viewpoint, direction: offset / distance };
        self.first_hit(&ray, distance - TOLERANCE).is_none()
    }

    /// Returns the unit normal of an SDF's surface: the gradient of the distance, by differences over 2 mm.
    pub fn normal(&self, part_idx: usize, point: DVec3) -> DVec3 {
        let corners = [
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, 1.0, 1.0),
        ];
        let sdf = self.part(part_idx);
        let sum = |sum, corner: DVec3| sum + corner * sdf.distance(point + 0.002 * corner);
        corners.into_iter().fold(DVec3::ZERO, sum).try_normalize().unwrap_or(DVec3::Z)
    }
}

impl DAabb {
    /// The box that contains everything.
    pub const EVERYWHERE: Self = Self { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };

    /// Creates a box from its centre and half its size.
    pub fn around(center: DVec3, half: DVec3) -> Self {
        Self { min: center - half, max: center + half }
    }

    /// Returns the eight corners.
    pub fn corners(self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |bit: usize, low, high| if i & bit == 0 { low } else { high };
            DVec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            )
        })
    }

    /// Returns the distance from `point` to the box, 0 inside.
    pub fn distance(self, point: DVec3) -> f64 {
        (self.min - point).max(point - self.max).max(DVec3::ZERO).length()
    }

    /// Returns the distances from 0 to `limit` at which `ray` enters and leaves the box, if it does.
    fn span(&self, ray: &DRay, limit: f64) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0f64, limit);
        for axis in 0..3 {
            let inverse = 1.0 / ray.direction[axis];
            let a = (self.min[axis] - ray.origin[axis]) * inverse;
            let b = (self.max[axis] - ray.origin[axis]) * inverse;
            // A ray within a face gives NaN, which `min` and `max` ignore.
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter < leave).then_some((enter, leave))
    }
}

/// Finds the distance to the surface by sphere tracing (Hart, Sphere Tracing, 1996).
fn sphere_trace(sdf: &dyn Sdf, ray: &DRay, enter: f64, leave: f64) -> Option<f64> {
    // Steps along a grazing ray get short; a ray without a hit after this many is dropped.
    const MAX_STEPS: usize = 300;
    let mut t = enter;
    for _ in 0..MAX_STEPS {
        let distance = sdf.distance(ray.origin + t * ray.direction);
        if distance.abs() < 1e-5 * (1.0 + t) {
            return Some(t);
        }
        // Where wear is steeper than assumed, a step may pass through the surface; the next step goes back.
        t += distance;
        if t < enter || leave < t {
            return None;
        }
    }
    None
}

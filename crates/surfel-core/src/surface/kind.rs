//! The surface kinds of a point cloud.

use super::capsule;
use super::disc;
use super::leaves;
use super::mls;
use super::smooth;
use super::sphere;
use crate::error::Error;
use crate::math::{Aabb, Ray, Vec3};

/// The height of the origin of secondary rays above spheres, capsules and leaves, in radii.
pub const SOLID_SPAWN_OFFSET: f32 = 1e-3;
/// Rounding of a hit on a solid shape, relative to the largest coordinate on the way there: a far sphere is hit with the
/// error of the distance.
pub const SOLID_ROUNDING: f32 = 16.0 * f32::EPSILON;

/// The shape given to the points of a cloud (Wiesmeier, Ray Tracing Point Clouds, 2011).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SurfaceKind {
    /// Each point is rasterised as a round spot of some pixels.
    Points,
    /// Each point is a sphere of its radius.
    Sphere,
    /// Each point is a flat disc.
    Disc,
    /// All discs within one radius behind the nearest are blended, with normals as stored.
    SplatMean,
    /// All discs within one radius behind the nearest are blended, with normals first turned to one side, by the rule
    /// `Align`.
    Splat,
    /// Discs of twice the radius are blended, the 16 on the ray that are nearest to the hit; the normal is that of a plane
    /// fitted to their centres. It needs no normals: without them discs face the ray.
    SplatFit,
    /// A ray is a cylinder: position, normal and colour are means over all points in a short part of it behind the
    /// first disc that it pierces (Schaufler and Jensen, Ray Tracing Point Sampled Geometry, 2000).
    Cylinder,
    /// Moving least squares: planes and polynomials are fitted to the points around each position (Adamson and Alexa,
    /// Approximating and Intersecting Surfaces from Points, 2003). It needs no normals.
    Mls,
    /// Spheres are fitted to the points around each position (Guennebaud and Gross, Algebraic Point Set Surfaces,
    /// 2007): one smooth surface for rays of all kinds.
    #[default]
    Smooth,
    /// The zeros of the mean distance from the planes of the points around each position (Wald and Seidel, Interactive
    /// Ray Tracing of Point-based Models, 2005), found in a kd-tree of their own.
    Implicit,
    /// The field of `Implicit` at the corners of an octree's cells, linear in each axis between them (Kashyap, Goradia,
    /// Chaudhuri and Chandran, Implicit Surface Octrees for Ray Tracing Point Models, 2010).
    Octree,
    /// A plane in each cell of an octree: the splat octree of the same authors.
    OctreeSplat,
    /// Each point is a trained Gaussian, which emits the light that it was trained with (Moenne-Loccoz et al., 3D Gaussian
    /// Ray Tracing, 2024). It needs the columns of trained files.
    Gaussian,
    /// Each point is a short thick line along its normal. The points of lines have this kind, whatever the kind of
    /// their cloud's surface is.
    Capsule,
    /// Each point is a cluster of small discs. The scattered points of plants have this kind, those of other clouds are
    /// spheres, whatever the kind of their cloud's surface is.
    Leaves,
}

impl SurfaceKind {
    /// The kinds of surface that a cloud can be given, with their names.
    pub const ALL: [(&'static str, Self); 13] = [
        ("points", Self::Points),
        ("sphere", Self::Sphere),
        ("disc", Self::Disc),
        ("splat-mean", Self::SplatMean),
        ("splat", Self::Splat),
        ("splat-fit", Self::SplatFit),
        ("cylinder", Self::Cylinder),
        ("mls", Self::Mls),
        ("smooth", Self::Smooth),
        ("implicit", Self::Implicit),
        ("octree", Self::Octree),
        ("octree-splat", Self::OctreeSplat),
        ("gaussian", Self::Gaussian),
    ];

    /// Returns the name that `from_str` parses, or one that it rejects for a kind that no cloud can be given.
    pub fn name(self) -> &'static str {
        match self {
            Self::Capsule => "capsule",
            Self::Leaves => "leaves",
            _ => Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name),
        }
    }

    /// Returns the factor that multiplies the points' radii before tracing, unless options choose another one.
    pub fn radius_factor(self) -> f32 {
        match self {
            Self::SplatFit => 2.0,
            Self::Mls => mls::DEFAULT_REACH / mls::SUPPORT_FACTOR,
            _ => 1.0,
        }
    }

    /// Returns true if an option can choose how far from a ray or a position points count.
    pub fn has_reach(self) -> bool {
        matches!(self, Self::SplatFit | Self::Cylinder | Self::Mls)
    }

    /// Returns true if points are discs with normals rather than spheres or balls.
    pub fn uses_discs(self) -> bool {
        !matches!(
            self,
            Self::Points | Self::Sphere | Self::Mls | Self::Capsule | Self::Leaves | Self::Gaussian
        )
    }

    /// Returns true if the shape of the points depends on their normals.
    pub fn needs_normals(self) -> bool {
        (self.uses_discs() && self != Self::SplatFit) || self == Self::Capsule
    }

    /// Returns true if the points describe a surface between them, rather than each one for itself.
    pub fn is_continuous(self) -> bool {
        self.uses_discs() || self == Self::Mls
    }

    /// Returns true if all discs near the nearest one contribute to a hit.
    pub fn blends_discs(self) -> bool {
        matches!(self, Self::SplatMean | Self::Splat | Self::SplatFit | Self::Cylinder)
    }

    /// Returns the bounding box of a point of this kind. `normal` has unit length.
    pub fn bounds(self, center: Vec3, normal: Vec3, radius: f32) -> Aabb {
        match self {
            Self::Points | Self::Sphere | Self::Mls | Self::Gaussian => {
                sphere::bounds(center, radius)
            }
            Self::Capsule => capsule::bounds(center, normal, radius),
            Self::Leaves => sphere::bounds(center, leaves::REACH * radius),
            _ => disc::bounds(center, normal, radius),
        }
    }

    /// Returns the distance before which secondary rays ignore hits, in radii; 1 for spheres, where they ignore none.
    pub fn spawn_distance(self) -> f32 {
        match self {
            Self::Smooth | Self::Implicit => smooth::SPAWN_T_MIN,
            Self::Mls => mls::SPAWN_T_MIN,
            _ if self.uses_discs() => disc::SPAWN_T_MIN,
            _ => 1.0,
        }
    }

    /// Returns the rate at which the skipped distance of rays toward lights shrinks with their cosine to the normal, or
    /// 0 if all skip the spawn distance.
    pub fn light_steepness(self) -> f32 {
        match self {
            Self::Smooth | Self::Implicit => smooth::LIGHT_STEEPNESS,
            _ => 0.0,
        }
    }

    /// Returns a ray that leaves the surface at `position` on the side of `normal` without hitting it again
    /// at once.
    ///
    /// Discs overlap within about a radius of each other, so the ray skips their own neighbourhood
    /// (Schaufler and Jensen 2000). Spheres are solid and need an offset for the rounding of f32 only.
    /// `magnitude` is the largest coordinate of the position and of the origin of the ray that found it.
    pub fn spawn_ray(
        self,
        position: Vec3,
        magnitude: f32,
        normal: Vec3,
        radius: f32,
        direction: Vec3,
    ) -> Ray {
        let t_min = if self.is_continuous() { self.spawn_distance() * radius } else { 0.0 };
        let of_position = 4.0 * f32::EPSILON * position.abs().max_element();
        let (offset, rounding) = match self {
            Self::Smooth | Self::Implicit => (smooth::SPAWN_OFFSET, of_position),
            Self::Mls => (mls::SPAWN_OFFSET, of_position),
            _ if self.uses_discs() => (disc::SPAWN_OFFSET, of_position),
            _ => (SOLID_SPAWN_OFFSET, SOLID_ROUNDING * magnitude),
        };
        let offset = offset * radius;
        let origin = position + (offset + rounding) * normal;
        Ray { origin, t_min, direction, t_max: f32::INFINITY }
    }
}

impl std::str::FromStr for SurfaceKind {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::ALL.iter().find(|(name, _)| *name == text);
        known.map(|(_, kind)| *kind).ok_or_else(|| Error::UnknownName {
            kind: "surface",
            found: text.to_owned(),
            known: Self::ALL.map(|(name, _)| name).join(", "),
        })
    }
}

#[cfg(test)]
mod tests {
    //! Rays that begin on shapes.

    use super::*;
    use crate::math::Random;
    use crate::surface::shape::hit;
    use crate::surface::sphere::Sphere;

    #[test]
    fn small_spheres_seen_from_afar_do_not_shade_themselves() {
        let mut random = Random::new(12, 0);
        for (radius, distance) in [(0.05, 2000.0), (0.02, 500.0), (0.3, 5000.0), (0.05, 5.0)] {
            let mut vector =
                || Vec3::from_array(std::array::from_fn(|_| 2.0 * random.next_f32() - 1.0));
            let mut n_hits = 0;
            for _ in 0..2000 {
                let (center, from) = (vector(), vector().normalize());
                let origin = center + distance * from;
                let target = center + 0.9 * radius * vector();
                let ray = Ray::new(origin, (target - origin).normalize());
                let Some(distance) = hit::<Sphere>(center, Vec3::ZERO, radius, &ray) else {
                    continue;
                };
                n_hits += 1;
                let position = ray.at(distance);
                let normal = (position - center).normalize();
                let sun = (normal + 0.7 * vector().normalize()).normalize();
                let magnitude = position.abs().max(origin.abs()).max_element();
                let to_sun =
                    SurfaceKind::Sphere.spawn_ray(position, magnitude, normal, radius, sun);
                assert_eq!(
                    hit::<Sphere>(center, Vec3::ZERO, radius, &to_sun),
                    None,
                    "{radius} {distance}"
                );
            }
            assert!(1000 < n_hits, "{n_hits}");
        }
    }
}

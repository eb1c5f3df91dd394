//! Surface kinds: what a ray meets where the points are; one file each.

mod boundary;
mod disc;
mod sphere;
mod splat;
pub mod triangle;

pub use boundary::{Candidate, Candidates, NEIGHBOR_REACH, Surroundings, Verdicts};
pub use disc::Disc;
pub use sphere::Sphere;
pub use splat::{Blend, Gathered, MAX_GATHERED, gather_limit, plane_normal};
pub use triangle::{LineLanes, Triangle, TriangleLanes, TrianglesSeen};

use crate::error::Error;
use crate::math::{Aabb, Floats, Ray, Vec3, Vec3Lanes};

/// The shape given to the points of a cloud (Wiesmeier, Ray Tracing Point Clouds, 2011).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum SurfaceKind {
    /// One pixel a point, rasterised.
    Points,
    /// Spheres of the points' radii.
    Sphere,
    /// Flat discs.
    Disc,
    /// All discs within one radius behind the nearest, normals blended as stored.
    SplatMean,
    /// The same, each normal first turned toward the ray's origin.
    #[default]
    Splat,
    /// The same over twice the radius, the normal of a plane fitted to the gathered points.
    SplatFit,
}

/// Whether hits at which the points do not surround the ray are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Boundary {
    /// Discs count to their rim.
    Off,
    /// The angular-gap test: a hit beyond the outermost points is refused and the search goes on.
    #[default]
    Gap,
}

impl SurfaceKind {
    pub const ALL: [(&'static str, Self); 6] = [
        ("points", Self::Points),
        ("sphere", Self::Sphere),
        ("disc", Self::Disc),
        ("splat-mean", Self::SplatMean),
        ("splat", Self::Splat),
        ("splat-fit", Self::SplatFit),
    ];

    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// What the points' radii are multiplied by before tracing.
    pub fn radius_factor(self) -> f32 {
        if self == Self::SplatFit { 2.0 } else { 1.0 }
    }

    /// Whether points are discs with normals, rather than spheres.
    pub fn is_oriented(self) -> bool {
        !matches!(self, Self::Points | Self::Sphere)
    }

    /// Whether all discs near the first one contribute to a hit.
    pub fn is_gathered(self) -> bool {
        matches!(self, Self::SplatMean | Self::Splat | Self::SplatFit)
    }

    /// The box of a point of this kind.
    pub fn bounds(self, center: Vec3, normal: Vec3, radius: f32) -> Aabb {
        if self.is_oriented() {
            disc::bounds(center, normal, radius)
        } else {
            sphere::bounds(center, radius)
        }
    }

    /// A ray that leaves the surface at `position` on the side of `normal` and does not meet it again at once.
    ///
    /// Discs overlap within about a radius of each other, so their own neighbourhood is left out
    /// (Schaufler and Jensen 2000); spheres are solid and need only the rounding of f32.
    pub fn spawn_ray(self, position: Vec3, normal: Vec3, radius: f32, direction: Vec3) -> Ray {
        let rounding = 4.0 * f32::EPSILON * position.abs().max_element();
        let (offset, t_min) = if self.is_oriented() {
            (disc::SPAWN_OFFSET * radius, disc::SPAWN_T_MIN * radius)
        } else {
            (1e-3 * radius, 0.0)
        };
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

impl std::str::FromStr for Boundary {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "gap" => Ok(Self::Gap),
            "off" => Ok(Self::Off),
            _ => Err(Error::Setting {
                name: "boundary",
                found: text.to_owned(),
                expected: "gap or off",
            }),
        }
    }
}

/// The longest axis of the normals of points, which are whole numbers.
pub const NORMAL_MAX: f32 = 511.0;

/// Points as a kernel meets them: eight before one ray, or one before sixteen rays.
pub struct PointLanes<F> {
    /// Relative to the ray's origin.
    pub center: Vec3Lanes<F>,
    /// Whole numbers, `NORMAL_MAX` the greatest.
    pub normal: Vec3Lanes<F>,
    pub radius: F,
}

/// A ray spread over lanes; its origin is where the points' centres are relative to.
#[derive(Clone, Copy)]
pub struct RayLanes<F> {
    pub direction: Vec3Lanes<F>,
    pub t_min: F,
}

impl<F: Floats> RayLanes<F> {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        Self { direction: Vec3Lanes::splat(ray.direction), t_min: F::splat(ray.t_min) }
    }
}

/// How a ray meets the shape of a single point.
pub trait Shape {
    /// Distances at and beyond the ray's `t_min`, and the lanes that are hit.
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask);
}

//! Splats: the discs close behind the nearest one, blended into a smooth surface (Wiesmeier 2011, 'multi').

use super::align::Align;
use super::kind::SurfaceKind;
use crate::math::{Floats, Vec3, Vec3Lanes};

/// Maximum number of discs blended at a hit. If there are more, the nearest are kept.
pub const MAX_GATHERED: usize = 16;
/// Maximum number of discs from which those of a hit of `Cylinder` or `SplatFit` are taken. If there are more, the nearest
/// along the ray are kept: points that lie thousands over each other cost no more.
pub const MAX_CANDIDATES: usize = 128;

/// Minimum weight of a disc, at its rim.
pub const MIN_DISC_WEIGHT: f32 = 1e-4;

/// A point of a cloud as a disc with colour.
#[derive(Clone, Copy, Debug)]
pub struct Surfel {
    /// Centre in the cloud's coordinates.
    pub center: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Radius in the units of the centre.
    pub radius: f32,
    /// Linear RGB colour.
    pub color: Vec3,
}

/// Returns the maximum distance gathered after a disc of `radius` is hit at `distance`. The limit of a ray is
/// the minimum over all its hits, which does not depend on their order.
#[inline(always)]
pub fn gather_limit<T: std::ops::Add<Output = T>>(distance: T, radius: T) -> T {
    distance + radius
}

/// The nearest disc of rays, one per lane.
#[derive(Clone, Copy)]
pub struct NearestDisc<F> {
    /// Distance along the ray.
    pub distance: F,
    /// Centre in the cloud's coordinates.
    pub center: Vec3Lanes<F>,
    /// Unit normal.
    pub normal: Vec3Lanes<F>,
}

/// Accumulates the weighted mean of disc normals and colours, one ray per lane and one disc at a time, and for
/// `Cylinder` of their distances.
pub struct SplatAccumulator<F> {
    kind: SurfaceKind,
    align: Align,
    direction: Vec3Lanes<F>,
    /// The nearest disc, its normal flipped toward the ray's origin.
    nearest: NearestDisc<F>,
    normal: Vec3Lanes<F>,
    color: Vec3Lanes<F>,
    /// Distances behind the nearest disc.
    depth: F,
    total_weight: F,
}

/// The weighted means of rays' discs, one ray per lane.
pub struct Blend<F> {
    /// Distance along the ray.
    pub distance: F,
    /// Unit normal, which faces the ray's origin.
    pub normal: Vec3Lanes<F>,
    /// Linear colour.
    pub color: Vec3Lanes<F>,
}

impl<F: Floats> SplatAccumulator<F> {
    /// Returns an empty accumulator. `align` is the rule of `Splat`.
    #[inline(always)]
    pub fn new(
        kind: SurfaceKind,
        align: Align,
        nearest: &NearestDisc<F>,
        direction: Vec3Lanes<F>,
    ) -> Self {
        let (none, zero) = (Vec3Lanes::splat(Vec3::ZERO), F::splat(0.0));
        let normal = flip_to_hemisphere(nearest.normal, none.minus(direction));
        let nearest = NearestDisc { normal, ..*nearest };
        Self {
            kind,
            align,
            direction,
            nearest,
            normal: none,
            color: none,
            depth: zero,
            total_weight: zero,
        }
    }

    /// Adds a disc to the lanes of the rays that hit it, at `distance` along the ray and `offset` from its centre.
    #[inline(always)]
    pub fn add(&mut self, disc: &Surfel, distance: F, offset: Vec3Lanes<F>, is_hit: F::Mask) {
        let zero = F::splat(0.0);
        let nearness = F::splat(1.0) - offset.dot(offset).sqrt() / F::splat(disc.radius);
        let weight = F::select(is_hit, nearness.max(F::splat(MIN_DISC_WEIGHT)), zero);
        let normal = Vec3Lanes::splat(disc.normal);
        let sign = match self.kind {
            SurfaceKind::Splat => {
                let chord = Vec3Lanes::splat(disc.center).minus(self.nearest.center);
                let (nearest, direction) = (self.nearest.normal, self.direction);
                let is_opposed = self.align.is_opposed(normal, nearest, chord, direction);
                F::select(is_opposed, zero - weight, weight)
            }
            SurfaceKind::Cylinder => {
                let depth = F::select(is_hit, distance - self.nearest.distance, zero);
                self.depth = self.depth + weight * depth;
                F::select(zero.lt(normal.dot(self.direction)), zero - weight, weight)
            }
            _ => weight,
        };
        self.normal = self.normal.plus(normal.scaled(sign));
        self.color = self.color.plus(Vec3Lanes::splat(disc.color).scaled(weight));
        self.total_weight = self.total_weight + weight;
    }

    /// Returns the means. The normal of `SplatFit` is that of the nearest disc: the caller replaces it by
    /// that of a plane where the discs' centres span one.
    #[inline(always)]
    pub fn finish(self) -> Blend<F> {
        let per_weight = F::splat(1.0) / self.total_weight;
        let nearest = self.nearest.normal;
        // Opposite normals may cancel in splat-mean; the normal of the nearest disc is then as good as any.
        let normal = match self.kind {
            SurfaceKind::Splat => {
                clamp_to_visible(normalize_or(self.normal, nearest), self.direction)
            }
            SurfaceKind::SplatFit => nearest,
            _ => {
                let toward = Vec3Lanes::splat(Vec3::ZERO).minus(self.direction);
                flip_to_hemisphere(normalize_or(self.normal, nearest), toward)
            }
        };
        let distance = self.nearest.distance;
        let is_mean = self.kind == SurfaceKind::Cylinder;
        let distance = if is_mean { distance + self.depth * per_weight } else { distance };
        Blend { distance, normal, color: self.color.scaled(per_weight) }
    }
}

/// Returns `normal` or its negative, whichever lies in the hemisphere of `guide`.
#[inline(always)]
fn flip_to_hemisphere<F: Floats>(normal: Vec3Lanes<F>, guide: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let zero = F::splat(0.0);
    let sign = F::select(normal.dot(guide).lt(zero), F::splat(-1.0), F::splat(1.0));
    normal.scaled(sign)
}

/// Returns `vector` at unit length, or `fallback` if its length is close to zero.
#[inline(always)]
fn normalize_or<F: Floats>(vector: Vec3Lanes<F>, fallback: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let squared = vector.dot(vector);
    let has_length = F::splat(1e-30).lt(squared);
    let unit = vector.scaled(F::splat(1.0) / squared.sqrt());
    Vec3Lanes::select(has_length, unit, fallback)
}

/// Returns the nearest normal that does not face away from the ray. Beyond a bend, a mean normal can lean away a
/// little; flipped, it would point inward.
#[inline(always)]
fn clamp_to_visible<F: Floats>(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let along = normal.dot(direction);
    let toward = Vec3Lanes::splat(Vec3::ZERO).minus(direction);
    let perpendicular = normalize_or(normal.minus(direction.scaled(along)), toward);
    Vec3Lanes::select(F::splat(0.0).lt(along), perpendicular, normal)
}

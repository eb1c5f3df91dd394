//! Splats: the discs close behind the nearest one, blended into a smooth surface (Wiesmeier 2011, 'multi').

use super::kind::SurfaceKind;
use crate::math::{DVec3, Floats, SymmetricMatrix, Vec3, Vec3Lanes, smallest_eigenvector};

/// Minimum ratio of the second to the largest eigenvalue of points that span a plane.
pub const MIN_PLANE_RATIO: f64 = 1e-4;
/// Maximum number of discs blended at a hit. If there are more, the nearest are kept.
pub const MAX_GATHERED: usize = 16;

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

/// Accumulates the weighted mean of disc normals and colours, one ray per lane and one disc at a time.
///
/// Wiesmeier flips each normal toward the ray's origin on its own. At a silhouette that turns the discs behind
/// the bend inside out. Here the normal of the nearest disc is flipped, and the others follow it.
pub struct SplatAccumulator<F> {
    kind: SurfaceKind,
    direction: Vec3Lanes<F>,
    /// Normal of the nearest disc, flipped toward the ray's origin.
    nearest: Vec3Lanes<F>,
    normal: Vec3Lanes<F>,
    color: Vec3Lanes<F>,
    total_weight: F,
}

impl<F: Floats> SplatAccumulator<F> {
    /// Returns an empty accumulator. `nearest` is the unit normal of the nearest disc on each ray.
    #[inline(always)]
    pub fn new(kind: SurfaceKind, nearest: Vec3Lanes<F>, direction: Vec3Lanes<F>) -> Self {
        let zero = Vec3Lanes::splat(Vec3::ZERO);
        let nearest = flip_to_hemisphere(nearest, zero.minus(direction));
        Self { kind, direction, nearest, normal: zero, color: zero, total_weight: F::splat(0.0) }
    }

    /// Adds a disc to the lanes of the rays that hit it, at `offset` from its centre.
    #[inline(always)]
    pub fn add(&mut self, disc: &Surfel, offset: Vec3Lanes<F>, is_hit: F::Mask) {
        let zero = F::splat(0.0);
        let nearness = F::splat(1.0) - offset.dot(offset).sqrt() / F::splat(disc.radius);
        let weight = F::select(is_hit, nearness.max(F::splat(1e-4)), zero);
        let normal = Vec3Lanes::splat(disc.normal);
        let sign = if self.kind == SurfaceKind::Splat {
            let is_opposed = normal.dot(self.nearest).lt(zero);
            F::select(is_opposed, zero - weight, weight)
        } else {
            weight
        };
        self.normal = self.normal.plus(normal.scaled(sign));
        self.color = self.color.plus(Vec3Lanes::splat(disc.color).scaled(weight));
        self.total_weight = self.total_weight + weight;
    }

    /// Returns the unit normal, which faces the ray's origin, and the colour. The normal of `SplatFit` is that
    /// of the nearest disc: the caller replaces it by `fit_plane_normal` where that has a result.
    #[inline(always)]
    pub fn finish(self) -> (Vec3Lanes<F>, Vec3Lanes<F>) {
        let color = self.color.scaled(F::splat(1.0) / self.total_weight);
        // Opposite normals may cancel in splat-mean; the normal of the nearest disc is then as good as any.
        let normal = match self.kind {
            SurfaceKind::Splat => {
                clamp_to_visible(normalize_or(self.normal, self.nearest), self.direction)
            }
            SurfaceKind::SplatFit => self.nearest,
            _ => {
                let toward = Vec3Lanes::splat(Vec3::ZERO).minus(self.direction);
                flip_to_hemisphere(normalize_or(self.normal, self.nearest), toward)
            }
        };
        (normal, color)
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

/// Returns a unit normal, of either sign, of the plane fitted to `points`, or none if they do not span a plane.
pub fn fit_plane_normal(points: &[Vec3]) -> Option<Vec3> {
    let relative = |point: &Vec3| (*point - points[0]).as_dvec3();
    let mean = points.iter().map(relative).sum::<DVec3>() / points.len() as f64;
    let mut covariance = SymmetricMatrix::default();
    for point in points {
        covariance.add_outer(relative(point) - mean, 1.0);
    }
    let (normal, values) = smallest_eigenvector(&covariance);
    // Fewer than three points, or points on a line, leave the second eigenvalue at zero.
    (MIN_PLANE_RATIO * values[2] < values[1]).then(|| normal.as_vec3())
}

//! Splats: the discs just behind the first one blended into a smooth surface (Wiesmeier 2011, 'multi').

use super::SurfaceKind;
use crate::math::{DVec3, Floats, SymmetricMatrix, Vec3, Vec3Lanes, smallest_eigenvector};

/// Discs blended at most; the nearest are kept.
pub const MAX_GATHERED: usize = 16;

/// A disc that rays pierce.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    pub center: Vec3,
    /// Unit.
    pub normal: Vec3,
    pub radius: f32,
    /// Linear.
    pub color: Vec3,
}

/// Farthest distance gathered if a disc of `radius` is hit at `distance`; the least over all hits counts,
/// which does not depend on the order in which they are found.
#[inline(always)]
pub fn gather_limit<T: std::ops::Add<Output = T>>(distance: T, radius: T) -> T {
    distance + radius
}

/// The surface that discs describe, one ray a lane and one disc at a time.
///
/// The thesis turns each normal toward the ray's origin on its own. On a silhouette that turns the discs
/// behind the bend inside out; here the nearest one is turned, and the others follow it.
pub struct Blend<F> {
    kind: SurfaceKind,
    direction: Vec3Lanes<F>,
    /// The nearest disc's normal, turned toward the ray's origin.
    nearest: Vec3Lanes<F>,
    normal: Vec3Lanes<F>,
    color: Vec3Lanes<F>,
    total: F,
}

impl<F: Floats> Blend<F> {
    /// `nearest` is the unit normal of the nearest disc on each ray.
    #[inline(always)]
    pub fn new(kind: SurfaceKind, nearest: Vec3Lanes<F>, direction: Vec3Lanes<F>) -> Self {
        let zero = Vec3Lanes::splat(Vec3::ZERO);
        let nearest = turned_with(nearest, zero.minus(direction));
        Self { kind, direction, nearest, normal: zero, color: zero, total: F::splat(0.0) }
    }

    /// Adds a disc for the rays that pierce it at `offset` from its centre.
    #[inline(always)]
    pub fn add(&mut self, disc: &Gathered, offset: Vec3Lanes<F>, is_pierced: F::Mask) {
        let zero = F::splat(0.0);
        let nearness = F::splat(1.0) - offset.dot(offset).sqrt() / F::splat(disc.radius);
        let weight = F::select(is_pierced, nearness.max(F::splat(1e-4)), zero);
        let normal = Vec3Lanes::splat(disc.normal);
        let sign = if self.kind == SurfaceKind::Splat {
            let is_contrary = normal.dot(self.nearest).less(zero);
            F::select(is_contrary, zero - weight, weight)
        } else {
            weight
        };
        self.normal = self.normal.plus(normal.scaled(sign));
        self.color = self.color.plus(Vec3Lanes::splat(disc.color).scaled(weight));
        self.total = self.total + weight;
    }

    /// Unit normal facing the ray's origin, and colour. The normal of `SplatFit` is that of the nearest
    /// disc: `plane_normal` replaces it where there is one.
    #[inline(always)]
    pub fn finish(self) -> (Vec3Lanes<F>, Vec3Lanes<F>) {
        let color = self.color.scaled(F::splat(1.0) / self.total);
        // Opposite normals may cancel in splat-mean; the nearest disc's own is then as good as any.
        let normal = match self.kind {
            SurfaceKind::Splat => facing(normalized(self.normal, self.nearest), self.direction),
            SurfaceKind::SplatFit => self.nearest,
            _ => {
                let toward = Vec3Lanes::splat(Vec3::ZERO).minus(self.direction);
                turned_with(normalized(self.normal, self.nearest), toward)
            }
        };
        (normal, color)
    }
}

/// `normal` with the sign that it shares with `guide`.
#[inline(always)]
fn turned_with<F: Floats>(normal: Vec3Lanes<F>, guide: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let zero = F::splat(0.0);
    let sign = F::select(normal.dot(guide).less(zero), F::splat(-1.0), F::splat(1.0));
    normal.scaled(sign)
}

/// Of unit length, or `otherwise` if the vector has next to none.
#[inline(always)]
fn normalized<F: Floats>(vector: Vec3Lanes<F>, otherwise: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let squared = vector.dot(vector);
    let has_length = F::splat(1e-30).less(squared);
    let unit = vector.scaled(F::splat(1.0) / squared.sqrt());
    Vec3Lanes::select(has_length, unit, otherwise)
}

/// A normal that leans away a little, over a bend, is only brought upright: turned around it would
/// point inward.
#[inline(always)]
fn facing<F: Floats>(normal: Vec3Lanes<F>, direction: Vec3Lanes<F>) -> Vec3Lanes<F> {
    let away = normal.dot(direction);
    let toward = Vec3Lanes::splat(Vec3::ZERO).minus(direction);
    let upright = normalized(normal.minus(direction.scaled(away)), toward);
    Vec3Lanes::select(F::splat(0.0).less(away), upright, normal)
}

/// Unit normal of the plane through points, if they span one; of either sign.
pub fn plane_normal(points: &[Vec3]) -> Option<Vec3> {
    let relative = |point: &Vec3| (*point - points[0]).as_dvec3();
    let mean = points.iter().map(relative).sum::<DVec3>() / points.len() as f64;
    let mut covariance = SymmetricMatrix::default();
    for point in points {
        covariance.add_outer(relative(point) - mean, 1.0);
    }
    let (normal, values) = smallest_eigenvector(&covariance);
    // Fewer than three points, or points on a line, leave the second eigenvalue at zero.
    (1e-4 * values[2] < values[1]).then(|| normal.as_vec3())
}

//! Smooth surfaces: at each position a sphere is fitted to the weighted points around it (algebraic point set
//! surfaces, Guennebaud and Gross 2007). Weights also fall with the angle between normals, which keeps edges
//! (robust implicit moving least squares, Öztireli, Guennebaud and Gross 2009).

use super::weight::support_weight;
use crate::math::{Floats, Lanes, ROUND_TO_INTEGER, Vec3, Vec3Lanes};

/// Radius of a point's weight function, in radii of the point.
pub const SUPPORT_FACTOR: f32 = 1.2;
/// Maximum distance of a point from the position of a fit, in radii of the disc that was hit.
pub const FIT_REACH: f32 = 1.4;
/// The height of the origin of secondary rays above the surface, in radii.
pub const SPAWN_OFFSET: f32 = 0.2;
/// The distance before which secondary rays ignore hits, in radii.
pub const SPAWN_T_MIN: f32 = 0.5;
/// Rate at which the skipped distance of light rays shrinks with the cosine to the normal: all of [`SPAWN_T_MIN`] in
/// the tangent plane, nothing from a cosine of 1/2 on. A steeper ray must not skip the wall beside a floor, or light
/// leaks in.
pub const LIGHT_STEEPNESS: f32 = 2.0;
/// Distance from the origin of a ray, in radii of the disc that it hits, up to which the ray leaves the surface if it comes
/// from behind the disc: at an edge the discs of one side stick out before the other.
pub const LEAVING_DISTANCE: f32 = 1.0;
/// Minimum distance between a disc and what a ray hits behind it, in radii of the disc, at which the ray has come through
/// a slit. Nearer back faces are those of thin sheets.
pub const MIN_SLIT_DEPTH: f32 = 3.0;
/// Factors of `edge_retest_factor` for evenly spaced and for random points.
const EDGE_RETEST_EVEN: f32 = 1.3;
const EDGE_RETEST_RANDOM: f32 = 1.5;
/// Steps per unit to which the terms of sums are rounded, so that sums of up to [`MAX_EXACT_TERMS`] points do not depend
/// on their order.
pub const STEPS: f32 = 16_384.0;
/// Number of terms of up to 1 that f32 adds exactly in these steps: its integers are exact up to 2^24.
pub const MAX_EXACT_TERMS: usize = (1 << 24) / STEPS as usize;
/// Minimum weight of all points of a fit. With less, beyond the reach of all points but one or two, rounding showed as
/// noise.
pub const MIN_WEIGHT: f32 = 0.1;
/// Additional weight of the colour of the nearest point, in its radii. Without it, rounding turned the colours of points
/// with tiny weights black.
pub const NEAREST_COLOR_WEIGHT: f32 = 0.02;
/// Exponent of the weight of normals at an angle of 90 degrees: 2 / (2/3)^2.
pub const NORMAL_FALLOFF: f32 = 4.5;
/// Maximum curvature of a fitted sphere's equation, in 1 / radius: its radius is at least half a disc's radius.
pub const MAX_CURVATURE: f32 = 1.0;
/// Squared spread of a fit's points around their mean, in squared radii, up to which they give no curvature. Where one
/// point has nearly all the weight, the quotient is rounding alone.
pub const FLAT_SPREAD: f32 = 0.01;
/// Squared spread of a fit's points, in squared radii, from which they give all of the curvature.
pub const CURVED_SPREAD: f32 = 0.04;
/// Distance of a point's plane from the position, in radii, beyond which the point belongs to another sheet.
pub const MAX_PLANE_DISTANCE: f32 = 0.8;
/// Maximum cosine between the normals of two sides of an edge.
pub const MAX_EDGE_COSINE: f32 = 0.7;
/// Minimum weight of the points on the other side of an edge.
pub const MIN_EDGE_WEIGHT: f32 = 0.05;
/// Maximum mean height of a hit above the surface on the other side of an edge, in radii.
pub const MAX_OVERHANG: f32 = 0.1;
/// Maximum distance along the ray from the position of a fit to the sphere, in radii.
pub const MAX_STEP: f32 = 1.5;
/// Length of a fitted sphere's gradient up to which a ray hits nothing.
pub const MIN_GRADIENT: f32 = 1e-3;

/// Factor on the radius of the neighbourhood that decides about a hit which the nearest points do not enclose, by how
/// evenly the points are placed: the distance between the nearest of eight points in radii. Between unevenly placed
/// points a wider neighbourhood closes the gap; beyond the edge of the surface none does.
pub fn edge_retest_factor(evenness: f32) -> f32 {
    let (even, random) = ((0.4, EDGE_RETEST_EVEN), (0.15, EDGE_RETEST_RANDOM));
    let fraction = ((even.0 - evenness) / (even.0 - random.0)).clamp(0.0, 1.0);
    even.1 + fraction * (random.1 - even.1)
}

/// Sums over the points around positions.
pub trait PointSums<F: Floats> {
    /// Returns the lanes in which a point may take part.
    fn is_near(&self, point: &FitPoint<F>) -> F::Mask;

    /// Adds a point in `lanes`, to which it is near.
    fn add(&mut self, point: &FitPoint<F>, lanes: F::Mask);
}

/// Weighted sums over the points around positions, one position or one point per lane.
#[derive(Clone, Copy)]
pub struct SphereSums<F> {
    /// Unit normals to which the points' normals are compared.
    guide: Vec3Lanes<F>,
    /// Reciprocal of the radius of the disc that was hit: offsets are in radii.
    per_radius: F,
    weight: F,
    offset: Vec3Lanes<F>,
    normal: Vec3Lanes<F>,
    offset_dot_normal: F,
    offset_squared: F,
}

/// A point near the position of a fit.
#[derive(Clone, Copy)]
pub struct FitPoint<F> {
    /// The point relative to the position.
    pub offset: Vec3Lanes<F>,
    /// Unit normal.
    pub normal: Vec3Lanes<F>,
    /// Reciprocal of the square of the support's radius.
    pub inverse_support_squared: F,
}

impl<F: Floats> FitPoint<F> {
    /// Returns the weight of the point, which falls from 1 at the position to 0 at the support's radius.
    #[inline(always)]
    pub fn weight(&self) -> F {
        support_weight(self.offset.dot(self.offset), self.inverse_support_squared)
    }
}

/// Returns the lanes in which a point is within `FIT_REACH` radii.
#[inline(always)]
fn is_within_reach<F: Floats>(point: &FitPoint<F>, per_radius: F) -> F::Mask {
    let squared = point.offset.dot(point.offset);
    (squared * per_radius * per_radius).lt(F::splat(FIT_REACH * FIT_REACH))
}

/// Rounds to a multiple of `1 / STEPS`, scaled by `STEPS`.
#[inline(always)]
fn in_steps<F: Floats>(value: F) -> F {
    let to_integer = F::splat(ROUND_TO_INTEGER);
    value * F::splat(STEPS) + to_integer - to_integer
}

#[inline(always)]
fn in_steps_vector<F: Floats>(vector: Vec3Lanes<F>) -> Vec3Lanes<F> {
    Vec3Lanes { x: in_steps(vector.x), y: in_steps(vector.y), z: in_steps(vector.z) }
}

impl<F: Floats> SphereSums<F> {
    /// Returns the sums over no points, for discs of `radius` whose unit normals are `guide`.
    #[inline(always)]
    pub fn new(guide: Vec3Lanes<F>, radius: F) -> Self {
        let (zero, none) = (F::splat(0.0), Vec3Lanes::splat(Vec3::ZERO));
        Self {
            guide,
            per_radius: F::splat(1.0) / radius,
            weight: zero,
            offset: none,
            normal: none,
            offset_dot_normal: zero,
            offset_squared: zero,
        }
    }

    /// Returns the weighted mean of the points relative to the positions: on the side of an edge that is hit, and within it.
    #[inline(always)]
    pub fn mean_offset(&self) -> Vec3Lanes<F> {
        self.offset.scaled(F::splat(1.0) / (self.weight * self.per_radius))
    }

    /// Fits a sphere to the points and intersects it with rays through the positions along unit vectors
    /// `direction`.
    #[inline(always)]
    pub fn intersect(&self, direction: Vec3Lanes<F>) -> SphereHit<F> {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let per_weight = one / self.weight;
        // The squared spread of the points is never far below zero, and zero for a single point.
        let spread = self.offset_squared - self.offset.dot(self.offset) * per_weight;
        let bend = self.offset_dot_normal - self.offset.dot(self.normal) * per_weight;
        let curvature = F::splat(0.5) * bend / spread;
        let (least, most) = (F::splat(-MAX_CURVATURE), F::splat(MAX_CURVATURE));
        let certainty = (spread * per_weight - F::splat(FLAT_SPREAD))
            * F::splat(1.0 / (CURVED_SPREAD - FLAT_SPREAD));
        let certainty = certainty.max(zero).min(one);
        let has_spread = zero.lt(certainty);
        let curvature = certainty * curvature.max(least).min(most);
        let curvature = F::select(has_spread, curvature, zero);
        let twice = curvature + curvature;
        let gradient = self.normal.minus(self.offset.scaled(twice)).scaled(per_weight);
        let value =
            zero - (gradient.dot(self.offset) + curvature * self.offset_squared) * per_weight;
        // The root of value + slope t + curvature t^2 that is nearest to zero, in a form without cancellation.
        let slope = gradient.dot(direction);
        let discriminant = slope * slope - F::splat(4.0) * curvature * value;
        let root = discriminant.max(zero).sqrt();
        let denominator = slope + F::select(slope.lt(zero), zero - root, root);
        let step = (zero - (value + value)) / denominator;
        let normal = gradient.plus(direction.scaled(twice * step));
        let length = normal.dot(normal).sqrt();
        let is_near = step.abs().le(F::splat(MAX_STEP));
        let is_hit = F::splat(MIN_WEIGHT * STEPS).le(self.weight)
            & zero.le(discriminant)
            & is_near
            & F::splat(MIN_GRADIENT).lt(length);
        SphereHit { step: step / self.per_radius, normal: normal.scaled(one / length), is_hit }
    }
}

impl<F: Floats> PointSums<F> for SphereSums<F> {
    #[inline(always)]
    fn is_near(&self, point: &FitPoint<F>) -> F::Mask {
        let squared = point.offset.dot(point.offset);
        is_within_reach(point, self.per_radius)
            & (squared * point.inverse_support_squared).lt(F::splat(1.0))
    }

    /// The point's normal is turned to the side of the guide.
    #[inline(always)]
    fn add(&mut self, point: &FitPoint<F>, lanes: F::Mask) {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let offset = point.offset.scaled(self.per_radius);
        let cosine = point.normal.dot(self.guide);
        let height = point.normal.dot(offset) * F::splat(1.0 / MAX_PLANE_DISTANCE);
        let closeness = (one - height * height).max(zero);
        let weight = point.weight() * alignment(cosine.abs()) * closeness * closeness;
        let weight = F::select(lanes, weight, zero);
        let side = F::select(cosine.lt(zero), zero - one, one);
        let normal = point.normal.scaled(weight * side);
        let weighted_offset = offset.scaled(weight);
        self.weight = self.weight + in_steps(weight);
        self.offset = self.offset.plus(in_steps_vector(weighted_offset));
        self.normal = self.normal.plus(in_steps_vector(normal));
        self.offset_dot_normal = self.offset_dot_normal + in_steps(offset.dot(normal));
        self.offset_squared = self.offset_squared + in_steps(offset.dot(weighted_offset));
    }
}

/// Weighted sums that tell whether hits lie on the part of a surface that sticks out beyond a convex edge, where it
/// covers the surface on the other side.
#[derive(Clone, Copy)]
pub struct OverhangSums<F> {
    /// Unit normals of the hits, facing the rays' origins.
    normal: Vec3Lanes<F>,
    /// Means of the points on the side of the edge that was hit, relative to the hits.
    inside: Vec3Lanes<F>,
    /// Reciprocal of the radius of the disc that was hit: heights are in radii.
    per_radius: F,
    weight: F,
    height: F,
}

impl<F: Floats> OverhangSums<F> {
    /// Returns the sums over no points, for hits with unit normals on discs of `radius`, and the means of the points of
    /// their fits relative to the hits.
    #[inline(always)]
    pub fn new(normal: Vec3Lanes<F>, inside: Vec3Lanes<F>, radius: F) -> Self {
        let zero = F::splat(0.0);
        Self { normal, inside, per_radius: F::splat(1.0) / radius, weight: zero, height: zero }
    }

    /// Returns the lanes in which the hit sticks out.
    #[inline(always)]
    pub fn sticks_out(&self) -> F::Mask {
        F::splat(MIN_EDGE_WEIGHT * STEPS).lt(self.weight)
            & (F::splat(MAX_OVERHANG) * self.weight).lt(self.height)
    }
}

impl<F: Floats> PointSums<F> for OverhangSums<F> {
    #[inline(always)]
    fn is_near(&self, point: &FitPoint<F>) -> F::Mask {
        is_within_reach(point, self.per_radius)
    }

    /// A point counts if it is on the other side of an edge: its normal is far from that of the hit, and it lies below the
    /// hit's tangent plane. Its own plane has the points of the fit below it. The centre of the disc would not do: it may lie
    /// on the edge.
    #[inline(always)]
    fn add(&mut self, point: &FitPoint<F>, lanes: F::Mask) {
        let zero = F::splat(0.0);
        let is_other_side = point.normal.dot(self.normal).abs().lt(F::splat(MAX_EDGE_COSINE))
            & self.normal.dot(point.offset).lt(zero);
        let of_inside = point.normal.dot(self.inside.minus(point.offset));
        let below = point.normal.dot(point.offset);
        let height = F::select(of_inside.lt(zero), zero - below, below) * self.per_radius;
        let weight = F::select(lanes & is_other_side, point.weight(), zero);
        self.weight = self.weight + in_steps(weight);
        self.height = self.height + in_steps(weight * height);
    }
}

impl<L: Lanes> OverhangSums<L> {
    /// Sums up all lanes, whose position must be the same.
    #[inline(always)]
    pub fn reduce_lanes(self) -> OverhangSums<f32> {
        let first = |Vec3Lanes { x, y, z }: Vec3Lanes<L>| Vec3Lanes {
            x: x.store()[0],
            y: y.store()[0],
            z: z.store()[0],
        };
        OverhangSums {
            normal: first(self.normal),
            inside: first(self.inside),
            per_radius: self.per_radius.store()[0],
            weight: sum(self.weight),
            height: sum(self.height),
        }
    }
}

/// Returns the weight of a normal by the cosine of its angle to the guide: about exp(-|a - b|^2 / (2/3)^2).
#[inline(always)]
fn alignment<F: Floats>(cosine: F) -> F {
    let one = F::splat(1.0);
    let eighth = one - (one - cosine) * F::splat(NORMAL_FALLOFF / 8.0);
    let (squared, zero) = (eighth * eighth, F::splat(0.0));
    let fourth = squared * squared;
    F::select(zero.lt(eighth), fourth * fourth, zero)
}

/// The intersection of rays with fitted spheres.
#[derive(Clone, Copy)]
pub struct SphereHit<F: Floats> {
    /// Distance along the ray from the position of the fit.
    pub step: F,
    /// Unit normal on the side of the guide.
    pub normal: Vec3Lanes<F>,
    /// Lanes in which the sphere is hit near the position.
    pub is_hit: F::Mask,
}

impl<L: Lanes> SphereSums<L> {
    /// Sums up all lanes, whose position must be the same.
    #[inline(always)]
    pub fn reduce_lanes(self) -> SphereSums<f32> {
        let vector = |vector: Vec3Lanes<L>| Vec3Lanes {
            x: sum(vector.x),
            y: sum(vector.y),
            z: sum(vector.z),
        };
        let Vec3Lanes { x, y, z } = self.guide;
        SphereSums {
            guide: Vec3Lanes { x: x.store()[0], y: y.store()[0], z: z.store()[0] },
            per_radius: self.per_radius.store()[0],
            weight: sum(self.weight),
            offset: vector(self.offset),
            normal: vector(self.normal),
            offset_dot_normal: sum(self.offset_dot_normal),
            offset_squared: sum(self.offset_squared),
        }
    }
}

/// Returns the sum of all lanes, which is exact for the terms of `SphereSums`.
#[inline(always)]
fn sum<L: Lanes>(lanes: L) -> f32 {
    let lanes = lanes + lanes.rotate_lanes::<4>();
    let lanes = lanes + lanes.rotate_lanes::<2>();
    (lanes + lanes.rotate_lanes::<1>()).store()[0]
}

/// The colour at a position: the mean of the points' colours, with weights that fall off more steeply than those
/// of the fit, and the nearest point.
#[derive(Clone, Copy)]
pub struct ColorSums<F> {
    weight: F,
    color: Vec3Lanes<F>,
}

impl<F: Floats> Default for ColorSums<F> {
    /// Returns the sums over no points.
    #[inline(always)]
    fn default() -> Self {
        Self { weight: F::splat(0.0), color: Vec3Lanes::splat(Vec3::ZERO) }
    }
}

impl<F: Floats> ColorSums<F> {
    /// Adds a point of a linear colour in `lanes`.
    #[inline(always)]
    pub fn add(&mut self, point: &FitPoint<F>, color: Vec3Lanes<F>, lanes: F::Mask) {
        let weight = point.weight();
        let weight = F::select(lanes, weight * weight * weight, F::splat(0.0));
        self.weight = self.weight + in_steps(weight);
        self.color = self.color.plus(in_steps_vector(color.scaled(weight)));
    }

    /// Returns the mean colour, which is `nearest`, that of the nearest point, where the points have hardly any weight.
    #[inline(always)]
    pub fn mean(&self, nearest: Vec3Lanes<F>) -> Vec3Lanes<F> {
        let weight = F::splat(NEAREST_COLOR_WEIGHT * STEPS);
        let sum = self.color.plus(nearest.scaled(weight));
        sum.scaled(F::splat(1.0) / (self.weight + weight))
    }
}

#[cfg(test)]
mod tests {
    //! Fits of few points, their colours, and edges.

    use super::*;

    fn point(offset: Vec3, normal: Vec3) -> FitPoint<f32> {
        FitPoint {
            offset: Vec3Lanes::splat(offset),
            normal: Vec3Lanes::splat(normal),
            inverse_support_squared: 1.0 / (SUPPORT_FACTOR * SUPPORT_FACTOR),
        }
    }

    #[test]
    fn a_single_point_is_a_plane_up_to_its_rim() {
        let normal = Vec3::new(0.3, -0.2, 0.9).normalize();
        let (along, _) = normal.any_orthonormal_pair();
        for i in 0..200 {
            let offset = 0.0037 * i as f32 * along;
            let mut sums = SphereSums::new(Vec3Lanes::splat(normal), 1.0);
            sums.add(&point(offset, normal), true);
            let hit = sums.intersect(Vec3Lanes::splat(-normal));
            let found = Vec3::new(hit.normal.x, hit.normal.y, hit.normal.z);
            if hit.is_hit {
                assert!(0.9999 < found.dot(normal), "{i}: {found}");
                assert!(hit.step.abs() < 0.001, "{i}: {}", hit.step);
            } else {
                assert!(0.7 < offset.length(), "{i}");
            }
        }
    }

    #[test]
    fn a_point_keeps_its_colour_up_to_its_rim() {
        let color = Vec3Lanes::splat(Vec3::new(0.02, 0.05, 0.01));
        for i in 0..120 {
            let mut sums = ColorSums::default();
            sums.add(&point(0.01 * i as f32 * Vec3::X, Vec3::Z), color, true);
            let mean = sums.mean(color);
            for (mean, color) in [(mean.x, color.x), (mean.y, color.y), (mean.z, color.z)] {
                assert!((mean - color).abs() < 0.002, "{i}: {mean} for {color}");
            }
        }
    }

    /// True if a hit at `x` on the plane z = 0 sticks out, whose disc has its centre at x = -0.5. The points of the other
    /// side lie below an edge at x = 0, at distances of 0.1 on a plane that falls as steeply as `slope`.
    fn sticks_out(x: f32, slope: f32) -> bool {
        let center = Vec3Lanes::splat(Vec3::new(-0.5 - x, 0.0, 0.0));
        let mut sums = OverhangSums::new(Vec3Lanes::splat(Vec3::Z), center, 1.0);
        let down = Vec3::new(1.0, 0.0, -slope).normalize();
        let normal = Vec3::new(slope, 0.0, 1.0).normalize();
        for i in 1..10 {
            for normal in [normal, -normal] {
                let point = point(0.1 * i as f32 * down - x * Vec3::X, normal);
                sums.add(&point, sums.is_near(&point));
            }
        }
        sums.sticks_out()
    }

    #[test]
    fn hits_beyond_a_convex_edge_stick_out() {
        for slope in [1.5, 3.0, 20.0] {
            assert!(sticks_out(0.3, slope), "{slope}");
            assert!(!sticks_out(-0.1, slope), "{slope}");
        }
        // Blunt edges are bends.
        assert!(!sticks_out(0.3, 0.5));
        // On the other side of a concave edge the points lie above the plane.
        assert!(!sticks_out(0.3, -3.0));
    }
}

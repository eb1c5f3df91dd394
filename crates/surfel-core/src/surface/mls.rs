//! Moving least squares: at each position a plane is fitted to the weighted points around it, and over the plane a
//! polynomial (Levin, Mesh-Independent Surface Interpolation, 2003; Adamson and Alexa, Approximating and Intersecting
//! Surfaces from Points, 2003). It needs positions alone, no normals.

use super::shape::{PointLanes, RayLanes, Shape};
use crate::math::{CovarianceLanes, Floats, Vec3, Vec3Lanes, tangents};

/// Radius of a point's weight function in radii of the point.
pub const DEFAULT_REACH: f32 = 1.4;
/// Radius of a point's weight function in radii of its ball. The surface lies within the balls.
pub const SUPPORT_FACTOR: f32 = 1.75;
/// The height of the origin of secondary rays above the surface, in radii.
pub const SPAWN_OFFSET: f32 = 0.2;
/// The distance before which secondary rays ignore hits, in radii.
pub const SPAWN_T_MIN: f32 = 0.5;
/// Degree of the polynomial, unless options choose another one.
pub const DEFAULT_DEGREE: u32 = 2;
/// Minimum weight of all points of a fit.
pub const MIN_WEIGHT: f32 = 0.1;
/// Weight of the squares of the height and the slopes, in weights of all points, which keeps those down that few points
/// decide.
pub const SLOPE_PENALTY: f32 = 1e-6;
/// Weight of the squares of the other coefficients, in weights of all points.
pub const BEND_PENALTY: f32 = 1e-4;
/// Newton steps from the tangent plane to the polynomial.
pub const N_STEPS: usize = 3;

/// The ball around a point. A ray meets it where it is nearest to the point.
pub struct Ball;

impl Shape for Ball {
    #[inline(always)]
    fn intersect<F: Floats>(points: &PointLanes<F>, ray: &RayLanes<F>) -> (F, F::Mask) {
        let distance = points.center.dot(ray.direction);
        let offset = points.center.minus(ray.direction.scaled(distance));
        let hit = offset.dot(offset).lt(points.radius * points.radius) & ray.t_min.le(distance);
        (distance, hit)
    }
}

/// Weighted sums over the points around positions, one position per lane.
pub struct PlaneSums<F> {
    weight: F,
    offset: Vec3Lanes<F>,
    covariance: CovarianceLanes<F>,
}

/// Planes near positions, one per lane.
#[derive(Clone, Copy)]
pub struct PlaneLanes<F: Floats> {
    /// Unit normal, facing the rays' origins.
    pub normal: Vec3Lanes<F>,
    /// Signed distance of the plane from the position along the normal.
    pub height: F,
    /// Sum of the weights of the points.
    pub weight: F,
    /// Lanes in which the points span a plane.
    pub is_plane: F::Mask,
}

impl<F: Floats> Default for PlaneSums<F> {
    /// Returns the sums over no points.
    #[inline(always)]
    fn default() -> Self {
        Self {
            weight: F::splat(0.0),
            offset: Vec3Lanes::splat(Vec3::ZERO),
            covariance: CovarianceLanes::zero(),
        }
    }
}

impl<F: Floats> PlaneSums<F> {
    /// Adds one point for each lane, at `offset` from the position.
    #[inline(always)]
    pub fn add(&mut self, offset: Vec3Lanes<F>, weight: F) {
        self.weight = self.weight + weight;
        self.offset = self.offset.plus(offset.scaled(weight));
        self.covariance.add_outer(offset, weight);
    }

    /// Returns the planes, turned against rays of these directions.
    #[inline(always)]
    pub fn planes(&self, direction: Vec3Lanes<F>) -> PlaneLanes<F> {
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let mean = self.offset.scaled(one / self.weight);
        let mut covariance = self.covariance;
        covariance.add_outer(mean, zero - self.weight);
        let (normal, is_plane) = covariance.smallest_eigenvector();
        let is_away = zero.lt(normal.dot(direction));
        let normal = normal.scaled(F::select(is_away, zero - one, one));
        PlaneLanes {
            normal,
            height: normal.dot(mean),
            weight: self.weight,
            is_plane: is_plane & F::splat(MIN_WEIGHT).lt(self.weight),
        }
    }
}

/// The intersection of rays with fitted surfaces.
#[derive(Clone, Copy)]
pub struct StepLanes<F> {
    /// Distance along the ray from the position of the fit.
    pub step: F,
    /// Unit normal, facing the rays' origins.
    pub normal: Vec3Lanes<F>,
}

impl<F: Floats> PlaneLanes<F> {
    /// Intersects the planes with rays through the positions.
    #[inline(always)]
    pub fn intersect(&self, direction: Vec3Lanes<F>) -> StepLanes<F> {
        StepLanes { step: self.height / self.normal.dot(direction), normal: self.normal }
    }
}

/// Sums of the least squares fit of polynomials over planes through positions, one per lane: `N` coefficients of 1, u, v,
/// u^2, uv, v^2 (and u^3, u^2 v, u v^2, v^3) for coordinates in units of the support.
pub struct PolynomialSums<F: Floats, const N: usize> {
    normal: Vec3Lanes<F>,
    tangents: [Vec3Lanes<F>; 2],
    /// Reciprocal of the unit of u and v.
    per_unit: F,
    /// Weighted sums of the monomials of up to twice the polynomial's degree, of which the matrix of the fit consists.
    moments: [F; MAX_MOMENTS],
    right: [F; N],
}

impl<F: Floats, const N: usize> PolynomialSums<F, N> {
    /// Returns the sums over no points, for planes with these unit normals. `unit` is a length of about the support's
    /// radius.
    #[inline(always)]
    pub fn new(normal: Vec3Lanes<F>, unit: f32) -> Self {
        let (zero, per_unit) = (F::splat(0.0), F::splat(1.0 / unit));
        let tangents = tangents(normal);
        Self { normal, tangents, per_unit, moments: [zero; MAX_MOMENTS], right: [zero; N] }
    }

    /// Adds one point for each lane, at `offset` from the position.
    #[inline(always)]
    pub fn add(&mut self, offset: Vec3Lanes<F>, weight: F) {
        let u = self.tangents[0].dot(offset) * self.per_unit;
        let v = self.tangents[1].dot(offset) * self.per_unit;
        let height = self.normal.dot(offset);
        // Loops and tables kept the sums in memory, and took three times as long.
        let [w, wu, wv] = [weight, weight * u, weight * v];
        let [wuu, wuv, wvv] = [wu * u, wu * v, wv * v];
        let [wuuu, wuuv, wuvv, wvvv] = [wuu * u, wuu * v, wvv * u, wvv * v];
        let [wuuuu, wuuuv, wuuvv] = [wuuu * u, wuuu * v, wuuv * v];
        let [wuvvv, wvvvv] = [wvvv * u, wvvv * v];
        let (sums, zero) = (&mut self.moments, F::splat(0.0));
        add_to(&mut sums[0], w);
        add_to(&mut sums[1], wu);
        add_to(&mut sums[2], wv);
        add_to(&mut sums[3], wuu);
        add_to(&mut sums[4], wuv);
        add_to(&mut sums[5], wvv);
        add_to(&mut sums[6], wuuu);
        add_to(&mut sums[7], wuuv);
        add_to(&mut sums[8], wuvv);
        add_to(&mut sums[9], wvvv);
        add_to(&mut sums[10], wuuuu);
        add_to(&mut sums[11], wuuuv);
        add_to(&mut sums[12], wuuvv);
        add_to(&mut sums[13], wuvvv);
        add_to(&mut sums[14], wvvvv);
        let right = &mut self.right;
        add_to(&mut right[0], w * height);
        add_to(&mut right[1], wu * height);
        add_to(&mut right[2], wv * height);
        add_to(&mut right[3], wuu * height);
        add_to(&mut right[4], wuv * height);
        add_to(&mut right[5], wvv * height);
        if N == 10 {
            add_to(&mut right[N - 4], wuuu * height);
            add_to(&mut right[N - 3], wuuv * height);
            add_to(&mut right[N - 2], wuvv * height);
            add_to(&mut right[N - 1], wvvv * height);
            let mut monomials = [wuuuu, wuuuv, wuuvv, wuvvv, wvvvv, zero, zero];
            for (degree, first) in [(5, 15), (6, 21)] {
                let first_of_lower = monomials[0];
                for i in (0..degree).rev() {
                    monomials[i + 1] = monomials[i] * v;
                }
                monomials[0] = first_of_lower * u;
                for i in 0..=degree {
                    add_to(&mut sums[first + i], monomials[i]);
                }
            }
        }
    }

    /// Returns the lanes in which there are points enough.
    #[inline(always)]
    pub fn has_points(&self) -> F::Mask {
        F::splat(MIN_WEIGHT).lt(self.moments[0])
    }

    /// Intersects the polynomials with rays through the positions.
    #[inline(always)]
    pub fn intersect(&self, direction: Vec3Lanes<F>) -> StepLanes<F> {
        let c = solve(&self.matrix(), &self.right);
        let du = self.tangents[0].dot(direction) * self.per_unit;
        let dv = self.tangents[1].dot(direction) * self.per_unit;
        let zero = F::splat(0.0);
        let dz = self.normal.dot(direction);
        // Along the ray the height above the polynomial is itself a polynomial of the distance.
        let along = monomials::<F, N>(du, dv);
        let mut by_degree = [zero; 4];
        for i in 0..N {
            let degree = DEGREES[i].0 + DEGREES[i].1;
            let term = if i == 0 { c[0] } else { c[i] * along[i] };
            by_degree[degree] = by_degree[degree] + term;
        }
        let [k0, k1, k2, k3] = by_degree;
        let (start, slope) = (zero - k0, dz - k1);
        let mut step = zero - start / slope;
        for _ in 0..N_STEPS {
            let value = start + (slope - (k2 + k3 * step) * step) * step;
            let rate = slope - (F::splat(2.0) * k2 + F::splat(3.0) * k3 * step) * step;
            step = step - value / rate;
        }
        let normal = self.normal_at(&c, step * du, step * dv);
        let is_away = zero.lt(normal.dot(direction));
        StepLanes { step, normal: normal.scaled(F::select(is_away, F::splat(-1.0), F::splat(1.0))) }
    }

    /// Returns the lower triangle of the matrix of the fit, with the penalties of its coefficients.
    #[inline(always)]
    fn matrix(&self) -> [[F; N]; N] {
        let mut matrix = [[F::splat(0.0); N]; N];
        for i in 0..N {
            for j in 0..=i {
                let (of_u, of_v) = (DEGREES[i].0 + DEGREES[j].0, DEGREES[i].1 + DEGREES[j].1);
                matrix[i][j] = self.moments[monomial_idx(of_u, of_v)];
            }
            let penalty = F::splat(if i < 3 { SLOPE_PENALTY } else { BEND_PENALTY });
            matrix[i][i] = matrix[i][i] + penalty * self.moments[0];
        }
        matrix
    }

    /// Returns the polynomials' unit normals.
    #[inline(always)]
    fn normal_at(&self, c: &[F; N], u: F, v: F) -> Vec3Lanes<F> {
        let two = F::splat(2.0);
        let mut by_u = c[1] + two * c[3] * u + c[4] * v;
        let mut by_v = c[2] + c[4] * u + two * c[5] * v;
        if N == 10 {
            let three = F::splat(3.0);
            let [uuu, uuv, uvv, vvv] = [c[N - 4], c[N - 3], c[N - 2], c[N - 1]];
            by_u = by_u + three * uuu * u * u + two * uuv * u * v + uvv * v * v;
            by_v = by_v + uuv * u * u + two * uvv * u * v + three * vvv * v * v;
        }
        let tilt = self.tangents[0].scaled(by_u).plus(self.tangents[1].scaled(by_v));
        let normal = self.normal.minus(tilt.scaled(self.per_unit));
        normal.scaled(F::splat(1.0) / normal.dot(normal).sqrt())
    }
}

/// Number of monomials of up to degree 6, which the fit of a polynomial of degree 3 needs.
const MAX_MOMENTS: usize = 28;
/// Degrees in u and v of the monomials of a polynomial, in their order.
const DEGREES: [(usize, usize); 10] =
    [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

/// Returns the index of a monomial of these degrees in u and v.
const fn monomial_idx(of_u: usize, of_v: usize) -> usize {
    let degree = of_u + of_v;
    degree * (degree + 1) / 2 + of_v
}

/// Returns the monomials of a polynomial of `N` coefficients.
#[inline(always)]
fn monomials<F: Floats, const N: usize>(u: F, v: F) -> [F; N] {
    let (uu, uv, vv) = (u * u, u * v, v * v);
    let all = [F::splat(1.0), u, v, uu, uv, vv, uu * u, uu * v, u * vv, vv * v];
    let mut monomials = [all[0]; N];
    monomials.copy_from_slice(&all[..N]);
    monomials
}

#[inline(always)]
fn add_to<F: Floats>(sum: &mut F, summand: F) {
    *sum = *sum + summand;
}

/// Solves systems with symmetric positive definite matrices, of which the lower triangle is given (LDL^T).
#[inline(always)]
fn solve<F: Floats, const N: usize>(matrix: &[[F; N]; N], right: &[F; N]) -> [F; N] {
    let mut lower = *matrix;
    let mut solution = *right;
    let mut pivots = [F::splat(0.0); N];
    for j in 0..N {
        let mut scaled = [F::splat(0.0); N];
        for k in 0..j {
            scaled[k] = lower[j][k] * pivots[k];
            lower[j][j] = lower[j][j] - lower[j][k] * scaled[k];
        }
        pivots[j] = lower[j][j];
        let per_pivot = F::splat(1.0) / pivots[j];
        for row in &mut lower[j + 1..] {
            for k in 0..j {
                row[j] = row[j] - row[k] * scaled[k];
            }
            row[j] = row[j] * per_pivot;
        }
        for k in 0..j {
            solution[j] = solution[j] - lower[j][k] * solution[k];
        }
    }
    for j in (0..N).rev() {
        solution[j] = solution[j] / pivots[j];
        for i in j + 1..N {
            solution[j] = solution[j] - lower[i][j] * solution[i];
        }
    }
    solution
}

#[cfg(test)]
mod tests {
    //! Polynomials through points of surfaces of their degree, and rays that hit them.

    use super::*;
    use crate::math::Random;

    /// Returns the intersection of a ray with the polynomial of `N` coefficients over Z = 0 that is fitted to points of a
    /// height field, and the hit position.
    fn hit<const N: usize>(height: impl Fn(f32, f32) -> f32, direction: Vec3) -> (Vec3, Vec3) {
        let mut sums = PolynomialSums::<f32, N>::new(Vec3Lanes::splat(Vec3::Z), 1.0);
        let mut random = Random::new(5, 0);
        for _ in 0..60 {
            let (x, y) = (2.0 * random.next_f32() - 1.0, 2.0 * random.next_f32() - 1.0);
            // The position is 0.05 above the plane.
            sums.add(Vec3Lanes::splat(Vec3::new(x, y, height(x, y) - 0.05)), 1.0);
        }
        let StepLanes { step, normal } = sums.intersect(Vec3Lanes::splat(direction));
        (0.05 * Vec3::Z + step * direction, Vec3::new(normal.x, normal.y, normal.z))
    }

    #[test]
    fn polynomials_of_their_degree_are_hit_exactly() {
        let bowl = |x: f32, y: f32| 0.02 + 0.1 * x - 0.05 * y + 0.2 * x * x - 0.1 * x * y;
        let bend = |x: f32, y: f32| bowl(x, y) + 0.1 * x * x * y;
        for direction in [Vec3::NEG_Z, Vec3::new(0.5, -0.3, -0.8).normalize()] {
            let (quadratic, normal) = hit::<6>(bowl, direction);
            assert!((quadratic.z - bowl(quadratic.x, quadratic.y)).abs() < 1e-3, "{quadratic}");
            let (x, y) = (quadratic.x, quadratic.y);
            let expected = Vec3::new(-0.1 - 0.4 * x + 0.1 * y, 0.05 + 0.1 * x, 1.0).normalize();
            assert!(0.9999 < normal.dot(expected), "{normal} {expected}");
            let (cubic, _) = hit::<10>(bend, direction);
            assert!((cubic.z - bend(cubic.x, cubic.y)).abs() < 1e-3, "{cubic}");
        }
    }

    #[test]
    fn a_ray_meets_a_ball_where_it_is_nearest_to_the_centre() {
        let points = PointLanes {
            center: Vec3Lanes::splat(Vec3::new(3.0, 0.4, 0.0)),
            normal: Vec3Lanes::splat(Vec3::ZERO),
            radius: 0.5,
        };
        let ray = RayLanes { direction: Vec3Lanes::splat(Vec3::X), t_min: 0.0 };
        assert_eq!(Ball::intersect(&points, &ray), (3.0, true));
        let thin = PointLanes { radius: 0.3, ..points };
        assert!(!Ball::intersect(&thin, &ray).1);
    }
}

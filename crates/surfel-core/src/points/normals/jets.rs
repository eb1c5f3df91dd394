//! Normals from cubics fitted to the heights of neighbours over their mean plane (Cazals and Pouget, Estimating
//! Differential Quantities Using Polynomial Fitting of Osculating Jets, 2005).
//!
//! A plane through neighbours that bend unevenly leans; a cubic follows the bend. The residuals of small neighbourhoods
//! are the noise, and the noise decides how many neighbours take part.

use super::planes::{PlaneFit, canonical_sign};
use crate::error::Result;
use crate::math::{Vec3, quantile};
use crate::points::neighbors::{KdTree, Neighbor};
use crate::progress::Progress;
use rayon::prelude::*;

/// Number of neighbours of a point without noise.
pub const MIN_JET_NEIGHBORS: usize = 24;
/// Maximum number of neighbours.
const MAX_JET_NEIGHBORS: f32 = 192.0;
/// Number of additional neighbours per spacing of noise.
const NEIGHBORS_PER_NOISE: f32 = 350.0;
/// Noise in spacings below which more neighbours do not help.
const MIN_NOISE: f32 = 0.03;
/// Ratio of a residual to the noise above which the neighbours are not on one smooth surface.
const MAX_RESIDUAL_RATIO: f32 = 1.5;
/// Residual in spacings below which a plane is as good as a cubic: on a sphere its normal errs by some 0.1 degrees.
const MIN_PLANE_RESIDUAL: f32 = 0.003;
/// Ratio of the residuals of plane and cubic above which the neighbours bend. Below it the plane, which errs less by
/// noise, is the better one; at an edge its fewer neighbours may be on one side.
const MIN_CURVED_RATIO: f32 = 1.25;
/// Number of points near each other that share a noise.
const REGION_SIZE: usize = 256;
/// Number of terms of a cubic in two variables.
const N_TERMS: usize = 10;
/// Minimum pivot of the normal equations, as a fraction of the sum of all weights: with less, the neighbours do not
/// determine the cubic.
const MIN_PIVOT: f64 = 2e-4;
/// Weight of the farthest neighbours: the nearest have 1.
const MIN_WEIGHT: f64 = 0.0004;

/// A cubic fitted to the neighbours of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JetFit {
    /// Unit normal at the point, on the side of the plane's normal.
    pub normal: Vec3,
    /// Root mean square distance of the neighbours from the cubic, in spacings.
    pub residual: f32,
    /// False if the neighbours lie on a plane as well.
    pub is_curved: bool,
}

/// Returns the cubic through the nearest neighbours of a point, or the plane if it fits fewer of them better; none if
/// they determine neither.
///
/// `fit` is the plane through `n_plane_neighbors` of them.
pub fn fit_nearest_jet(
    positions: &[Vec3],
    point_idx: usize,
    neighbors: &[Neighbor],
    fit: &PlaneFit,
    n_plane_neighbors: usize,
) -> Option<JetFit> {
    if fit.normal == Vec3::ZERO {
        return None;
    }
    let of_plane = fit.residual(n_plane_neighbors);
    let plane = JetFit { normal: fit.normal, residual: of_plane, is_curved: false };
    if of_plane < MIN_PLANE_RESIDUAL {
        return Some(plane);
    }
    let jet = fit_jet(positions, point_idx, neighbors, fit.normal)?;
    Some(if MIN_CURVED_RATIO * jet.residual < of_plane { jet } else { plane })
}

/// Fits a cubic to as many neighbours as the noise in spacings asks for, or down to half as many until they are on one
/// smooth surface. Returns none if they are not.
pub fn fit_wide_jet(tree: &KdTree, point_idx: usize, normal: Vec3, noise: f32) -> Option<JetFit> {
    let positions = tree.positions();
    let wanted = MIN_JET_NEIGHBORS as f32 + NEIGHBORS_PER_NOISE * noise;
    let most = wanted.min(MAX_JET_NEIGHBORS) as usize;
    let neighbors = tree.nearest(positions[point_idx], most, Some(point_idx as u32));
    let fit = |count: &usize| {
        let nearest = &neighbors[..neighbors.len().min(*count)];
        fit_jet(positions, point_idx, nearest, normal)
    };
    [most, 7 * most / 10, most / 2].iter().filter_map(fit).find(|jet| is_smooth(jet, noise))
}

/// Replaces the normals of planes by those of cubics where the neighbours are on one smooth surface, through more
/// neighbours the more noise there is.
///
/// `nearest` are the cubics of the nearest neighbours, and `given` the normals that are known better, zero where they
/// are not.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn refine_normals(
    tree: &KdTree,
    fits: &mut [PlaneFit],
    nearest: &[Option<JetFit>],
    given: Option<&[Vec3]>,
    progress: &dyn Progress,
) -> Result<()> {
    let noises = regional_noises(tree, nearest);
    let refine = |(point, (fit, noise)): (usize, (&mut PlaneFit, &f32))| {
        progress.check()?;
        let known = given.map(|given| given[point]).filter(|given| *given != Vec3::ZERO);
        let jet = || {
            let nearest = nearest[point]?;
            let is_noisy = MIN_NOISE <= *noise && nearest.is_curved;
            let wide = is_noisy.then(|| fit_wide_jet(tree, point, fit.normal, *noise));
            wide.flatten().or(Some(nearest).filter(|jet| is_smooth(jet, *noise)))
        };
        if let Some(normal) = known.or_else(|| Some(jet()?.normal)) {
            *fit = PlaneFit { normal: canonical_sign(normal), is_smooth: true, ..*fit };
        }
        Ok(())
    };
    fits.par_iter_mut().zip(&noises).enumerate().try_for_each(refine)
}

/// Returns the noise at each point in spacings: the first quartile of the residuals around it. More than a quarter of
/// the points near an edge are on one side of it.
fn regional_noises(tree: &KdTree, jets: &[Option<JetFit>]) -> Vec<f32> {
    let mut noises = vec![0.0; jets.len()];
    for region in tree.order().chunks(REGION_SIZE) {
        let jets = region.iter().filter_map(|point| jets[*point as usize]);
        if let Some(noise) = quantile(jets.map(|jet| jet.residual), 0.25) {
            region.iter().for_each(|point| noises[*point as usize] = noise);
        }
    }
    noises
}

/// True if the neighbours of a cubic are on one smooth surface of so much noise.
fn is_smooth(jet: &JetFit, noise: f32) -> bool {
    jet.residual < MAX_RESIDUAL_RATIO * noise.max(MIN_NOISE)
}

/// Fits a cubic to the heights of a point and its neighbours, nearest first, over a plane of unit normal `normal`.
/// Returns none if they do not determine it.
fn fit_jet(
    positions: &[Vec3],
    point_idx: usize,
    neighbors: &[Neighbor],
    normal: Vec3,
) -> Option<JetFit> {
    let reach = f64::from(neighbors.last()?.distance_squared).sqrt();
    if normal == Vec3::ZERO || neighbors.len() <= N_TERMS || reach <= 0.0 {
        return None;
    }
    let normal = normal.as_dvec3().normalize();
    let (u, v) = normal.any_orthonormal_pair();
    let center = positions[point_idx].as_dvec3();
    let mut sums = NormalEquations::default();
    sums.add(0.0, 0.0, 0.0, 1.0);
    for neighbor in neighbors {
        let offset = (positions[neighbor.index as usize].as_dvec3() - center) / reach;
        let inside = (1.0 - offset.length_squared()).max(0.0);
        let weight = (inside * inside).max(MIN_WEIGHT);
        sums.add(offset.dot(u), offset.dot(v), offset.dot(normal), weight);
    }
    let terms = sums.solve()?;
    let n_points = (neighbors.len() + 1) as f64;
    // Each term takes one point.
    let per_free = n_points / (n_points - N_TERMS as f64);
    let variance = (per_free * sums.residual(&terms) / sums.weight()).max(0.0);
    let per_spacing = (n_points / std::f64::consts::PI).sqrt();
    Some(JetFit {
        normal: (normal - u * terms[1] - v * terms[2]).normalize().as_vec3(),
        residual: (variance.sqrt() * per_spacing) as f32,
        is_curved: true,
    })
}

/// Returns the sum of the squared heights of points over the cubic fitted to them, or none if they do not determine it. The
/// points are `[x, y, height]`, with `x` and `y` from about -1 to 1.
pub fn cubic_residual(points: &[[f64; 3]]) -> Option<f64> {
    let mut sums = NormalEquations::default();
    points.iter().for_each(|[x, y, height]| sums.add(*x, *y, *height, 1.0));
    Some(sums.residual(&sums.solve()?))
}

/// Exponents of x and y in the terms of a cubic.
const EXPONENTS: [(usize, usize); N_TERMS] =
    [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)];

/// The normal equations of a cubic by weighted least squares.
#[derive(Default)]
struct NormalEquations {
    /// Weighted sums of the powers `x^i y^j`: each serves several entries of the matrix.
    moments: [[f64; 7]; 7],
    /// Right sides: weighted sums of height times the power `x^i y^j`.
    right: [[f64; 4]; 4],
    squared_heights: f64,
}

impl NormalEquations {
    fn add(&mut self, x: f64, y: f64, height: f64, weight: f64) {
        let (yy, yyy) = (y * y, y * y * y);
        let powers = [1.0, y, yy, yyy, yy * yy, yy * yyy, yyy * yyy];
        let mut weighted = weight;
        for (i, moments) in self.moments.iter_mut().enumerate() {
            moments[..7 - i].iter_mut().zip(&powers).for_each(|(sum, y)| *sum += weighted * y);
            weighted *= x;
        }
        let mut weighted = weight * height;
        self.squared_heights += weighted * height;
        for (i, right) in self.right.iter_mut().enumerate() {
            right[..4 - i].iter_mut().zip(&powers).for_each(|(sum, y)| *sum += weighted * y);
            weighted *= x;
        }
    }

    /// Returns the sum of all weights.
    fn weight(&self) -> f64 {
        self.moments[0][0]
    }

    /// Returns the matrix, whose lower triangle counts.
    fn matrix(&self) -> [[f64; N_TERMS]; N_TERMS] {
        let entry = |a: (usize, usize), b: (usize, usize)| self.moments[a.0 + b.0][a.1 + b.1];
        EXPONENTS.map(|row| EXPONENTS.map(|column| entry(row, column)))
    }

    fn right(&self) -> [f64; N_TERMS] {
        EXPONENTS.map(|(i, j)| self.right[i][j])
    }

    /// Solves the equations by Cholesky's decomposition; none if they are nearly singular.
    fn solve(&self) -> Option<[f64; N_TERMS]> {
        let min_pivot = MIN_PIVOT * self.weight();
        let (mut factor, mut solution) = (self.matrix(), self.right());
        for i in 0..N_TERMS {
            for j in 0..i {
                let products: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
                factor[i][j] = (factor[i][j] - products) / factor[j][j];
            }
            let pivot =
                factor[i][i] - factor[i][..i].iter().map(|entry| entry * entry).sum::<f64>();
            // NaN fails this test, too.
            let is_determined = min_pivot < pivot;
            if !is_determined {
                return None;
            }
            factor[i][i] = pivot.sqrt();
            let products: f64 = (0..i).map(|k| factor[i][k] * solution[k]).sum();
            solution[i] = (solution[i] - products) / factor[i][i];
        }
        for i in (0..N_TERMS).rev() {
            let products: f64 = (i + 1..N_TERMS).map(|k| factor[k][i] * solution[k]).sum();
            solution[i] = (solution[i] - products) / factor[i][i];
        }
        Some(solution)
    }

    /// Returns the weighted sum of squared differences from the cubic that solves the equations.
    fn residual(&self, terms: &[f64; N_TERMS]) -> f64 {
        let explained: f64 = self.right().iter().zip(terms).map(|(right, term)| right * term).sum();
        self.squared_heights - explained
    }
}

#[cfg(test)]
mod tests {
    //! Normals of known surfaces, with and without noise, and neighbours that determine no cubic.

    use super::*;
    use crate::math::Random;
    use crate::points::neighbors::Neighborhood;
    use crate::points::normals::planes::fit_plane;
    use crate::progress::NoProgress;

    const N_PLANE_NEIGHBORS: usize = 16;

    /// Returns the planes of points, and the same refined by cubics.
    fn fits(positions: &[Vec3]) -> (Vec<PlaneFit>, Vec<PlaneFit>) {
        let tree = KdTree::new(positions, &NoProgress).unwrap();
        let visit = |point: usize, neighbors: &[Neighbor]| {
            let nearest = &neighbors[..N_PLANE_NEIGHBORS.min(neighbors.len())];
            let fit = fit_plane(positions, point, nearest);
            (fit, fit_nearest_jet(positions, point, neighbors, &fit, N_PLANE_NEIGHBORS))
        };
        let neighborhood = Neighborhood::Nearest(MIN_JET_NEIGHBORS);
        let (planes, jets): (Vec<_>, Vec<_>) =
            tree.map(neighborhood, &NoProgress, visit).unwrap().into_iter().unzip();
        let mut refined = planes.clone();
        refine_normals(&tree, &mut refined, &jets, None, &NoProgress).unwrap();
        (planes, refined)
    }

    /// Returns points of the waves z = 2 sin(x / 2) with a spacing of about 1, moved by noise along each axis, away from
    /// the border, and their true normals.
    fn waves(noise: f64) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut random = Random::new(7, 0);
        let mut along_axis = || (noise * random.next_gaussian()) as f32;
        let mut jitter = Random::new(8, 0);
        let points = (0..10_000).map(|i| {
            let (x, y) =
                ((i % 100) as f32 + jitter.next_f32(), (i / 100) as f32 + jitter.next_f32());
            let normal = Vec3::new(-(0.5 * x).cos(), 0.0, 1.0).normalize();
            let point = Vec3::new(x, y, 2.0 * (0.5 * x).sin());
            (point + Vec3::new(along_axis(), along_axis(), along_axis()), normal)
        });
        points.unzip()
    }

    /// Returns the mean angle in degrees between fitted and true normals of points away from the border.
    fn mean_error_deg(positions: &[Vec3], fits: &[PlaneFit], normals: &[Vec3]) -> f32 {
        let is_inside = |p: Vec3| (10.0..90.0).contains(&p.x) && (10.0..90.0).contains(&p.y);
        let all = positions.iter().zip(fits).zip(normals);
        let inside = all.filter(|((position, _), _)| is_inside(**position));
        let angles = inside
            .map(|((_, fit), normal)| fit.normal.dot(*normal).abs().min(1.0).acos().to_degrees());
        let angles: Vec<f32> = angles.collect();
        angles.iter().sum::<f32>() / angles.len() as f32
    }

    #[test]
    fn cubics_follow_waves_that_planes_cut() {
        for (noise, gain) in [(0.0, 3.0), (0.1, 1.3)] {
            let (positions, normals) = waves(noise);
            let (planes, refined) = fits(&positions);
            let of_planes = mean_error_deg(&positions, &planes, &normals);
            let of_cubics = mean_error_deg(&positions, &refined, &normals);
            assert!(gain * of_cubics < of_planes, "noise {noise}: {of_planes}, {of_cubics}");
        }
    }

    #[test]
    fn edges_are_not_smooth_and_keep_their_planes() {
        // Two squares that meet at x = 0 at a right angle.
        let mut random = Random::new(9, 0);
        let positions: Vec<Vec3> = (0..4000)
            .map(|i| {
                let (x, y) = (20.0 * random.next_f32() - 10.0, 20.0 * random.next_f32());
                if i % 2 == 0 { Vec3::new(x.abs(), y, 0.0) } else { Vec3::new(0.0, y, x.abs()) }
            })
            .collect();
        let (planes, refined) = fits(&positions);
        for ((position, plane), fit) in positions.iter().zip(&planes).zip(&refined) {
            let from_edge = position.x.max(position.z);
            if (0.0..0.1).contains(&from_edge) {
                assert!(!fit.is_smooth || plane.variation < 1e-6, "{position}");
            } else if 3.0 < from_edge {
                assert!(fit.normal.dot(plane.normal).abs() > 0.999, "{position}");
            }
        }
    }

    #[test]
    fn given_normals_are_taken() {
        let (positions, _) = waves(0.0);
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        let mut fits = vec![PlaneFit::default(); positions.len()];
        let mut given = vec![Vec3::ZERO; positions.len()];
        given[5] = -Vec3::X;
        let jets = vec![None; positions.len()];
        refine_normals(&tree, &mut fits, &jets, Some(&given), &NoProgress).unwrap();
        assert_eq!(fits[5], PlaneFit { normal: Vec3::X, is_smooth: true, ..PlaneFit::default() });
        assert!(fits[..5].iter().all(|fit| *fit == PlaneFit::default()));
    }

    #[test]
    fn few_equal_and_collinear_points_and_rows_keep_their_planes() {
        let line = (0..100).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        // All neighbours are on two lines.
        let rows =
            (0..100).map(|i| Vec3::new((i / 2) as f32, (1000 * (i % 2)) as f32, 0.0)).collect();
        let few = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        for positions in [vec![Vec3::ONE], vec![Vec3::ONE; 100], line, rows, few] {
            let (planes, refined) = fits(&positions);
            assert_eq!(planes, refined);
        }
    }
}

//! Normals: the direction in which a point's neighbourhood is thinnest.

use super::neighbors::{Neighbor, Tree};
use crate::error::Result;
use crate::math::{DVec3, SymmetricMatrix, Vec3, smallest_eigenvector};
use crate::progress::Progress;
use rayon::prelude::*;

/// Middle over largest eigenvalue below which a neighbourhood is a line: a thousandth as wide as long.
const LINE: f64 = 1e-6;

/// The plane through a point's neighbourhood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneFit {
    /// Unit length, of either sign; zero where the neighbourhood spans no plane.
    pub normal: Vec3,
    /// Share of the smallest eigenvalue in the sum of all: 0 on a plane, 1/3 in a cloud alike in all directions.
    pub variation: f32,
}

/// How many points had no plane of their own, by what they got instead.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NormalReport {
    pub n_estimated: usize,
    /// The normal of the nearest point that has one.
    pub n_from_nearest: usize,
    /// +Z, as no point has a normal.
    pub n_up: usize,
}

/// Fits a plane to a point and its neighbours (principal components; Hoppe et al. 1992).
pub fn fit_plane(positions: &[Vec3], point_idx: usize, neighbors: &[Neighbor]) -> PlaneFit {
    if neighbors.len() < 2 {
        return PlaneFit::default();
    }
    let covariance = covariance(positions, point_idx, neighbors);
    let (normal, [smallest, middle, largest]) = smallest_eigenvector(&covariance);
    // Written so that NaN fails it.
    if !(LINE * largest < middle) {
        return PlaneFit::default();
    }
    let variation = smallest.max(0.0) / (smallest + middle + largest);
    PlaneFit { normal: with_a_sign(normal.as_vec3().normalize()), variation: variation as f32 }
}

/// Scatter about the mean, in f64 relative to the point: coordinates far from zero lose nothing.
fn covariance(positions: &[Vec3], point_idx: usize, neighbors: &[Neighbor]) -> SymmetricMatrix {
    let center = positions[point_idx].as_dvec3();
    let mut sum = DVec3::ZERO;
    let mut scatter = SymmetricMatrix::default();
    for neighbor in neighbors {
        let offset = positions[neighbor.index as usize].as_dvec3() - center;
        sum += offset;
        scatter.add_outer(offset, 1.0);
    }
    // The point itself adds nothing to the sums, only to the count.
    scatter.add_outer(sum, -1.0 / (neighbors.len() + 1) as f64);
    scatter
}

/// The one of two opposite vectors whose last component that is not zero is positive.
fn with_a_sign(normal: Vec3) -> Vec3 {
    let leading = [normal.z, normal.y, normal.x].into_iter().find(|&x| x != 0.0).unwrap_or(1.0);
    if leading < 0.0 { -normal } else { normal }
}

/// Gives zero normals that of the nearest point which has one, or +Z if none has.
///
/// Their number should be small: a tree of the good points is built only if there are any.
pub fn fill_missing(
    positions: &[Vec3],
    normals: &mut [Vec3],
    progress: &dyn Progress,
) -> Result<NormalReport> {
    let missing: Vec<u32> =
        (0..normals.len() as u32).filter(|&i| normals[i as usize] == Vec3::ZERO).collect();
    let mut report =
        NormalReport { n_estimated: normals.len() - missing.len(), ..NormalReport::default() };
    if missing.is_empty() {
        return Ok(report);
    }
    // Non-finite positions are no part of a tree: so only the good points can be found.
    let good: Vec<Vec3> = positions
        .iter()
        .zip(&*normals)
        .map(|(&position, &normal)| if normal == Vec3::ZERO { Vec3::NAN } else { position })
        .collect();
    let tree = Tree::new(&good, progress)?;
    let nearest = |&point: &u32| {
        progress.check()?;
        let nearest = tree.nearest(positions[point as usize], 1, None);
        Ok(nearest.first().map(|neighbor| neighbor.index))
    };
    let sources = missing.par_iter().map(nearest).collect::<Result<Vec<_>>>()?;
    for (&point, source) in missing.iter().zip(sources) {
        report.n_from_nearest += usize::from(source.is_some());
        report.n_up += usize::from(source.is_none());
        normals[point as usize] = source.map_or(Vec3::Z, |source| normals[source as usize]);
    }
    progress.note(&report.line());
    Ok(report)
}

impl NormalReport {
    fn line(&self) -> String {
        let Self { n_from_nearest, n_up, .. } = self;
        format!(
            "{} points without a plane through their neighbours: {n_from_nearest} got the normal of \
             the nearest point that has one, {n_up} got +Z",
            n_from_nearest + n_up
        )
    }
}

//! Normals from planes fitted to the neighbours of points.

use crate::error::Result;
use crate::math::{DVec3, SymmetricMatrix, Vec3, smallest_eigenvector};
use crate::points::neighbors::{KdTree, Neighbor, Neighborhood};
use crate::progress::Progress;
use crate::words::{counted, format_length};
use rayon::prelude::*;

/// Minimum ratio of the middle to the largest eigenvalue. Below it the neighbourhood is a line, whose width is less
/// than a thousandth of its length.
const MIN_PLANARITY: f64 = 1e-6;

/// The plane through a point's neighbourhood.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaneFit {
    /// Unit normal of either sign, or zero if the neighbourhood spans no plane.
    pub normal: Vec3,
    /// Surface variation, the smallest eigenvalue divided by the sum of all: 0 on a plane, 1/3 in an isotropic cloud.
    pub variation: f32,
    /// Ratio of the middle to the largest eigenvalue: 0 on a line, 1 in a round neighbourhood.
    pub width: f32,
    /// True if a smooth surface passes through the neighbours: they are not on different sides of an edge.
    pub is_smooth: bool,
}

impl PlaneFit {
    /// Returns the root mean square distance of the `n_neighbors` neighbours from the plane, in spacings.
    pub(crate) fn residual(&self, n_neighbors: usize) -> f32 {
        // The points of a round, even neighbourhood of radius r have a variance of r^2 / 4 along both axes.
        let per_radius = (0.5 * self.variation / (1.0 - self.variation)).sqrt();
        per_radius * ((n_neighbors + 1) as f32 / std::f32::consts::PI).sqrt()
    }
}

/// Numbers of normals by their origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NormalReport {
    /// Number of normals from a fitted plane.
    pub n_estimated: usize,
    /// Number of normals taken from the nearest point that has one.
    pub n_from_nearest: usize,
    /// Number of normals set to +Z, as no point has a normal.
    pub n_up: usize,
}

/// Fits a plane to a point and its neighbours by principal component analysis (Hoppe et al. 1992).
pub fn fit_plane(positions: &[Vec3], point_idx: usize, neighbors: &[Neighbor]) -> PlaneFit {
    if neighbors.len() < 2 {
        return PlaneFit::default();
    }
    let covariance = covariance(positions, point_idx, neighbors);
    let (normal, [smallest, middle, largest]) = smallest_eigenvector(&covariance);
    // NaN fails this test too.
    let is_plane = MIN_PLANARITY * largest < middle;
    let width = (middle.max(0.0) / largest.max(f64::MIN_POSITIVE)) as f32;
    if !is_plane {
        return PlaneFit::default();
    }
    let variation = smallest.max(0.0) / (smallest + middle + largest);
    PlaneFit {
        normal: canonical_sign(normal.as_vec3().normalize()),
        variation: variation as f32,
        width,
        is_smooth: false,
    }
}

/// Returns the scatter matrix about the mean, computed in f64 relative to the point, so that coordinates far from
/// zero lose no precision.
fn covariance(positions: &[Vec3], point_idx: usize, neighbors: &[Neighbor]) -> SymmetricMatrix {
    let center = positions[point_idx].as_dvec3();
    let mut sum = DVec3::ZERO;
    let mut scatter = SymmetricMatrix::default();
    for neighbor in neighbors {
        let offset = positions[neighbor.index as usize].as_dvec3() - center;
        sum += offset;
        scatter.add_outer(offset, 1.0);
    }
    // The point itself adds zero to the sums and one to the count.
    scatter.add_outer(sum, -1.0 / (neighbors.len() + 1) as f64);
    scatter
}

/// Returns the normal or its opposite, whichever has a positive last non-zero component.
pub(super) fn canonical_sign(normal: Vec3) -> Vec3 {
    let leading = [normal.z, normal.y, normal.x].into_iter().find(|&x| x != 0.0).unwrap_or(1.0);
    if leading < 0.0 { -normal } else { normal }
}

/// Replaces zero normals by that of the nearest point which has one, or by +Z if none has.
///
/// If there are zero normals, a tree of the other points is built.
///
/// # Errors
///
/// Returns [`Error::TooManyPoints`](crate::Error::TooManyPoints) beyond 32-bit indices and
/// [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub(crate) fn fill_missing(
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
    // A tree leaves out non-finite positions, so it finds only points with normals.
    let with_normals: Vec<Vec3> = positions
        .iter()
        .zip(&*normals)
        .map(|(&position, &normal)| if normal == Vec3::ZERO { Vec3::NAN } else { position })
        .collect();
    let tree = KdTree::new(&with_normals, progress)?;
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
    Ok(report)
}

impl NormalReport {
    /// Returns a line about the normals for the user. The planes were fitted to `neighborhood`.
    pub fn line(&self, neighborhood: Neighborhood) -> String {
        let n_points = self.n_estimated + self.n_from_nearest + self.n_up;
        let points = counted(n_points, "point");
        match neighborhood {
            Neighborhood::Nearest(k) => format!(
                "normals of {points} from planes through {k} neighbours, or cubics through more where they bend"
            ),
            Neighborhood::Within(distance) => {
                format!("normals of {points} from all points within {}", format_length(distance))
            }
        }
    }

    /// Returns a line about the points without a plane, if there are any.
    pub(crate) fn repairs(&self) -> Option<String> {
        let Self { n_from_nearest, n_up, .. } = self;
        let n_points = n_from_nearest + n_up;
        let replacement =
            if *n_up == 0 { "the normal of the nearest point that has one" } else { "+Z" };
        (0 < n_points).then(|| {
            let points = counted(n_points, "point");
            format!("{points} without a plane through the neighbours got {replacement}")
        })
    }
}

#[cfg(test)]
mod tests {
    //! Normals of known surfaces.

    use super::*;
    use crate::math::Random;
    use crate::points::neighbors::{NeighborMethod, map_neighborhoods};
    use crate::progress::NoProgress;

    fn fits(positions: &[Vec3], neighborhood: Neighborhood) -> Vec<PlaneFit> {
        let fit = |point: usize, neighbors: &[Neighbor]| fit_plane(positions, point, neighbors);
        map_neighborhoods(positions, NeighborMethod::Knn, neighborhood, &NoProgress, fit).unwrap()
    }

    fn sphere(n_points: usize) -> Vec<Vec3> {
        let mut random = Random::new(1, 0);
        let mut direction =
            || Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        (0..n_points).map(|_| direction().normalize()).collect()
    }

    #[test]
    fn normals_of_a_sphere_point_at_its_center() {
        let positions = sphere(20_000);
        for neighborhood in [Neighborhood::Nearest(16), Neighborhood::Within(0.05)] {
            let fits = fits(&positions, neighborhood);
            let good: Vec<(&PlaneFit, &Vec3)> =
                fits.iter().zip(&positions).filter(|(fit, _)| fit.normal != Vec3::ZERO).collect();
            assert!(fits.len() * 99 / 100 < good.len());
            let mut angles: Vec<f32> = good
                .iter()
                .map(|(fit, direction)| {
                    fit.normal.dot(**direction).abs().min(1.0).acos().to_degrees()
                })
                .collect();
            angles.sort_unstable_by(f32::total_cmp);
            // The mean of the neighbourhood is half a spacing (0.7 degrees) away from the point.
            assert!(angles[angles.len() / 2] < 0.6, "{}", angles[angles.len() / 2]);
            assert!(angles[angles.len() * 99 / 100] < 2.5, "{}", angles[angles.len() * 99 / 100]);
        }
    }

    #[test]
    fn normals_do_not_depend_on_the_distance_from_the_origin() {
        let near: Vec<Vec3> = sphere(500).into_iter().map(|p| (p * 1024.0).round()).collect();
        let shift = Vec3::new(1e6, -2e6, 4e6);
        let far: Vec<Vec3> = near.iter().map(|&p| p + shift).collect();
        let (near, far) =
            (fits(&near, Neighborhood::Nearest(16)), fits(&far, Neighborhood::Nearest(16)));
        assert!(near == far);
    }

    #[test]
    fn variation_is_zero_on_a_plane_and_a_third_in_a_ball() {
        let mut random = Random::new(4, 0);
        let mut gauss = || random.next_gaussian() as f32;
        let ball: Vec<Vec3> = (0..5000).map(|_| Vec3::new(gauss(), gauss(), gauss())).collect();
        let flat: Vec<Vec3> = ball.iter().map(|p| Vec3::new(p.x, p.y, 7.0)).collect();
        let everything = Neighborhood::Nearest(4999);
        let fit = fit_plane(
            &ball,
            0,
            &KdTree::new(&ball, &NoProgress).unwrap().nearest(ball[0], 4999, Some(0)),
        );
        assert!((fit.variation - 1.0 / 3.0).abs() < 0.02, "{}", fit.variation);
        let fit = fits(&flat[..200], everything)[0];
        assert_eq!((fit.normal, fit.variation), (Vec3::Z, 0.0));
    }

    #[test]
    fn lines_points_and_pairs_span_no_plane() {
        let line: Vec<Vec3> = (0..50).map(|i| Vec3::new(1.0, 2.0, 3.0) * i as f32).collect();
        for positions in [line, vec![Vec3::ONE; 20], vec![Vec3::X, Vec3::Y], vec![Vec3::X]] {
            let fits = fits(&positions, Neighborhood::Nearest(16));
            assert!(fits.iter().all(|fit| *fit == PlaneFit::default()));
            let mut normals = vec![Vec3::ZERO; positions.len()];
            let report = fill_missing(&positions, &mut normals, &NoProgress).unwrap();
            assert_eq!(report.n_up, positions.len());
            assert!(normals.iter().all(|&normal| normal == Vec3::Z));
        }
    }

    #[test]
    fn a_missing_normal_comes_from_the_nearest_point_that_has_one() {
        let positions = [0.0, 1.0, 5.0, 6.0, 9.0].map(|x| Vec3::X * x);
        let mut normals = [Vec3::ZERO, Vec3::Y, Vec3::ZERO, Vec3::X, Vec3::ZERO];
        let report = fill_missing(&positions, &mut normals, &NoProgress).unwrap();
        assert_eq!(normals, [Vec3::Y, Vec3::Y, Vec3::X, Vec3::X, Vec3::X]);
        assert_eq!((report.n_estimated, report.n_from_nearest, report.n_up), (2, 3, 0));
    }
}

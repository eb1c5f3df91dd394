//! Preparation: everything between a file's points and points that can be traced, in one call.

use super::neighbors::{Method, Neighbor, Query, Tree, map_neighborhoods};
use super::normals::{NormalReport, PlaneFit, fill_missing, fit_plane};
use super::orient::{Orientation, orient};
use super::radius::{Radius, RadiusReport, Sample, median_distance};
use super::radius::{estimate_radii, kth_distance, limit_strays};
use super::{CleanReport, PointCloud, Scalar, Select, Values, clean, select};
use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;

/// The column that `Preparation::keep_variation` adds.
pub const SURFACE_VARIATION: &str = "surface_variation";

/// What to do with a cloud before it is traced; the default suits raw scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Preparation {
    pub select: Option<Select>,
    pub neighbors: Method,
    /// Whose plane gives a normal. The methods that know only distances take the median distance to k.
    pub normals: Query,
    /// Applies to a column of normals that is wholly estimated.
    pub orientation: Orientation,
    pub radius: Radius,
    /// Adds `SURFACE_VARIATION`: 0 on a plane, up to 1/3.
    pub keep_variation: bool,
    pub seed: u64,
}

impl Default for Preparation {
    fn default() -> Self {
        Self {
            select: None,
            neighbors: Method::Knn,
            normals: Query::Nearest(16),
            orientation: Orientation::None,
            radius: Radius::default(),
            keep_variation: false,
            seed: 0,
        }
    }
}

/// What was done; `None` where the cloud already had what it needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    pub clean: CleanReport,
    pub n_points: usize,
    pub normals: Option<NormalReport>,
    pub radii: Option<RadiusReport>,
}

/// Cleans and selects, then adds the normals and radii that are missing. What a file gives stays.
pub fn prepare(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(PointCloud, Report)> {
    preparation.radius.check()?;
    let (mut cloud, clean) = clean(cloud, progress)?;
    if let Some(choice) = preparation.select {
        cloud = select(&cloud, choice, preparation.seed, progress)?;
    }
    if cloud.is_empty() {
        return Err(Error::EmptyCloud);
    }
    let missing = Missing::of(&cloud, preparation);
    let mut report = Report { clean, n_points: cloud.len(), ..Report::default() };
    let local = measure(&cloud, preparation, &missing, progress)?;
    if let Some(fits) = local.fits {
        if preparation.keep_variation {
            add_variation(&mut cloud, &fits);
        }
        if missing.normals {
            report.normals = Some(add_normals(&mut cloud, &fits, preparation, progress)?);
        }
    }
    if let Some((radii, found)) = local.radii {
        add_radii(&mut cloud, radii);
        report.radii = Some(found);
    }
    Ok((cloud, report))
}

struct Missing {
    normals: bool,
    fits: bool,
    radii: bool,
}

impl Missing {
    fn of(cloud: &PointCloud, preparation: &Preparation) -> Self {
        let normals = cloud.normals.as_ref().is_none_or(|normals| normals.contains(&Vec3::ZERO));
        let radii = cloud.radii.as_ref().is_none_or(|radii| radii.contains(&0.0));
        Self { normals, fits: normals || preparation.keep_variation, radii }
    }
}

/// What neighbourhoods tell, as far as it is missing.
#[derive(Default)]
struct Local {
    fits: Option<Vec<PlaneFit>>,
    radii: Option<(Vec<f32>, RadiusReport)>,
}

fn measure(
    cloud: &PointCloud,
    preparation: &Preparation,
    missing: &Missing,
    progress: &dyn Progress,
) -> Result<Local> {
    let positions = &cloud.positions;
    if let (Method::Knn, Query::Nearest(k_normal), Radius::Adaptive { k: k_radius }, true, true) = (
        preparation.neighbors,
        preparation.normals,
        preparation.radius,
        missing.fits,
        missing.radii,
    ) {
        return measure_together(positions, k_normal, k_radius, progress);
    }
    let mut local = Local::default();
    if missing.fits {
        local.fits = Some(fit_planes(positions, preparation, progress)?);
    }
    if missing.radii {
        let Preparation { radius, seed, .. } = *preparation;
        local.radii = Some(estimate_radii(positions, radius, seed, progress)?);
    }
    Ok(local)
}

/// One search serves both normals and radii.
fn measure_together(
    positions: &[Vec3],
    k_normal: usize,
    k_radius: usize,
    progress: &dyn Progress,
) -> Result<Local> {
    let tree = Tree::new(positions, progress)?;
    let visit = |point: usize, neighbors: &[Neighbor]| {
        let fit = fit_plane(positions, point, &neighbors[..k_normal.min(neighbors.len())]);
        (fit, kth_distance(neighbors, k_radius))
    };
    let both = tree.map(Query::Nearest(k_normal.max(k_radius)), progress, visit)?;
    let (fits, distances) = both.into_iter().unzip();
    let radii = limit_strays(&tree, k_radius, distances, progress)?;
    Ok(Local { fits: Some(fits), radii: Some(radii) })
}

fn fit_planes(
    positions: &[Vec3],
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<Vec<PlaneFit>> {
    let Preparation { neighbors: method, normals: mut query, seed, .. } = *preparation;
    if let (Query::Nearest(k), Method::Grid | Method::ScanLine) = (query, method) {
        // Half of all k nearest lie within the median; twice as many within sqrt(2) times it.
        let sample = Sample { k, samples: 100, seed };
        let distance = std::f32::consts::SQRT_2 * median_distance(positions, &sample, progress)?;
        progress.note(&format!("normals from all points within {distance}, about {k}"));
        query = Query::Within(distance);
    }
    map_neighborhoods(positions, method, query, progress, |point, neighbors| {
        fit_plane(positions, point, neighbors)
    })
}

fn add_variation(cloud: &mut PointCloud, fits: &[PlaneFit]) {
    let values = Values::F32(fits.iter().map(|fit| fit.variation).collect());
    cloud.scalars.retain(|scalar| scalar.name != SURFACE_VARIATION);
    cloud.scalars.push(Scalar { name: SURFACE_VARIATION.to_owned(), values });
}

fn add_normals(
    cloud: &mut PointCloud,
    fits: &[PlaneFit],
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<NormalReport> {
    let Some(given) = cloud.normals.take() else {
        let mut normals = fits.iter().map(|fit| fit.normal).collect::<Vec<_>>();
        let report = fill_missing(&cloud.positions, &mut normals, progress)?;
        cloud.normals = Some(orient(cloud, normals, preparation.orientation, progress)?);
        return Ok(report);
    };
    // Each takes its sign from the nearest normal that the file gives.
    let mut normals = given.clone();
    fill_missing(&cloud.positions, &mut normals, progress)?;
    let mut report = NormalReport::default();
    for ((normal, given), fit) in normals.iter_mut().zip(&given).zip(fits) {
        if *given != Vec3::ZERO {
            continue;
        }
        if fit.normal == Vec3::ZERO {
            report.n_from_nearest += 1;
        } else {
            *normal = if normal.dot(fit.normal) < 0.0 { -fit.normal } else { fit.normal };
            report.n_estimated += 1;
        }
    }
    cloud.normals = Some(normals);
    Ok(report)
}

fn add_radii(cloud: &mut PointCloud, estimated: Vec<f32>) {
    match &mut cloud.radii {
        None => cloud.radii = Some(estimated),
        Some(radii) => {
            let missing = radii.iter_mut().zip(estimated).filter(|(radius, _)| **radius == 0.0);
            missing.for_each(|(radius, estimated)| *radius = estimated);
        }
    }
}

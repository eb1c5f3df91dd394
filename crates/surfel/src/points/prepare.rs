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

impl Preparation {
    /// The error that `prepare` would give for a value out of range.
    pub fn check(&self) -> Result<()> {
        self.radius.check()?;
        if let Query::Nearest(k @ 0..2) = self.normals {
            let expected = "at least 2, to span a plane";
            let name = "number of neighbours for normals";
            return Err(Error::Setting { name, found: k.to_string(), expected });
        }
        Ok(())
    }
}

/// What was done; `None` where the cloud already had what it needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Report {
    pub clean: CleanReport,
    pub n_points: usize,
    pub normals: Option<NormalReport>,
    /// What normals were estimated from: `Preparation::normals`, or the distance that stands for it.
    pub normals_from: Option<Query>,
    pub radii: Option<RadiusReport>,
}

/// Cleans and selects, then adds the normals and radii that are missing. What a file gives stays. Columns
/// that are estimated get their share in each morph target, from the points where it takes them.
pub fn prepare(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(PointCloud, Report)> {
    preparation.check()?;
    let (mut cloud, clean) = clean(cloud, progress)?;
    if let Some(choice) = preparation.select {
        cloud = select(&cloud, choice, preparation.seed, progress)?;
    }
    if cloud.is_empty() {
        return Err(Error::EmptyCloud);
    }
    let missing = Missing::of(&cloud, preparation);
    let estimated = Missing::wholly(&cloud);
    let mut report = Report { clean, n_points: cloud.len(), ..Report::default() };
    let local = measure(&cloud.positions, preparation, &missing, progress)?;
    if let Some((fits, query)) = local.fits {
        if preparation.keep_variation {
            add_variation(&mut cloud, &fits);
        }
        if missing.normals {
            let found = add_normals(&mut cloud, &fits, preparation, progress)?;
            found.repairs().iter().for_each(|line| progress.note(line));
            report.normals = Some(found);
            report.normals_from = Some(query);
        }
    }
    if let Some((radii, found)) = local.radii {
        add_radii(&mut cloud, radii);
        report.radii = Some(found);
    }
    add_to_morphs(&mut cloud, &estimated, preparation, progress)?;
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

    /// Columns of which there is nothing at all.
    fn wholly(cloud: &PointCloud) -> Self {
        let (normals, radii) = (cloud.normals.is_none(), cloud.radii.is_none());
        Self { normals, fits: normals, radii }
    }
}

/// What neighbourhoods tell, as far as it is missing.
#[derive(Default)]
struct Local {
    fits: Option<(Vec<PlaneFit>, Query)>,
    radii: Option<(Vec<f32>, RadiusReport)>,
}

fn measure(
    positions: &[Vec3],
    preparation: &Preparation,
    missing: &Missing,
    progress: &dyn Progress,
) -> Result<Local> {
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
    // Not unzipped: the fits take over the memory of both.
    let distances = both.iter().map(|(_, distance)| *distance).collect();
    let fits = both.into_iter().map(|(fit, _)| fit).collect();
    let radii = limit_strays(&tree, k_radius, distances, progress)?;
    Ok(Local { fits: Some((fits, Query::Nearest(k_normal))), radii: Some(radii) })
}

fn fit_planes(
    positions: &[Vec3],
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(Vec<PlaneFit>, Query)> {
    let Preparation { neighbors: method, normals: mut query, seed, .. } = *preparation;
    if let (Query::Nearest(k), Method::Grid | Method::ScanLine) = (query, method) {
        // Half of all k nearest lie within the median; twice as many within sqrt(2) times it.
        let sample = Sample { k: k.min(positions.len()), samples: 100, seed };
        let distance = std::f32::consts::SQRT_2 * median_distance(positions, &sample, progress)?;
        query = Query::Within(distance);
    }
    let fit = |point: usize, neighbors: &[Neighbor]| fit_plane(positions, point, neighbors);
    Ok((map_neighborhoods(positions, method, query, progress, fit)?, query))
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
    // Each takes its sign from the nearest normal that the file gives; `clean` leaves at least one.
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

/// Gives each morph target what it adds to normals and radii that were estimated: what is estimated where it
/// takes the points, less what is at rest. Between the two both change evenly, as places do.
fn add_to_morphs(
    cloud: &mut PointCloud,
    estimated: &Missing,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<()> {
    let PointCloud { positions, normals, radii, morphs, .. } = cloud;
    if !(estimated.normals || estimated.radii) {
        return Ok(());
    }
    for morph in morphs {
        let moved: Vec<Vec3> = positions.iter().zip(&morph.positions).map(|(a, b)| a + b).collect();
        if !moved.iter().all(|position| position.is_finite()) {
            continue;
        }
        let local = measure(&moved, preparation, estimated, &Unheard(progress))?;
        if let (Some((fits, _)), Some(normals)) = (local.fits, &*normals) {
            let added = |(fit, normal): (&PlaneFit, &Vec3)| match fit.normal {
                // Without a plane of its own it stays as it is; of the two sides it keeps its own.
                Vec3::ZERO => Vec3::ZERO,
                found if found.dot(*normal) < 0.0 => -found - normal,
                found => found - normal,
            };
            morph.normals = Some(fits.iter().zip(normals).map(added).collect());
        }
        if let (Some((moved_radii, _)), Some(radii)) = (local.radii, &*radii) {
            let added = moved_radii.iter().zip(radii).map(|(moved, radius)| moved - radius);
            morph.radii = Some(added.collect());
        }
    }
    Ok(())
}

/// Tells nothing of what was found for points that are only thought of.
struct Unheard<'a>(&'a dyn Progress);

impl Progress for Unheard<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.0.begin(stage, total);
    }

    fn advance(&self, units: u64) {
        self.0.advance(units);
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::progress::Silent;

    fn ball(n_points: usize) -> PointCloud {
        let mut random = Random::new(1, 0);
        let mut direction =
            || Vec3::from_array(std::array::from_fn(|_| random.next_gaussian() as f32));
        PointCloud::from_positions((0..n_points).map(|_| direction().normalize()).collect())
    }

    fn preparations() -> Vec<Preparation> {
        let with = |neighbors| Preparation { neighbors, ..Preparation::default() };
        vec![
            Preparation::default(),
            with(Method::Grid),
            with(Method::ScanLine),
            Preparation { normals: Query::Within(0.1), keep_variation: true, ..with(Method::Knn) },
            Preparation {
                orientation: Orientation::SpanningTree,
                radius: Radius::Median { n: 6, samples: 20 },
                select: Some(Select::Random(3000)),
                ..Preparation::default()
            },
        ]
    }

    #[test]
    fn the_number_of_threads_does_not_change_a_bit() {
        let cloud = ball(5000);
        for preparation in preparations() {
            let with_threads = |n_threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
                pool.install(|| prepare(cloud.clone(), &preparation, &Silent).unwrap())
            };
            let (one, two) = (with_threads(1), with_threads(2));
            assert!(one == two && one == with_threads(5), "{preparation:?}");
        }
    }

    #[test]
    fn poor_clouds_get_whole_columns_or_a_clear_error() {
        let line = (0..40).map(|i| Vec3::X * i as f32).collect();
        let clouds = [vec![Vec3::ONE], vec![Vec3::X, Vec3::Y], vec![Vec3::ONE; 50], line];
        for preparation in preparations() {
            for positions in &clouds {
                let cloud = PointCloud::from_positions(positions.clone());
                let (cloud, report) = prepare(cloud, &preparation, &Silent).unwrap();
                assert!(cloud.normals.unwrap().iter().all(|normal| normal.is_normalized()));
                assert!(cloud.radii.unwrap().iter().all(|&radius| 0.0 < radius && radius < 1e3));
                assert!(0 < report.n_points);
            }
            for positions in [vec![], vec![Vec3::NAN; 3]] {
                let cloud = PointCloud::from_positions(positions);
                assert_eq!(prepare(cloud, &preparation, &Silent), Err(Error::EmptyCloud));
            }
        }
    }

    #[test]
    fn what_a_file_gives_stays_and_only_the_missing_is_estimated() {
        let mut cloud = ball(3000);
        let mut normals: Vec<Vec3> = cloud.positions.iter().map(|&p| -p).collect();
        normals[10] = Vec3::ZERO;
        let mut radii = vec![0.25; 3000];
        radii[20] = f32::NAN;
        (cloud.normals, cloud.radii) = (Some(normals.clone()), Some(radii));
        let (prepared, report) = prepare(cloud, &Preparation::default(), &Silent).unwrap();
        let found = prepared.normals.unwrap();
        assert!(found[10].dot(-prepared.positions[10]) > 0.99, "signed as the file's neighbours");
        assert_eq!(report.normals.unwrap().n_estimated, 1);
        assert_eq!(report.normals.unwrap().repairs(), None);
        assert!(found[11].dot(normals[11]) > 0.999_999);
        let radii = prepared.radii.unwrap();
        assert!(radii[19] == 0.25 && radii[20] != 0.25 && 0.0 < radii[20]);
    }

    #[test]
    fn what_was_estimated_is_told_by_the_report_and_only_repairs_are_notes() {
        struct Listener(std::sync::Mutex<Vec<String>>);
        impl Progress for Listener {
            fn note(&self, line: &str) {
                self.0.lock().unwrap().push(line.to_owned());
            }
        }
        let listener = Listener(Default::default());
        let mut cloud = ball(3000);
        let (_, report) = prepare(cloud.clone(), &Preparation::default(), &listener).unwrap();
        let line = report.normals.unwrap().line(report.normals_from.unwrap());
        assert_eq!(line, "normals of 3000 points from 16 neighbours");
        // A line of points far away has no planes.
        cloud.positions.extend((0..40).map(|i| Vec3::X * (1000.0 + i as f32)));
        let grid = Preparation { neighbors: Method::Grid, ..Preparation::default() };
        let (_, report) = prepare(cloud, &grid, &listener).unwrap();
        let line = report.normals.unwrap().line(report.normals_from.unwrap());
        assert!(line.starts_with("normals of 3040 points from all points within 0."), "{line}");
        let notes = listener.0.lock().unwrap();
        assert_eq!(notes.iter().filter(|note| note.contains("without a plane")).count(), 1);
        assert!(notes.iter().all(|note| !note.starts_with("normals")), "{notes:?}");
    }

    #[test]
    fn variation_is_kept_on_request() {
        let preparation = Preparation { keep_variation: true, ..Preparation::default() };
        let (cloud, _) = prepare(ball(500), &preparation, &Silent).unwrap();
        let (cloud, report) = prepare(cloud, &preparation, &Silent).unwrap();
        assert_eq!((report.normals, report.radii), (None, None));
        assert_eq!(cloud.scalars.len(), 1);
        assert_eq!(cloud.scalar(SURFACE_VARIATION).unwrap().len(), 500);
    }

    #[test]
    fn settings_without_a_meaning_are_errors() {
        for preparation in [
            Preparation { normals: Query::Nearest(1), ..Preparation::default() },
            Preparation { normals: Query::Within(0.0), ..Preparation::default() },
            Preparation { radius: Radius::Fixed(-1.0), ..Preparation::default() },
            Preparation { select: Some(Select::Stride(0.5)), ..Preparation::default() },
        ] {
            assert!(matches!(prepare(ball(9), &preparation, &Silent), Err(Error::Setting { .. })));
        }
    }

    #[test]
    fn cancelling_leaves_with_an_error() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn is_cancelled(&self) -> bool {
                true
            }
        }
        for preparation in preparations() {
            assert_eq!(prepare(ball(100), &preparation, &Cancelled), Err(Error::Cancelled));
        }
    }
}

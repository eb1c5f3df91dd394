//! Preparation: cleans a cloud, thins and denoises it, and adds the normals and radii that it lacks.

use super::clean::{CleanReport, Duplicates, clean};
use super::denoise::{Denoise, DenoiseReport, denoise};
use super::find_structures::{all_scattered, find_structures};
use super::free_space::narrow_to_free_space;
use super::jets::{JetFit, MIN_JET_NEIGHBORS, fit_nearest_jet, refine_normals};
use super::mixed_pixels::{MixedPixels, without_mixed_pixels};
use super::neighbors::{KdTree, Neighbor, NeighborMethod, Neighborhood, map_neighborhoods};
use super::normals::{NormalReport, PlaneFit, fill_missing, fit_plane};
use super::orient::{Orientation, has_stations, orient, turn_to_stations};
use super::outliers::{OutlierRemoval, remove_outliers};
use super::radius::{DistanceSample, Radius, RadiusReport, median_distance};
use super::radius::{clamp_outlier_radii, estimate_radii, kth_distance};
use super::structure::{PointShape, Structure, StructureChoice, StructureReport};
use super::subsample::{Subsample, subsample};
use super::{PointCloud, PreparedCloud, Scalar, Values};
use crate::error::{Error, Result};
use crate::math::Vec3;
use crate::progress::Progress;

/// Name of the scalar column that `Preparation::keep_variation` adds.
pub const SURFACE_VARIATION: &str = "surface_variation";

/// Settings of [`prepare`]. The default suits raw scans.
#[derive(Clone, Debug, PartialEq)]
pub struct Preparation {
    /// The choice whether duplicates are dropped.
    pub duplicates: Duplicates,
    /// The choice whether points in the air between two surfaces are dropped, where the grid of a scan tells them.
    pub mixed_pixels: MixedPixels,
    /// The points to keep; none keeps all.
    pub subsample: Option<Subsample>,
    /// The outliers to remove; none keeps all points.
    pub remove_outliers: Option<OutlierRemoval>,
    /// The choice whether noisy points are moved onto their surface.
    pub denoise: Denoise,
    /// The method that finds neighbours.
    pub neighbors: NeighborMethod,
    /// The neighbours whose plane gives a normal. Methods that know only distances use the median distance to k.
    pub normals: Neighborhood,
    /// The signs of normals. Applies if all normals are estimated; `Orientation::Auto` also turns those of the file to
    /// the stations, if these are known.
    pub orientation: Orientation,
    /// The choice of radii.
    pub radius: Radius,
    /// The choice of structures. Applies if all radii are estimated by `Radius::Adaptive`.
    pub structure: StructureChoice,
    /// True to narrow what reaches into space through which a scanner saw, where the grid of a scan tells it. Applies if
    /// structures are found.
    pub free_space: bool,
    /// True to add the column `SURFACE_VARIATION`: 0 on a plane, up to 1/3.
    pub keep_variation: bool,
    /// Seed of all random choices.
    pub seed: u64,
}

impl Default for Preparation {
    fn default() -> Self {
        Self {
            duplicates: Duplicates::default(),
            mixed_pixels: MixedPixels::default(),
            subsample: None,
            remove_outliers: None,
            denoise: Denoise::default(),
            neighbors: NeighborMethod::Knn,
            normals: Neighborhood::Nearest(16),
            orientation: Orientation::None,
            radius: Radius::default(),
            structure: StructureChoice::default(),
            free_space: true,
            keep_variation: false,
            seed: 0,
        }
    }
}

impl Preparation {
    /// Checks the settings.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Setting`] for a value out of range, as [`prepare`] does.
    pub fn check(&self) -> Result<()> {
        self.radius.check()?;
        if let Neighborhood::Nearest(k @ 0..2) = self.normals {
            let expected = "at least 2, to span a plane";
            let name = "number of neighbours for normals";
            return Err(Error::Setting { name, found: k.to_string(), expected });
        }
        Ok(())
    }
}

/// Report of [`prepare`]. A field is none if the cloud already had the column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreparationReport {
    /// Repairs of the cloud.
    pub clean: CleanReport,
    /// Effect of denoising, if points were moved.
    pub denoise: Option<DenoiseReport>,
    /// Number of points after cleaning and subsampling.
    pub n_points: usize,
    /// Origin of the estimated normals.
    pub normals: Option<NormalReport>,
    /// The neighbourhood that normals were estimated from: `Preparation::normals`, or the distance used in its place.
    pub normals_from: Option<Neighborhood>,
    /// Statistics of the estimated radii.
    pub radii: Option<RadiusReport>,
    /// Numbers of points by structure.
    pub structure: Option<StructureReport>,
}

/// Cleans a cloud, thins it, removes outliers and noise, then adds the normals and radii that are missing. Those of the
/// file stay. Columns that are estimated get offsets in each morph target, estimated from the points where the target moves them.
///
/// # Errors
///
/// Returns [`Error::Setting`] for a setting out of range, [`Error::EmptyCloud`] if no point is left,
/// [`Error::TooManyPoints`] beyond 32-bit indices, and [`Error::Cancelled`] if `progress` is cancelled.
pub fn prepare(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(PreparedCloud, PreparationReport)> {
    preparation.check()?;
    let (mut cloud, clean) = clean(cloud, preparation.duplicates, progress)?;
    if preparation.mixed_pixels == MixedPixels::Drop
        && let Some(kept) = without_mixed_pixels(&cloud)
    {
        let n_mixed = cloud.len() - kept.len();
        let line = format!("{n_mixed} mixed pixels between two surfaces dropped");
        progress.choice(&line, &["mixed_pixels"]);
        cloud = cloud.subset(&kept);
    }
    if let Some(choice) = preparation.subsample {
        cloud = subsample(&cloud, choice, preparation.seed, progress)?;
    }
    if let Some(choice) = preparation.remove_outliers {
        cloud = remove_outliers(&cloud, choice, progress)?;
    }
    if cloud.is_empty() {
        return Err(Error::EmptyCloud);
    }
    let denoised = denoise(&mut cloud, preparation.denoise, progress)?;
    let (denoise, denoised_normals) = denoised.map(|found| (found.report, found.normals)).unzip();
    let missing = Missing::any(&cloud, preparation);
    let estimated = Missing::all(&cloud);
    let mut report =
        PreparationReport { clean, denoise, n_points: cloud.len(), ..Default::default() };
    let mut estimates =
        estimate(&cloud.positions, denoised_normals.as_deref(), preparation, &missing, progress)?;
    let shapes = match missing.structure {
        true => find_shapes(&cloud, &mut estimates, preparation, progress)?,
        false => None,
    };
    if let Some((fits, neighborhood)) = estimates.fits {
        if preparation.keep_variation {
            add_variation(&mut cloud, &fits);
        }
        if missing.normals {
            let found = add_normals(&mut cloud, &fits, preparation, progress)?;
            found.repairs().iter().for_each(|line| progress.note(line));
            report.normals = Some(found);
            report.normals_from = Some(neighborhood);
        }
    }
    let by_stations = matches!(preparation.orientation, Orientation::Auto | Orientation::Station);
    if by_stations && !estimated.normals {
        turn_given_normals(&mut cloud, progress);
    }
    if let Some((radii, found)) = estimates.radii {
        add_radii(&mut cloud, radii);
        report.radii = Some(found);
    }
    if let Some((shapes, found)) = shapes {
        add_structures(&mut cloud, &shapes);
        report.structure = Some(found);
    }
    add_to_morphs(&mut cloud, &estimated, preparation, progress)?;
    Ok((PreparedCloud::new(cloud)?, report))
}

/// The columns to estimate.
struct Missing {
    normals: bool,
    fits: bool,
    radii: bool,
    structure: bool,
}

impl Missing {
    /// Columns with missing entries.
    fn any(cloud: &PointCloud, preparation: &Preparation) -> Self {
        let normals = cloud.normals.as_ref().is_none_or(|normals| normals.contains(&Vec3::ZERO));
        let radii = cloud.radii.as_ref().is_none_or(|radii| radii.contains(&0.0));
        // Points that move may change their structure.
        let structure = cloud.radii.is_none()
            && cloud.morphs.is_empty()
            && cloud.skin.is_none()
            && cloud.structures().is_none()
            && preparation.structure != StructureChoice::Surface
            && matches!(preparation.radius, Radius::Adaptive { .. });
        let is_searched = structure && preparation.structure == StructureChoice::Auto;
        let fits = normals || preparation.keep_variation || is_searched;
        Self { normals, fits, radii, structure }
    }

    /// Columns that the cloud lacks altogether.
    fn all(cloud: &PointCloud) -> Self {
        let (normals, radii) = (cloud.normals.is_none(), cloud.radii.is_none());
        Self { normals, fits: normals, radii, structure: false }
    }
}

/// Estimates from neighbourhoods, none where nothing is missing.
#[derive(Default)]
struct Estimates {
    fits: Option<(Vec<PlaneFit>, Neighborhood)>,
    radii: Option<(Vec<f32>, RadiusReport)>,
}

/// Fits planes and estimates radii as far as they are missing. `normals` are those that denoising has found, zero where
/// it has not.
fn estimate(
    positions: &[Vec3],
    normals: Option<&[Vec3]>,
    preparation: &Preparation,
    missing: &Missing,
    progress: &dyn Progress,
) -> Result<Estimates> {
    let Preparation { radius, seed, .. } = *preparation;
    let k_radius = match radius {
        Radius::Adaptive { k } if missing.radii => Some(k),
        _ => None,
    };
    let mut estimates = match (preparation.neighbors, preparation.normals) {
        (NeighborMethod::Knn, Neighborhood::Nearest(k)) if missing.fits => {
            estimate_by_nearest(positions, normals, k, k_radius, progress)?
        }
        _ if missing.fits => {
            Estimates { fits: Some(fit_planes(positions, preparation, progress)?), radii: None }
        }
        _ => Estimates::default(),
    };
    if missing.radii && estimates.radii.is_none() {
        estimates.radii = Some(estimate_radii(positions, radius, seed, progress)?);
    }
    Ok(estimates)
}

/// Fits planes and cubics to the nearest neighbours, and estimates radii from the same search if `k_radius` is given.
fn estimate_by_nearest(
    positions: &[Vec3],
    normals: Option<&[Vec3]>,
    k_normal: usize,
    k_radius: Option<usize>,
    progress: &dyn Progress,
) -> Result<Estimates> {
    let tree = KdTree::new(positions, progress)?;
    let visit = |point: usize, neighbors: &[Neighbor]| {
        let fit = fit_plane(positions, point, &neighbors[..k_normal.min(neighbors.len())]);
        let jet = fit_nearest_jet(positions, point, neighbors, &fit, k_normal);
        (fit, jet, k_radius.map_or(0.0, |k| kth_distance(neighbors, k)))
    };
    let k = k_normal.max(k_radius.unwrap_or(0)).max(MIN_JET_NEIGHBORS);
    let found = tree.map(Neighborhood::Nearest(k), progress, visit)?;
    let distances = found.iter().map(|(.., distance)| *distance).collect();
    let jets: Vec<Option<JetFit>> = found.iter().map(|(_, jet, _)| *jet).collect();
    let mut fits: Vec<PlaneFit> = found.into_iter().map(|(fit, ..)| fit).collect();
    refine_normals(&tree, &mut fits, &jets, normals, progress)?;
    let radii = k_radius.map(|k| clamp_outlier_radii(&tree, k, distances, progress)).transpose()?;
    Ok(Estimates { fits: Some((fits, Neighborhood::Nearest(k_normal))), radii })
}

/// Finds the structures of points, and replaces the estimates by those of their structure.
fn find_shapes(
    cloud: &PointCloud,
    estimates: &mut Estimates,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<Option<(Vec<PointShape>, StructureReport)>> {
    let Estimates { fits, radii: Some((radii, report)) } = estimates else { return Ok(None) };
    let tree = KdTree::new(&cloud.positions, progress)?;
    let (mut shapes, mut found) = match (preparation.structure, &mut *fits) {
        (StructureChoice::Auto, Some((fits, _))) => find_structures(&tree, fits, radii, progress)?,
        _ => all_scattered(&tree, radii, progress)?,
    };
    if preparation.free_space {
        let fits = fits.as_ref().map_or(&[][..], |(fits, _)| fits);
        let report = narrow_to_free_space(cloud, &tree, fits, &mut shapes, progress)?;
        report.line().iter().for_each(|line| progress.choice(line, &["free_space"]));
        if 0 < report.n_lines {
            found = StructureReport::of(&shapes);
        }
    }
    if let (StructureChoice::Auto, Some((fits, _))) = (preparation.structure, fits) {
        for (fit, shape) in fits.iter_mut().zip(&shapes) {
            if shape.structure == Structure::Surface {
                fit.normal = shape.normal;
            }
        }
    }
    *radii = shapes.iter().map(|shape| shape.radius).collect();
    report.update(radii);
    Ok(Some((shapes, found)))
}

/// Adds the column of structures, and gives the points of lines the direction of the line in place of a normal.
fn add_structures(cloud: &mut PointCloud, shapes: &[PointShape]) {
    let structures: Vec<Structure> = shapes.iter().map(|shape| shape.structure).collect();
    if let Some(normals) = &mut cloud.normals {
        for (normal, shape) in normals.iter_mut().zip(shapes) {
            if shape.structure == Structure::Line {
                *normal = shape.normal;
            }
        }
    }
    cloud.set_structures(&structures);
}

fn fit_planes(
    positions: &[Vec3],
    preparation: &Preparation,
    progress: &dyn Progress,
) -> Result<(Vec<PlaneFit>, Neighborhood)> {
    let Preparation { neighbors: method, normals: mut neighborhood, seed, .. } = *preparation;
    if let (Neighborhood::Nearest(k), NeighborMethod::Grid | NeighborMethod::ScanLine) =
        (neighborhood, method)
    {
        // Half of the k nearest points lie within the median distance, all k within about sqrt(2) times it.
        let sample = DistanceSample { k: k.min(positions.len()), samples: 100, seed };
        let distance = std::f32::consts::SQRT_2 * median_distance(positions, &sample, progress)?;
        neighborhood = Neighborhood::Within(distance);
    }
    let fit = |point: usize, neighbors: &[Neighbor]| fit_plane(positions, point, neighbors);
    Ok((map_neighborhoods(positions, method, neighborhood, progress, fit)?, neighborhood))
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
    // Each takes its sign from the nearest normal of the file; `clean` leaves at least one.
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

/// Turns the normals of the file to the stations, if these are known.
fn turn_given_normals(cloud: &mut PointCloud, progress: &dyn Progress) {
    let Some(mut normals) = cloud.normals.take() else { return };
    let n_turned = if has_stations(cloud) { turn_to_stations(cloud, &mut normals) } else { 0 };
    if 0 < n_turned {
        let line = format!("{n_turned} normals of the file turned toward the station of each scan");
        progress.choice(&line, &["orient"]);
    }
    cloud.normals = Some(normals);
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

/// Adds offsets of the estimated normals and radii to each morph target: the estimates from the positions of the
/// target minus those at rest. In between both change linearly, as positions do.
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
        let estimates = estimate(&moved, None, preparation, estimated, &WithoutNotes(progress))?;
        if let (Some((fits, _)), Some(normals)) = (estimates.fits, &*normals) {
            let added = |(fit, normal): (&PlaneFit, &Vec3)| match fit.normal {
                // Without a plane at the target, the normal stays; otherwise it keeps its side.
                Vec3::ZERO => Vec3::ZERO,
                found if found.dot(*normal) < 0.0 => -found - normal,
                found => found - normal,
            };
            morph.normals = Some(fits.iter().zip(normals).map(added).collect());
        }
        if let (Some((moved_radii, _)), Some(radii)) = (estimates.radii, &*radii) {
            let added = moved_radii.iter().zip(radii).map(|(moved, radius)| moved - radius);
            morph.radii = Some(added.collect());
        }
    }
    Ok(())
}

/// Drops the notes about points of morph targets.
struct WithoutNotes<'a>(&'a dyn Progress);

impl Progress for WithoutNotes<'_> {
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
    //! Prepared columns, reports and errors.

    use super::*;
    use crate::math::Random;
    use crate::points::STRUCTURE;
    use crate::progress::NoProgress;

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
            with(NeighborMethod::Grid),
            with(NeighborMethod::ScanLine),
            Preparation {
                normals: Neighborhood::Within(0.1),
                keep_variation: true,
                ..with(NeighborMethod::Knn)
            },
            Preparation {
                orientation: Orientation::SpanningTree,
                radius: Radius::Median { n: 6, samples: 20 },
                subsample: Some(Subsample::Random(3000)),
                ..Preparation::default()
            },
        ]
    }

    #[test]
    fn output_is_independent_of_thread_count() {
        let cloud = ball(5000);
        for preparation in preparations() {
            let with_threads = |n_threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
                pool.install(|| prepare(cloud.clone(), &preparation, &NoProgress).unwrap())
            };
            let (one, two) = (with_threads(1), with_threads(2));
            assert!(one == two && one == with_threads(5), "{preparation:?}");
        }
    }

    #[test]
    fn degenerate_clouds_are_filled_or_rejected() {
        let line = (0..40).map(|i| Vec3::X * i as f32).collect();
        // Each cloud with the number of its distinct points.
        let clouds = [
            (vec![Vec3::ONE], 1),
            (vec![Vec3::X, Vec3::Y], 2),
            (vec![Vec3::ONE; 50], 1),
            (line, 40),
        ];
        for preparation in preparations() {
            for (positions, n_distinct) in &clouds {
                let cloud = PointCloud::from_positions(positions.clone());
                let (cloud, report) = prepare(cloud, &preparation, &NoProgress).unwrap();
                assert!(cloud.normals().iter().all(|normal| normal.is_normalized()));
                assert!(cloud.radii().iter().all(|&radius| 0.0 < radius && radius < 1e3));
                assert_eq!(report.n_points, *n_distinct);
                let lens = [cloud.len(), cloud.normals().len(), cloud.radii().len()];
                assert_eq!(lens, [*n_distinct; 3]);
            }
            for positions in [vec![], vec![Vec3::NAN; 3]] {
                let cloud = PointCloud::from_positions(positions);
                assert_eq!(prepare(cloud, &preparation, &NoProgress), Err(Error::EmptyCloud));
            }
        }
    }

    #[test]
    fn normals_do_not_depend_on_the_choice_of_radii() {
        let radii = [Radius::default(), Radius::Fixed(0.1), Radius::Median { n: 6, samples: 20 }];
        let normals = radii.map(|radius| {
            // Edges are sought with structures, which only adaptive radii have.
            let structure = StructureChoice::Surface;
            let preparation = Preparation { radius, structure, ..Preparation::default() };
            prepare(ball(3000), &preparation, &NoProgress).unwrap().0.normals().to_vec()
        });
        assert!(normals[0] == normals[1] && normals[0] == normals[2]);
    }

    #[test]
    fn columns_of_the_file_stay_and_missing_entries_are_estimated() {
        let mut cloud = ball(3000);
        let mut normals: Vec<Vec3> = cloud.positions.iter().map(|&p| -p).collect();
        normals[10] = Vec3::ZERO;
        let mut radii = vec![0.25; 3000];
        radii[20] = f32::NAN;
        (cloud.normals, cloud.radii) = (Some(normals.clone()), Some(radii));
        let (prepared, report) = prepare(cloud, &Preparation::default(), &NoProgress).unwrap();
        let found = prepared.normals();
        assert!(
            found[10].dot(-prepared.positions[10]) > 0.99,
            "the sign is that of the neighbours"
        );
        assert_eq!(report.normals.unwrap().n_estimated, 1);
        assert_eq!(report.normals.unwrap().repairs(), None);
        assert!(found[11].dot(normals[11]) > 0.999_999);
        let radii = prepared.radii();
        assert!(radii[19] == 0.25 && radii[20] != 0.25 && 0.0 < radii[20]);
    }

    #[test]
    fn the_report_has_the_estimates_and_notes_have_only_repairs() {
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
        assert!(line.starts_with("normals of 3000 points from planes through 16 neighbours,"));
        // A line of points far away has no planes.
        cloud.positions.extend((0..40).map(|i| Vec3::X * (1000.0 + i as f32)));
        let grid = Preparation { neighbors: NeighborMethod::Grid, ..Preparation::default() };
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
        let (cloud, _) = prepare(ball(500), &preparation, &NoProgress).unwrap();
        let (cloud, report) = prepare(cloud.into_inner(), &preparation, &NoProgress).unwrap();
        assert_eq!((report.normals, report.radii), (None, None));
        let names: Vec<&str> = cloud.scalars.iter().map(|scalar| scalar.name.as_str()).collect();
        assert_eq!(names, [STRUCTURE, SURFACE_VARIATION]);
        assert_eq!(cloud.scalar(SURFACE_VARIATION).unwrap().len(), 500);
    }

    #[test]
    fn invalid_settings_are_errors() {
        for preparation in [
            Preparation { normals: Neighborhood::Nearest(1), ..Preparation::default() },
            Preparation { normals: Neighborhood::Within(0.0), ..Preparation::default() },
            Preparation { radius: Radius::Fixed(-1.0), ..Preparation::default() },
            Preparation { subsample: Some(Subsample::Stride(0.5)), ..Preparation::default() },
        ] {
            assert!(matches!(
                prepare(ball(9), &preparation, &NoProgress),
                Err(Error::Setting { .. })
            ));
        }
    }

    #[test]
    fn cancellation_is_an_error() {
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

//! Preparation: cleans a cloud, thins and denoises it, and adds the normals and radii that it lacks.

use super::add_columns::{
    add_normals, add_radii, add_structures, add_variation, drop_parted_structures,
    orient_given_normals, orientation_by_rings,
};
use super::cleaning::clean::CleanReport;
use super::denoising::denoise::{Denoise, DenoiseReport, denoise};
use super::denoising::line_axes::{LineReport, find_axes, move_to_axes};
use super::estimate::{Estimates, Missing, estimate, find_shapes};
use super::morph_offsets::add_morph_offsets;
use super::neighbors::Neighborhood;
use super::normals::planes::NormalReport;
use super::preparation::Preparation;
use super::radii::curvature::radii_by_curvature;
use super::radii::normal_lengths::take_radii_from_normals;
use super::radii::radius::{Radius, RadiusReport};
use super::scan::scan_rings::ScanRings;
use super::select_points::{Selection, select};
use super::structure::elevation_grid::elevation_grid;
use super::structure::point_shape::{PointShape, Structure, StructureChoice, StructureReport};
use super::{PointCloud, PreparedCloud};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::words::counted;

/// Report of [`prepare`]. A field is none if the cloud already had the column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PreparationReport {
    /// Repairs of the cloud.
    pub clean: CleanReport,
    /// Effect of denoising, if points were moved.
    pub denoise: Option<DenoiseReport>,
    /// Effect of moving points onto the axes of lines, if points were moved.
    pub lines: Option<LineReport>,
    /// Number of points after all steps that drop points.
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

/// Cleans a cloud, thins it, removes outliers and noise, then adds the radii that are missing, and the normals if they
/// are wanted. Those of the file stay. Columns that are estimated get offsets in each morph target, estimated from the
/// points where the target moves them.
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
    let mut cloud = cloud;
    if preparation.radii_from_normals {
        take_radii_from_normals(&mut cloud, progress)?;
    }
    let Selection { mut cloud, report: clean, is_thinned } = select(cloud, preparation, progress)?;
    if cloud.is_empty() {
        return Err(Error::EmptyCloud);
    }
    drop_parted_structures(&mut cloud, preparation);
    // The rays of points that were left out say nothing about free space.
    let preparation =
        &Preparation { free_space: preparation.free_space && !is_thinned, ..preparation.clone() };
    let missing = Missing::any(&cloud, preparation);
    let rings = if missing.fits { ScanRings::find(&cloud, progress)? } else { None };
    let finds_structures = missing.structure && preparation.structure == StructureChoice::Auto;
    // Denoising moves points off the grid.
    let grid = finds_structures.then(|| elevation_grid(&cloud.positions)).flatten();
    if finds_structures {
        report_pattern(rings.as_ref(), grid, progress);
    }
    let denoised = denoise(&mut cloud, preparation.denoise, progress)?;
    let (denoise, denoised_normals) = denoised.map(|found| (found.report, found.normals)).unzip();
    let estimated = Missing::all(&cloud, preparation);
    let mut report =
        PreparationReport { clean, denoise, n_points: cloud.len(), ..Default::default() };
    let mut estimates =
        estimate(&cloud.positions, denoised_normals.as_deref(), preparation, &missing, progress)?;
    let mut shapes = match missing.structure {
        true => find_shapes(
            &cloud,
            &mut estimates,
            preparation,
            rings.as_ref(),
            grid.is_some(),
            progress,
        )?,
        false => None,
    };
    let Estimates { fits, mut radii, tree, .. } = estimates;
    if let (Some((shapes, _)), Some((radii, found)), Some(tree), true) =
        (&mut shapes, &mut radii, tree, preparation.denoise != Denoise::Off)
    {
        let scanner = rings.as_ref().map(|rings| (rings.scanner - cloud.origin).as_vec3());
        let axes = find_axes(&cloud, &tree, shapes, scanner, progress)?;
        drop(tree);
        report.lines = move_to_axes(&axes, &mut cloud.positions, shapes);
        radii.iter_mut().zip(shapes).for_each(|(radius, shape)| *radius = shape.radius);
        found.update(radii);
    }
    if let Some((fits, neighborhood)) = fits {
        if preparation.keep_variation {
            add_variation(&mut cloud, &fits);
        }
        if missing.normals {
            let orientation = orientation_by_rings(&cloud, preparation, rings.as_ref(), progress);
            let mut found = add_normals(&mut cloud, &fits, orientation, progress)?;
            if let Some((shapes, _)) = &shapes {
                found.leave_out_lines(&fits, shapes);
            }
            found.repairs().iter().for_each(|line| progress.note(line));
            report.normals = Some(found);
            report.normals_from = Some(neighborhood);
        }
    }
    if !estimated.normals {
        orient_given_normals(&mut cloud, preparation.orientation, progress)?;
    }
    if let Some((mut radii, mut found)) = radii {
        if let Radius::Curvature { k } = preparation.radius {
            let shapes = shapes.as_ref().map(|(shapes, _)| shapes.as_slice());
            follow_curvature(&cloud, k, shapes, &mut radii, progress)?;
            found.update(&radii);
        }
        add_radii(&mut cloud, radii);
        report.radii = Some(found);
    }
    if let Some((shapes, found)) = shapes {
        add_structures(&mut cloud, &shapes);
        report.structure = Some(found);
    }
    add_morph_offsets(&mut cloud, &estimated, preparation, progress)?;
    let cloud = match &report.structure {
        Some(found) => PreparedCloud::with_leaves(cloud, found.has_leaves)?,
        None => PreparedCloud::new(cloud)?,
    };
    Ok((cloud, report))
}

/// Reports the rings of a spinning scanner and the grid of elevations that the search for structures follows.
fn report_pattern(rings: Option<&ScanRings>, grid: Option<[usize; 2]>, progress: &dyn Progress) {
    if let Some(ScanRings { rings, .. }) = rings {
        let line = format!("{} of a spinning scanner", counted(rings.len(), "ring"));
        progress.choice(&format!("{line}: gaps between them are closed"), &["structure"]);
    }
    if let Some([n_columns, n_rows]) = grid {
        let line = format!("one point for each cell of a grid of {n_columns}x{n_rows}: a surface");
        progress.choice(&line, &["structure"]);
    }
}

/// Reduces the radii of points of surfaces where their surface bends, if normals tell how much.
fn follow_curvature(
    cloud: &PointCloud,
    k: usize,
    shapes: Option<&[PointShape]>,
    radii: &mut [f32],
    progress: &dyn Progress,
) -> Result<()> {
    let Some(normals) = &cloud.normals else { return Ok(()) };
    let by_curvature = radii_by_curvature(&cloud.positions, normals, radii, k, progress)?;
    let is_surface = |i: usize| shapes.is_none_or(|all| all[i].structure == Structure::Surface);
    for (i, (radius, by_curvature)) in radii.iter_mut().zip(by_curvature).enumerate() {
        if is_surface(i) {
            *radius = by_curvature;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! Prepared columns, reports and errors.

    use super::*;
    use crate::math::{DVec3, Random, Vec3};
    use crate::points::neighbors::NeighborMethod;
    use crate::points::scan::scan_grid::tests::scan;
    use crate::points::{
        Orientation, STRUCTURE, SURFACE_VARIATION, StructureChoice, Subsample, Values,
    };
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
    fn normals_that_nobody_wants_are_not_estimated() {
        let structure = StructureChoice::Surface;
        let wanted = Preparation { structure, ..Preparation::default() };
        let unwanted = Preparation { estimates_normals: false, ..wanted.clone() };
        let with_normals = prepare(ball(3000), &wanted, &NoProgress).unwrap().0;
        let (without, report) = prepare(ball(3000), &unwanted, &NoProgress).unwrap();
        assert!(without.normals.is_none() && report.normals.is_none());
        assert_eq!(without.radii(), with_normals.radii());
        // Those of a file stay, and are completed.
        let mut given = ball(3000);
        given.normals = Some(given.positions.clone());
        given.normals.as_mut().unwrap()[7] = Vec3::ZERO;
        let kept = prepare(given, &unwanted, &NoProgress).unwrap().0;
        assert!(0.9 < kept.normals()[7].dot(kept.positions()[7]));
    }

    #[test]
    fn normals_do_not_depend_on_the_choice_of_radii() {
        let radii = [
            Radius::default(),
            Radius::Fixed(0.1),
            Radius::Median { n: 6, samples: 20 },
            Radius::Adaptive { k: 64 },
        ];
        let normals = radii.map(|radius| {
            // Edges are sought with structures, which only adaptive radii have.
            let structure = StructureChoice::Surface;
            let preparation = Preparation { radius, structure, ..Preparation::default() };
            prepare(ball(3000), &preparation, &NoProgress).unwrap().0.normals().to_vec()
        });
        assert!(normals.iter().all(|other| *other == normals[0]));
    }

    #[test]
    fn normals_are_oriented_if_all_points_with_a_normal_are_dropped() {
        let mut cloud = ball(3000);
        let mut normals = vec![Vec3::ZERO; 3000];
        normals[2999] = Vec3::Z;
        cloud.normals = Some(normals);
        let preparation = Preparation {
            subsample: Some(Subsample::First(2999)),
            orientation: Orientation::Viewpoint(DVec3::ZERO),
            structure: StructureChoice::Surface,
            ..Preparation::default()
        };
        let cloud = prepare(cloud, &preparation, &NoProgress).unwrap().0;
        let mut pairs = cloud.normals().iter().zip(cloud.positions());
        assert!(pairs.all(|(normal, position)| normal.dot(*position) <= 0.0));
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
        let grid = Preparation {
            neighbors: NeighborMethod::Grid,
            structure: StructureChoice::Surface,
            ..Preparation::default()
        };
        let (_, report) = prepare(cloud, &grid, &listener).unwrap();
        let line = report.normals.unwrap().line(report.normals_from.unwrap());
        assert!(line.starts_with("normals of 3040 points from all points within 0."), "{line}");
        let notes = listener.0.lock().unwrap();
        assert_eq!(notes.iter().filter(|note| note.contains("without a plane")).count(), 1);
        assert!(notes.iter().all(|note| !note.starts_with("normals")), "{notes:?}");
    }

    #[test]
    fn structures_without_their_normals_or_radii_are_found_again() {
        let wire = (0..600).map(|i| Vec3::new(0.02 * i as f32, 0.0, 3.0)).collect();
        let wire = PointCloud::from_positions(wire);
        let preparation = Preparation { denoise: Denoise::Off, ..Preparation::default() };
        let (found, report) = prepare(wire, &preparation, &NoProgress).unwrap();
        assert_eq!(report.normals.unwrap().repairs(), None, "a line spans no plane");
        let found = found.into_inner();
        let again = |change: fn(&mut PointCloud)| {
            let mut cloud = found.clone();
            change(&mut cloud);
            prepare(cloud, &preparation, &NoProgress).unwrap().0.into_inner()
        };
        let is_along = |normal: &Vec3| 0.99 < normal.x.abs();
        assert!(found.normals.as_ref().unwrap().iter().all(is_along));
        assert_eq!(again(|cloud| cloud.normals = None), found);
        assert_eq!(again(|cloud| cloud.radii = None), found);
        // A column that merely has this name.
        let other = |cloud: &mut PointCloud| {
            cloud.radii = None;
            cloud.scalars[0].values = Values::U8((0..600).map(|i| i as u8).collect());
        };
        assert_eq!(again(other), found);
    }

    #[test]
    fn a_chosen_orientation_turns_the_normals_of_a_file() {
        let viewpoint = Orientation::Viewpoint(DVec3::ZERO);
        for (orientation, sense) in [(viewpoint, -1.0), (Orientation::SpanningTree, 1.0)] {
            let mut cloud = ball(3000);
            let sign = |i: usize| if i.is_multiple_of(3) { -1.0 } else { 1.0 };
            let given = cloud.positions.iter().enumerate().map(|(i, p)| sign(i) * *p);
            cloud.normals = Some(given.collect());
            let preparation = Preparation { orientation, ..Preparation::default() };
            let cloud = prepare(cloud, &preparation, &NoProgress).unwrap().0;
            let pairs = cloud.normals().iter().zip(cloud.positions());
            assert!(pairs.into_iter().all(|(normal, p)| 0.0 < sense * normal.dot(*p)));
        }
    }

    #[test]
    fn thinned_grids_keep_the_discs_of_a_closed_wall() {
        let wall = scan(60, 60, |row, column| {
            let [azimuth, elevation] = [column, row].map(|index| 0.01 * (index as f32 - 30.0));
            Some(4.0 / (azimuth.cos() * elevation.cos()))
        });
        let radii = |free_space: bool| {
            let subsample = Some(Subsample::Random(3000));
            let preparation = Preparation { free_space, subsample, ..Preparation::default() };
            prepare(wall.clone(), &preparation, &NoProgress).unwrap().0.radii().to_vec()
        };
        assert_eq!(radii(true), radii(false));
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

//! Clouds that are read or prepared and kept, rather than rendered.

use crate::crs::{move_to_metres, report_degrees};
use crate::description::{ObjectSettings, SceneDescription};
use crate::error::{Error, Result};
pub use crate::point_source::PointSource;
use crate::resolve::{
    MemoryEstimate, check_empty, report_crossing_rings, report_denoise, report_normals,
    report_radii, report_unused_of_files, report_unused_structure,
};
use std::path::{Path, PathBuf};
use surfel_core::points::{
    Denoise, Duplicates, MixedPixels, NoisePoints, Orientation, PointCloud, Preparation, STRUCTURE,
    StructureChoice, denoise, prepare, select_points,
};
use surfel_core::progress::Progress;
use surfel_core::words::counted;
use surfel_formats::{ColumnChoice, FileInfo, Loaded, merge_loaded};

/// Columns that a prepared cloud gets besides those that follow from the settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrepareOptions {
    /// Adds normals. Without this, and without settings that name a step, normals and radii are added.
    pub normals: bool,
    /// Adds the column `surface_variation`.
    pub keep_variation: bool,
}

/// The columns that the result has besides the file's.
struct Columns {
    normals: bool,
    radii: bool,
    variation: bool,
}

impl Columns {
    fn any(&self) -> bool {
        self.normals || self.radii || self.variation
    }
}

/// Reads points as one cloud, by the settings of a description for everything: those that its filters keep, and in metres
/// if it says so.
///
/// # Errors
///
/// Fails without any source, for missing and broken files, for a filter of a column that is not there or that keeps no
/// point, past the memory limit, and if cancelled.
pub fn read_points(
    sources: Vec<PointSource>,
    description: &SceneDescription,
    progress: &dyn Progress,
) -> Result<Loaded> {
    read(sources, description, false, progress)
}

/// Reads points as one cloud and prepares it by the settings of a description for everything.
///
/// # Errors
///
/// Fails as [`read_points`] does, and for clouds that cannot be prepared.
pub fn prepare_points(
    sources: Vec<PointSource>,
    description: &SceneDescription,
    options: PrepareOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let settings = &description.objects_default;
    let files = names(&sources);
    let has_estimates = columns(options, settings).any();
    let Loaded { mut cloud, info } = read(sources, description, has_estimates, progress)?;
    settings.preparation.drop_estimated(&mut cloud);
    let cloud = prepared(cloud, description, options, progress)
        .map_err(|cause| Error::Content { files, cause })?;
    Ok(Loaded { cloud, info })
}

fn names(sources: &[PointSource]) -> Vec<PathBuf> {
    sources.iter().enumerate().map(|(i, source)| source.name(i)).collect()
}

/// Reads points that are estimated from afterwards, if `has_estimates` says so.
fn read(
    sources: Vec<PointSource>,
    description: &SceneDescription,
    has_estimates: bool,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let settings = &description.objects_default.preparation;
    let check_points = |points: MemoryEstimate| {
        let all = if has_estimates { points.with_estimates() } else { points };
        all.check(description.run.memory_limit)
    };
    let names = names(&sources);
    let inspected = names.iter().zip(&sources);
    let inspected = inspected.map(|(name, source)| Ok((name.as_path(), source.inspect()?)));
    let infos = inspected.collect::<surfel_formats::Result<Vec<(&Path, FileInfo)>>>()?;
    let infos = || infos.iter().map(|(name, info)| (*name, info));
    // How many points a filter keeps, and a text has, is known when they are read.
    if !settings.filters_points() {
        check_points(MemoryEstimate::from_files(infos(), settings.subsample, 0))?;
    }
    report_unused_of_files(infos().map(|(_, info)| info), settings, progress);
    report_crossing_rings([settings], progress);
    let options = settings.load_options(ColumnChoice::All)?;
    let mut parts: Vec<Loaded> = Vec::new();
    for source in sources {
        let mut part = source.read(&options, settings, progress)?;
        if settings.reproject == Some(true) {
            // To the coordinate system of those before.
            let others = parts.iter().find_map(|part| part.info.coordinate_system.as_deref());
            move_to_metres(&mut part.cloud, &mut part.info, others, progress)?;
        }
        parts.push(part);
    }
    if parts.is_empty() {
        return Err(surfel_formats::Error::NoInput.into());
    }
    let loaded = merge_loaded(parts, &names, progress);
    progress.end();
    if loaded.cloud.is_empty() {
        check_empty(&names, settings)?;
    }
    check_points(MemoryEstimate::of_points(loaded.cloud.len() as u64, settings.subsample))?;
    let points = counted(loaded.cloud.len(), "point");
    progress.note(&format!("{points}, {}", loaded.info.format));
    if settings.reproject.is_none() {
        report_degrees(&loaded.cloud, &loaded.info, &["reproject"], progress);
    }
    Ok(loaded)
}

fn prepared(
    cloud: PointCloud,
    description: &SceneDescription,
    options: PrepareOptions,
    progress: &dyn Progress,
) -> surfel_core::Result<PointCloud> {
    let (settings, seed) = (&description.objects_default, description.picture.seed());
    let columns = columns(options, settings);
    // A file keeps its points, and where they are, unless asked.
    let mut preparation = Preparation {
        denoise: settings.preparation.denoise.unwrap_or(Denoise::Off),
        duplicates: settings.preparation.duplicates.unwrap_or(Duplicates::Keep),
        noise_points: settings.preparation.noise_points.unwrap_or(NoisePoints::Keep),
        mixed_pixels: settings.preparation.mixed_pixels.unwrap_or(MixedPixels::Keep),
        ..settings.preparation(seed)
    };
    if !columns.any() {
        return without_estimates(cloud, &preparation, progress);
    }
    preparation.keep_variation = columns.variation;
    preparation.estimates_normals = columns.normals;
    if columns.normals && settings.preparation.orient.is_none() {
        preparation.orientation = Orientation::Auto;
    }
    let (had_normals, had_radii) = (cloud.normals.is_some(), cloud.radii.is_some());
    let (has_normals, has_radii) = (columns.normals || had_normals, columns.radii || had_radii);
    if !preparation.finds_structures(&cloud) {
        report_unused_structure(&settings.preparation, progress);
    }
    // Normals hold the directions of lines.
    if !has_normals {
        preparation.structure = StructureChoice::Surface;
    }
    let (cloud, prepared) = prepare(cloud, &preparation, progress)?;
    let mut cloud = cloud.into_inner();
    progress.end();
    if !has_normals {
        cloud.normals = None;
    }
    if !has_radii {
        cloud.radii = None;
        cloud.scalars.retain(|scalar| !scalar.name.eq_ignore_ascii_case(STRUCTURE));
    }
    report_denoise(&prepared, progress);
    if columns.normals {
        report_normals(&prepared, progress);
    }
    if columns.radii {
        report_radii(&prepared, settings, progress);
    }
    Ok(cloud)
}

/// Takes the steps that drop or move points.
fn without_estimates(
    cloud: PointCloud,
    preparation: &Preparation,
    progress: &dyn Progress,
) -> surfel_core::Result<PointCloud> {
    let (mut cloud, _) = select_points(cloud, preparation, progress)?;
    if let Some(moved) = denoise(&mut cloud, preparation.denoise, progress)? {
        progress.choice(&moved.report.line(), &["denoise"]);
    }
    Ok(cloud)
}

/// Returns the columns that were asked for; normals and radii if nothing was. Structures need both.
fn columns(options: PrepareOptions, settings: &ObjectSettings) -> Columns {
    let preparation = &settings.preparation;
    let has_structures = preparation.structure.is_some();
    let columns = Columns {
        normals: options.normals
            || has_structures
            || preparation.overrides_normals()
            || preparation.orient.is_some_and(|orient| orient != Orientation::None),
        radii: has_structures || preparation.radius.is_some(),
        variation: options.keep_variation,
    };
    let has_other_steps = preparation.subsample.is_some()
        || preparation.filters_points()
        || preparation.duplicates.is_some()
        || preparation.noise_points.is_some()
        || preparation.mixed_pixels.is_some()
        || preparation.reproject.is_some()
        || preparation.remove_outliers.is_some()
        || preparation.denoise.is_some();
    if !columns.any() && !has_other_steps {
        return Columns { normals: true, radii: true, variation: false };
    }
    columns
}

#[cfg(test)]
mod tests {
    //! Steps that are named are taken, and no others.

    use super::*;
    use crate::crs::{CoordinateSystem, Unit};
    use crate::description::PreparationSettings;
    use crate::progress_log::{ProgressLog, Records};
    use std::sync::Arc;
    use surfel_core::math::{DVec3, Vec3};
    use surfel_core::points::{
        COLUMN_INDEX, ROW_INDEX, Radius, Scalar, ScanStation, Subsample, Values,
    };
    use surfel_core::progress::NoProgress;
    use surfel_formats::SaveOptions;

    /// A cloud without information about a file.
    fn in_memory(cloud: PointCloud) -> PointSource {
        PointSource::Cloud(Arc::new(cloud), Box::default())
    }

    /// Prepares a cloud, and returns what was reported.
    fn prepare_with(
        cloud: PointCloud,
        change: impl FnOnce(&mut PreparationSettings),
    ) -> (Loaded, Records) {
        let mut description = SceneDescription::default();
        change(&mut description.objects_default.preparation);
        let log = ProgressLog::new(&NoProgress);
        let sources = vec![in_memory(cloud)];
        let prepared = prepare_points(sources, &description, PrepareOptions::default(), &log);
        (prepared.unwrap(), log.into_records())
    }

    /// Returns a scan around Munich in degrees.
    fn degrees() -> PointCloud {
        let position = |i: i32| Vec3::new(1e-4 * (i % 30) as f32, 1e-4 * (i / 30) as f32, i as f32);
        let mut cloud = PointCloud::from_positions((0..900).map(position).collect());
        cloud.origin = DVec3::new(11.57, 48.13, 520.0);
        cloud
    }

    #[test]
    fn degrees_are_moved_if_asked_and_reported_otherwise() {
        let prepared = |reproject: Option<bool>| {
            let (loaded, Records { choices, warnings, .. }) = prepare_with(degrees(), |settings| {
                settings.reproject = reproject;
                settings.duplicates = Some(Duplicates::Keep);
            });
            let choices = choices.iter().map(ToString::to_string);
            let lines = choices.chain(warnings.iter().map(|warning| format!("warning: {warning}")));
            (loaded, lines.filter(|line| line.ends_with("[reproject]")).collect::<String>())
        };
        let (moved, line) = prepared(Some(true));
        assert!(5e6 < moved.cloud.origin.y && line.ends_with("EPSG:32632 [reproject]"), "{line}");
        assert_eq!(moved.info.coordinate_system.as_deref(), Some("EPSG:32632"));
        let (kept, line) = prepared(None);
        assert_eq!(kept.cloud.origin.y, 48.13);
        assert!(line.starts_with("warning: x and y look like degrees"), "{line}");
        let (kept, line) = prepared(Some(false));
        assert_eq!((kept.cloud.origin.y, line.as_str()), (48.13, ""));
    }

    #[test]
    fn a_moved_las_file_states_the_system_of_its_metres() {
        let folder = std::env::temp_dir().join(format!("surfel-metres-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let [source, target] = ["degrees.las", "metres.las"].map(|name| folder.join(name));
        let options =
            SaveOptions { coordinate_system: Some("EPSG:4326".into()), ..SaveOptions::default() };
        surfel_formats::save(&source, &degrees(), &options, &NoProgress).unwrap();
        let mut description = SceneDescription::default();
        description.objects_default.preparation.reproject = Some(true);
        description.objects_default.preparation.duplicates = Some(Duplicates::Keep);
        let options = PrepareOptions::default();
        let Loaded { cloud, info } =
            prepare_points(vec![PointSource::File(source)], &description, options, &NoProgress)
                .unwrap();
        let options = SaveOptions::from_source(&info);
        surfel_formats::save(&target, &cloud, &options, &NoProgress).unwrap();
        let system = surfel_formats::inspect(&target).unwrap().coordinate_system.unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        let unit = CoordinateSystem::parse(&system).unwrap().unit();
        assert!(matches!(unit, Unit::Metres(_)), "{system}");
    }

    #[test]
    fn files_and_clouds_are_moved_to_metres_before_they_become_one() {
        let mut metres = degrees();
        let system =
            FileInfo { coordinate_system: Some("EPSG:32632".into()), ..FileInfo::default() };
        move_to_metres(&mut metres, &mut FileInfo::default(), Some("EPSG:32632"), &NoProgress)
            .unwrap();
        let mut description = SceneDescription::default();
        description.objects_default.preparation.reproject = Some(true);
        let sources =
            vec![PointSource::Cloud(Arc::new(metres), Box::new(system)), in_memory(degrees())];
        let Loaded { cloud, info } = read_points(sources, &description, &NoProgress).unwrap();
        assert_eq!(info.coordinate_system.as_deref(), Some("EPSG:32632"));
        let distance = |i: usize| cloud.world_position(i).distance(cloud.world_position(900 + i));
        assert!((0..900).all(|i| distance(i) < 0.01));
    }

    #[test]
    fn clouds_in_memory_count_against_the_memory_limit() {
        let mut description = SceneDescription::default();
        description.run.memory_limit = Some(1 << 16);
        let prepared = |description: &SceneDescription| {
            let sources = vec![in_memory(two_walls()), in_memory(degrees())];
            prepare_points(sources, description, PrepareOptions::default(), &NoProgress)
        };
        let error = prepared(&description).unwrap_err();
        assert!(matches!(error, Error::OutOfMemory(_)), "{error}");
        description.objects_default.preparation.filter = Some("x > 11.57".parse().unwrap());
        let error = prepared(&description).unwrap_err();
        assert!(matches!(error, Error::OutOfMemory(_)), "{error}");
        description.run.memory_limit = Some(1 << 24);
        assert!(prepared(&description).is_ok());
    }

    /// Returns a scan of a wall at 5 m before one at 9 m, with a column of ten points in the air between them.
    fn two_walls() -> PointCloud {
        let cells = || (0..10).flat_map(|row| (0..20).map(move |column| [row, column]));
        let position = |[row, column]: [i32; 2]| {
            let range: f32 = match column {
                0..10 => 5.0,
                10 => 7.0,
                _ => 9.0,
            };
            let [azimuth, elevation] = [column - 10, row - 5].map(|index| 0.01 * index as f32);
            let level = elevation.cos();
            range * Vec3::new(level * azimuth.cos(), level * azimuth.sin(), elevation.sin())
        };
        let index = |name: &str, axis: usize| Scalar {
            name: name.into(),
            values: Values::I32(cells().map(|cell| cell[axis]).collect()),
        };
        PointCloud {
            scalars: vec![index(ROW_INDEX, 0), index(COLUMN_INDEX, 1)],
            stations: vec![ScanStation { position: Some(DVec3::ZERO), ..ScanStation::default() }],
            ..PointCloud::from_positions(cells().map(position).collect())
        }
    }

    #[test]
    fn filters_that_keep_nothing_are_one_error_wherever_the_points_come_from() {
        let file = std::env::temp_dir().join(format!("surfel-none-{}.ply", std::process::id()));
        surfel_formats::save(&file, &two_walls(), &SaveOptions::default(), &NoProgress).unwrap();
        let mut description = SceneDescription::default();
        let filter = &mut description.objects_default.preparation.filter;
        *filter = Some("x > 50".parse().unwrap());
        let prepared = |source: PointSource| {
            prepare_points(vec![source], &description, PrepareOptions::default(), &NoProgress)
        };
        let of_points = prepared(in_memory(two_walls()));
        let of_file = prepared(PointSource::File(file.clone()));
        description.files.push(file.clone());
        let of_scene = crate::resolve(&description, &NoProgress);
        std::fs::remove_file(&file).unwrap();
        let errors = [of_points.unwrap_err(), of_file.unwrap_err(), of_scene.unwrap_err()];
        for error in &errors {
            let Error::NoPointKept { files, key, filter, .. } = error else { panic!("{error}") };
            assert_eq!((files.len(), *key, &filter[..]), (1, Some("filter"), "x > 50"));
        }
    }

    #[test]
    fn structures_are_kept_only_with_their_normals_and_radii() {
        let wire = || {
            let point = |i: i32| Vec3::new(0.02 * i as f32, 0.0, 3.0);
            PointCloud::from_positions((0..600).map(point).collect())
        };
        let description = SceneDescription::default();
        let options = PrepareOptions { normals: true, ..PrepareOptions::default() };
        let sources = vec![in_memory(wire())];
        let cloud = prepare_points(sources, &description, options, &NoProgress).unwrap().cloud;
        assert!(cloud.normals.is_some() && cloud.radii.is_none() && cloud.structures().is_none());
        let radius = Some(Radius::default());
        let cloud = prepare_with(wire(), |settings| settings.radius = radius).0.cloud;
        assert!(cloud.normals.is_none() && cloud.radii.is_some() && cloud.structures().is_none());
        let cloud = prepare_with(wire(), |_| ()).0.cloud;
        assert!(cloud.normals.is_some() && cloud.radii.is_some() && cloud.structures().is_some());
    }

    #[test]
    fn mixed_pixels_are_dropped_if_asked() {
        let prepared = |mixed_pixels, subsample| {
            let (loaded, Records { choices, .. }) = prepare_with(two_walls(), |settings| {
                settings.mixed_pixels = mixed_pixels;
                settings.subsample = subsample;
            });
            assert!(loaded.cloud.normals.is_none() && loaded.cloud.radii.is_none());
            let is_reported = choices.iter().any(|choice| choice.keys == ["mixed_pixels"]);
            (loaded.cloud.len(), is_reported)
        };
        let all = Some(Subsample::First(1000));
        assert_eq!(prepared(Some(MixedPixels::Drop), None), (190, true));
        assert_eq!(prepared(Some(MixedPixels::Drop), all), (190, true));
        assert_eq!(prepared(Some(MixedPixels::Keep), None), (200, false));
        assert_eq!(prepared(None, all), (200, false));
        // Nor are they beside normals and radii.
        assert_eq!(prepare_with(two_walls(), |_| ()).0.cloud.len(), 200);
    }

    #[test]
    fn points_of_noise_are_kept_unless_asked() {
        let prepared = |noise_points| {
            let mut cloud = two_walls();
            cloud.classification = Some((0..200).map(|i| if i < 9 { 7 } else { 2 }).collect());
            let (loaded, Records { choices, .. }) = prepare_with(cloud, |settings| {
                settings.duplicates = Some(Duplicates::Keep);
                settings.noise_points = noise_points;
            });
            let is_reported = choices.iter().any(|choice| choice.keys == ["noise_points"]);
            (loaded.cloud.len(), is_reported)
        };
        assert_eq!(prepared(None), (200, true));
        assert_eq!(prepared(Some(NoisePoints::Keep)), (200, true));
        assert_eq!(prepared(Some(NoisePoints::Drop)), (191, false));
    }

    #[test]
    fn structures_that_are_asked_for_bring_normals_and_radii() {
        let cloud = prepare_with(two_walls(), |settings| {
            settings.structure = Some(StructureChoice::Scatter);
            settings.subsample = Some(Subsample::First(150));
        });
        let cloud = cloud.0.cloud;
        assert!(cloud.normals.is_some() && cloud.radii.is_some() && cloud.structures().is_some());
    }
}

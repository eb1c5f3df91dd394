//! Clouds that are prepared and kept, rather than rendered.

use crate::description::{ObjectSettings, SceneDescription};
use crate::error::{Error, Result};
use crate::resolve::{
    MemoryEstimate, check_empty, keep_matching, report_denoise, report_normals, report_radii,
};
use std::path::PathBuf;
use surfel_core::points::{
    Denoise, Duplicates, Orientation, PointCloud, Preparation, clean, denoise, prepare,
    remove_outliers, subsample,
};
use surfel_core::progress::Progress;
use surfel_formats::{ColumnChoice, Loaded};

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

/// Reads files as one cloud and prepares it by the settings of a description for everything.
///
/// # Errors
///
/// Fails for missing and broken files, past the memory limit, for filters that keep no point, for clouds that cannot be
/// prepared, and if cancelled.
pub fn prepare_files(
    files: &[PathBuf],
    description: &SceneDescription,
    options: PrepareOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let Loaded { cloud, info } = load(files, description, progress)?;
    let cloud = prepared(cloud, description, options, progress).map_err(|cause| {
        let settings = &description.objects_default.preparation;
        let is_empty = cause == surfel_core::Error::EmptyCloud;
        let filter = is_empty.then(|| check_empty(files, settings)).and_then(Result::err);
        filter.unwrap_or_else(|| Error::Content { files: files.to_vec(), cause })
    })?;
    if cloud.is_empty() {
        check_empty(files, &description.objects_default.preparation)?;
    }
    Ok(Loaded { cloud, info })
}

/// Prepares a cloud by the settings of a description for everything.
///
/// # Errors
///
/// Fails for a filter of a column that is not there or that keeps no point, for clouds that cannot be prepared, and if
/// cancelled.
pub fn prepare_points(
    mut cloud: PointCloud,
    description: &SceneDescription,
    options: PrepareOptions,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let settings = &description.objects_default.preparation;
    for (key, filter) in settings.point_filters()? {
        keep_matching(&mut cloud, key, &filter, progress)?;
        if cloud.is_empty() {
            return Err(Error::Unfit(format!("no point meets {filter}")));
        }
    }
    settings.drop_estimated(&mut cloud);
    Ok(prepared(cloud, description, options, progress)?)
}

fn load(
    files: &[PathBuf],
    description: &SceneDescription,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let inspected = files.iter().map(|file| Ok((file.as_path(), surfel_formats::inspect(file)?)));
    let infos = inspected.collect::<surfel_formats::Result<_>>()?;
    let preparation = &description.objects_default.preparation;
    let estimate = MemoryEstimate::from_files(&infos, preparation.subsample, 0);
    estimate.check(description.run.memory_limit)?;
    let options = preparation.load_options(ColumnChoice::All)?;
    let (mut loaded, _) = surfel_formats::load_all(files, &options, progress)?;
    progress.end();
    progress.note(&format!("{} points, {}", loaded.cloud.len(), loaded.info.format));
    preparation.drop_estimated(&mut loaded.cloud);
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
    let mode = settings.preparation.denoise.unwrap_or(Denoise::Off);
    let duplicates = settings.preparation.duplicates.unwrap_or(Duplicates::Keep);
    if !columns.normals && !columns.radii && !columns.variation {
        let (cloud, _) = clean(cloud, duplicates, progress)?;
        let mut cloud = match settings.preparation.subsample {
            Some(choice) => subsample(&cloud, choice, seed, progress)?,
            None => cloud,
        };
        if let Some(choice) = settings.preparation.remove_outliers {
            cloud = remove_outliers(&cloud, choice, progress)?;
        }
        if let Some(moved) = denoise(&mut cloud, mode, progress)? {
            progress.choice(&moved.report.line(), &["denoise"]);
        }
        return Ok(cloud);
    }
    let mut preparation = Preparation { denoise: mode, duplicates, ..settings.preparation(seed) };
    preparation.keep_variation = columns.variation;
    preparation.estimates_normals = columns.normals;
    if columns.normals && settings.preparation.orient.is_none() {
        preparation.orientation = Orientation::Auto;
    }
    let (had_normals, had_radii) = (cloud.normals.is_some(), cloud.radii.is_some());
    let (cloud, prepared) = prepare(cloud, &preparation, progress)?;
    let mut cloud = cloud.into_inner();
    progress.end();
    if !columns.normals && !had_normals {
        cloud.normals = None;
    }
    if !columns.radii && !had_radii {
        cloud.radii = None;
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

/// Returns the columns that were asked for; normals and radii if nothing was.
fn columns(options: PrepareOptions, settings: &ObjectSettings) -> Columns {
    let preparation = &settings.preparation;
    let columns = Columns {
        normals: options.normals
            || preparation.estimates_normals()
            || preparation.orient.is_some_and(|orient| orient != Orientation::None),
        radii: preparation.radius.is_some(),
        variation: options.keep_variation,
    };
    let is_empty = !columns.normals && !columns.radii && !columns.variation;
    let has_other_steps = preparation.subsample.is_some()
        || preparation.filters_points()
        || preparation.duplicates.is_some()
        || preparation.remove_outliers.is_some()
        || preparation.denoise.is_some();
    if is_empty && !has_other_steps {
        return Columns { normals: true, radii: true, variation: false };
    }
    columns
}

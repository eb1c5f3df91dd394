//! `surfel prepare`: clean, subsample, outliers, noise, normals, orientation, radius, each alone or all.

use crate::global::Global;
use crate::inputs::expand;
use crate::options::{KeyOptions, Scope};
use crate::output::check_cloud;
use crate::report::Report;
use anyhow::Context;
use std::path::PathBuf;
use surfel::description::ObjectSettings;
use surfel::resolve::{MemoryEstimate, report_denoise, report_normals, report_radii};
use surfel_core::points::{
    Denoise, Duplicates, Orientation, PointCloud, Preparation, clean, denoise, prepare,
    remove_outliers, subsample,
};
use surfel_core::progress::Progress;
use surfel_formats::{ColumnChoice, Loaded, SaveOptions};

/// Arguments of `surfel prepare`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Point clouds, or meshes and glTF scenes, whose vertices are taken; several become one. A folder stands
    /// for its files, `*` for any part of a name, - for standard input.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    #[arg(short, long, value_name = "FILE", help = output_help())]
    output: PathBuf,
    /// Adds normals. Without this, --radius, --orient, --filter, --class, --returns, --crop, --duplicates, --subsample,
    /// --remove-outliers, --denoise and --keep-variation: normals and radii.
    #[arg(long, help_heading = "Preparation")]
    normals: bool,
    /// Adds the column surface_variation: 0 on a plane, up to 1/3 where points fill space.
    #[arg(long, help_heading = "Preparation")]
    keep_variation: bool,
    #[command(flatten)]
    options: KeyOptions<Args>,
}

impl Scope for Args {
    fn has(heading: &str, path: &str) -> bool {
        let is_of_points = heading == "Preparation";
        path == "seed" || (is_of_points && !["vertices", "animation_name"].contains(&path))
    }
}

fn output_help() -> String {
    let extensions = surfel_formats::writable_extensions("or");
    format!(
        "The prepared cloud: {extensions}; PTS holds intensity and colour only, all others every column"
    )
}

const EXAMPLES: &str = "\
Examples:
  surfel prepare scan.laz -o ready.ply                                normals and radii
  surfel prepare scan.laz -o thin.laz --subsample spacing:0.1         fewer points, nothing else
  surfel prepare scan.laz -o ground.laz --class ground                points of a class
  surfel prepare scan.laz -o kept.laz --remove-outliers statistical   without points that stand alone
  surfel prepare scan.laz -o once.laz --duplicates drop               one point at each position
  surfel prepare scan.laz -o scan.xyz --duplicates keep               as text, with no other change
  surfel prepare scan.laz -o calm.laz --denoise on                    points moved onto their surface
  surfel prepare scan.laz -o ready.ply --normals-k 24 --orient mst
  surfel prepare east.laz west.laz -o both.ply --radius median:6";

/// The columns that the result has besides the file's.
struct Columns {
    normals: bool,
    radii: bool,
    variation: bool,
}

/// Prepares a cloud and writes it.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let limit = global.start()?.memory_limit;
    let description = args.options.description.clone()?;
    let settings = &description.objects_default;
    check_cloud(&args.output)?;
    let files = expand(&args.files)?;
    let Loaded { cloud, info } = load(&files, settings, limit, report)?;
    let columns = columns(args, settings);
    let cloud = prepared(cloud, &columns, settings, description.picture.seed(), report)
        .with_context(|| files[0].display().to_string())?;
    let options = SaveOptions::from_source(&info);
    surfel_formats::save(&args.output, &cloud, &options, report)?;
    report.end();
    report.note(&format!("{}: {} points", args.output.display(), cloud.len()));
    Ok(())
}

fn load(
    files: &[PathBuf],
    settings: &ObjectSettings,
    limit: Option<u64>,
    report: &Report,
) -> anyhow::Result<Loaded> {
    let inspected = files.iter().map(|file| Ok((file.as_path(), surfel_formats::inspect(file)?)));
    let infos = inspected.collect::<surfel_formats::Result<_>>()?;
    let preparation = &settings.preparation;
    MemoryEstimate::from_files(&infos, preparation.subsample, 0).check(limit)?;
    let options = preparation.load_options(ColumnChoice::All)?;
    let (mut loaded, _) = surfel_formats::load_all(files, &options, report)?;
    report.end();
    report.note(&format!("{} points, {}", loaded.cloud.len(), loaded.info.format));
    preparation.drop_estimated(&mut loaded.cloud);
    Ok(loaded)
}

fn prepared(
    cloud: PointCloud,
    columns: &Columns,
    settings: &ObjectSettings,
    seed: u64,
    report: &Report,
) -> anyhow::Result<PointCloud> {
    // A file keeps its points, and where they are, unless asked.
    let mode = settings.preparation.denoise.unwrap_or(Denoise::Off);
    let duplicates = settings.preparation.duplicates.unwrap_or(Duplicates::Keep);
    if !columns.normals && !columns.radii && !columns.variation {
        let (cloud, _) = clean(cloud, duplicates, report)?;
        let mut cloud = match settings.preparation.subsample {
            Some(choice) => subsample(&cloud, choice, seed, report)?,
            None => cloud,
        };
        if let Some(choice) = settings.preparation.remove_outliers {
            cloud = remove_outliers(&cloud, choice, report)?;
        }
        if let Some(moved) = denoise(&mut cloud, mode, report)? {
            report.choice(&moved.report.line(), &["denoise"]);
        }
        return Ok(cloud);
    }
    let mut preparation = Preparation { denoise: mode, duplicates, ..settings.preparation(seed) };
    preparation.keep_variation = columns.variation;
    if columns.normals && settings.preparation.orient.is_none() {
        preparation.orientation = Orientation::Auto;
    }
    let (had_normals, had_radii) = (cloud.normals.is_some(), cloud.radii.is_some());
    let (cloud, prepared) = prepare(cloud, &preparation, report)?;
    let mut cloud = cloud.into_inner();
    report.end();
    if !columns.normals && !had_normals {
        cloud.normals = None;
    }
    if !columns.radii && !had_radii {
        cloud.radii = None;
    }
    report_denoise(&prepared, report);
    if columns.normals {
        report_normals(&prepared, report);
    }
    if columns.radii {
        report_radii(&prepared, settings, report);
    }
    Ok(cloud)
}

/// The columns that were asked for; normals and radii if nothing was.
fn columns(args: &Args, settings: &ObjectSettings) -> Columns {
    let preparation = &settings.preparation;
    let columns = Columns {
        normals: args.normals
            || preparation.estimates_normals()
            || preparation.orient.is_some_and(|orient| orient != Orientation::None),
        radii: preparation.radius.is_some(),
        variation: args.keep_variation,
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

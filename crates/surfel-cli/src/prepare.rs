//! `surfel prepare`: clean, subsample, outliers, noise, normals, orientation, radius, each alone or all.

use crate::global::Global;
use crate::inputs::expand_content;
use crate::options::{KeyOptions, Scope};
use crate::output::{check_cloud, check_replaces_nothing};
use crate::report::Report;
use std::path::PathBuf;
use surfel::SceneDescription;
use surfel::description::Section;
use surfel::prepare::{PointSource, PrepareOptions, prepare_points};
use surfel_core::progress::Progress;
use surfel_core::words::counted;
use surfel_formats::{Loaded, SaveOptions};

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
    /// Adds normals. Normals and radii are both added if you choose no step: none of --normals, --normals-k,
    /// --normals-radius, --radius, --structure, --orient, --filter, --class, --returns, --crop, --duplicates, --noise-points,
    /// --subsample, --mixed-pixels, --reproject, --remove-outliers, --denoise, --keep-variation.
    #[arg(long, help_heading = Section::Preparation.heading())]
    normals: bool,
    /// Adds the column surface_variation: 0 on a plane, up to 1/3 where points fill space.
    #[arg(long, help_heading = Section::Preparation.heading())]
    keep_variation: bool,
    #[command(flatten)]
    options: KeyOptions<Args>,
}

impl Scope for Args {
    fn has(section: Section, path: &str) -> bool {
        let is_of_points = section == Section::Preparation;
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
  surfel prepare scan.laz -o scan.xyz --duplicates keep               as text, with all points
  surfel prepare scan.laz -o calm.laz --denoise on                    points moved onto their surface
  surfel prepare scan.laz -o ready.ply --normals-k 24 --orient mst
  surfel prepare east.laz west.laz -o both.ply --radius median:6";

/// Prepares a cloud and writes it.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let run = global.start()?;
    let description = SceneDescription { run, ..args.options.description.clone()? };
    check_cloud(&args.output)?;
    let files = expand_content(&args.files, report)?;
    // What a preparation drops would be lost.
    check_replaces_nothing(&[("-o", &args.output)], files.iter().chain(description.named_files()))?;
    let options = PrepareOptions { normals: args.normals, keep_variation: args.keep_variation };
    let sources = files.into_iter().map(PointSource::File).collect();
    let Loaded { cloud, info } = prepare_points(sources, &description, options, report)?;
    let options = SaveOptions::from_source(&info);
    surfel_formats::save(&args.output, &cloud, &options, report)?;
    report.end();
    let points = counted(cloud.len(), "point");
    report.note(&format!("{}: {points}", args.output.display()));
    Ok(())
}

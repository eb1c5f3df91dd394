//! `surfel prepare`: select, clean, normals, orientation, radius, each alone or all.

use crate::args::{Global, PreparationArgs, Usage};
use crate::memory::Plan;
use crate::picture::check_output;
use crate::report::Report;
use anyhow::Context;
use std::path::PathBuf;
use surfel::points::{Orientation, PointCloud, clean, prepare, select};
use surfel::progress::Progress;
use surfel_formats::{ColumnChoice, Loaded, SaveOptions};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Point clouds, or meshes and glTF scenes, of which the vertices are taken; several make one.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// The prepared cloud: .ply (all columns), .las or .laz.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    preparation: PreparationArgs,
    /// Add normals; without this, --radius, --orient, --select or --keep-variation: normals and radii.
    #[arg(long, help_heading = "Preparation")]
    normals: bool,
    /// Add the column surface_variation: 0 on a plane, up to 1/3 where points fill space.
    #[arg(long, help_heading = "Preparation")]
    keep_variation: bool,
    /// Another number selects others with --select random.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Preparation")]
    seed: u64,
}

const EXAMPLES: &str = "\
Examples:
  surfel prepare scan.laz -o ready.ply                      normals and radii
  surfel prepare scan.laz -o thin.laz --select spacing:0.1  fewer points, nothing else
  surfel prepare scan.laz -o ready.ply --normals-k 24 --orient mst
  surfel prepare east.laz west.laz -o both.ply --radius median:6";

/// Which columns the result is to have beside the file's.
struct Wanted {
    normals: bool,
    radii: bool,
    variation: bool,
}

pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    check_output(&args.output)?;
    let extension = args.output.extension().unwrap_or_default().to_ascii_lowercase();
    if !["ply", "las", "laz"].iter().any(|known| extension == *known) {
        let text = format!("{}: clouds are written as .ply, .las or .laz", args.output.display());
        return Err(Usage(text).into());
    }
    let Loaded { cloud, source } = load(args, global, report)?;
    let cloud =
        prepared(cloud, args, report).with_context(|| args.files[0].display().to_string())?;
    let options =
        SaveOptions { resolution: source.resolution, coordinate_system: source.coordinate_system };
    surfel_formats::save(&args.output, &cloud, &options, report)?;
    report.end_stage();
    report.note(&format!("{}: {} points", args.output.display(), cloud.len()));
    Ok(())
}

fn load(args: &Args, global: &Global, report: &Report) -> anyhow::Result<Loaded> {
    let inspected =
        args.files.iter().map(|file| Ok((file.as_path(), surfel_formats::inspect(file)?)));
    let sources = inspected.collect::<surfel_formats::Result<_>>()?;
    Plan::new(&sources, args.preparation.select, 0).check(global)?;
    let options = args.preparation.load_options(ColumnChoice::All);
    let (mut loaded, _) = surfel_formats::load_all(&args.files, &options, report)?;
    report.end_stage();
    report.note(&format!("{} points, {}", loaded.cloud.len(), loaded.source.format));
    args.preparation.forget(&mut loaded.cloud);
    Ok(loaded)
}

fn prepared(cloud: PointCloud, args: &Args, report: &Report) -> anyhow::Result<PointCloud> {
    let wanted = wanted(args);
    if !wanted.normals && !wanted.radii && !wanted.variation {
        let (cloud, _) = clean(cloud, report)?;
        return Ok(match args.preparation.select {
            Some(choice) => select(&cloud, choice, args.seed, report)?,
            None => cloud,
        });
    }
    let mut preparation = args.preparation.preparation(args.seed, None);
    preparation.keep_variation = wanted.variation;
    let had = (cloud.normals.is_some(), cloud.radii.is_some());
    let (mut cloud, found) = prepare(cloud, &preparation, report)?;
    report.end_stage();
    if !wanted.normals && !had.0 {
        cloud.normals = None;
    }
    if !wanted.radii && !had.1 {
        cloud.radii = None;
    }
    if wanted.normals {
        args.preparation.tell_normals(&found, report);
    }
    if wanted.radii {
        args.preparation.tell_radii(&found, report);
    }
    Ok(cloud)
}

/// What was asked for; normals and radii if nothing was.
fn wanted(args: &Args) -> Wanted {
    let preparation = &args.preparation;
    let wanted = Wanted {
        normals: args.normals
            || preparation.names_normals()
            || preparation.orient != Orientation::None,
        radii: preparation.radius.is_some(),
        variation: args.keep_variation,
    };
    let nothing = !wanted.normals && !wanted.radii && !wanted.variation;
    if nothing && preparation.select.is_none() {
        return Wanted { normals: true, radii: true, variation: false };
    }
    wanted
}

//! `surfel render`: options, and the resolved choices as JSON.

use crate::args::{
    CameraArgs, ColorArgs, Global, LightArgs, PictureArgs, PreparationArgs, SurfaceArgs, Usage,
};
use crate::picture;
use crate::report::Report;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Point clouds: .ply, .las, .laz, .copc.laz, .xyz, .txt, .csv, .asc, .pts, .obj, .stl, .bin; several make one.
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// The picture: .png, .exr (linear, with all layers) or - for PNG on stdout.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write numbers about the run as JSON; - for stdout.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub stats: Option<PathBuf>,
    /// Print what would be done as JSON on stdout, and render nothing.
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub surface: SurfaceArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub light: LightArgs,
    #[command(flatten)]
    pub color: ColorArgs,
    #[command(flatten)]
    pub preparation: PreparationArgs,
}

const EXAMPLES: &str = "\
Examples:
  surfel render scan.laz -o scan.png
  surfel render scan.laz -o close.png --camera-azimuth-angle 60 --camera-zoom-factor 1.5
  surfel render scan.laz -o map.png --camera-direction 0,0,-1 --camera-orthographic
  surfel render scan.laz -o classes.png --color class --light sky
  surfel render north.las south.las -o heights.png --color elevation --cmap terrain
  surfel render statue.ply -o statue.exr --up +Y --spp 64 --no-background
  surfel render huge.laz -o quick.png --select random:2000000 --spp 1 --stats -";

pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    check(args)?;
    picture::make(args, global, report)
}

/// What is wrong whatever the files hold.
fn check(args: &Args) -> Result<(), Usage> {
    args.camera.check()?;
    args.light.check()?;
    let stdout = Path::new("-");
    if args.output == stdout && args.stats.as_deref() == Some(stdout) {
        return Err(Usage(
            "picture and stats cannot both go to stdout; name a file for one".into(),
        ));
    }
    Ok(())
}

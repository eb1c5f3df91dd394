//! `surfel render`: options, and the resolved choices as JSON.

use crate::args::{Global, SceneArgs, Usage};
use crate::picture;
use crate::report::Report;
use crate::scene_file::Line;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The picture: .png, .exr (linear, with all layers) or - for PNG on stdout.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write numbers about the run as JSON; - for stdout.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub stats: Option<PathBuf>,
    /// Print what would be done as a scene file on stdout, and render nothing.
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,
    /// The instant of a scene that moves.
    #[arg(long, value_name = "SECONDS", default_value = "0", help_heading = "Output",
        value_parser = crate::args::parse::number_in::<0, 1_000_000>)]
    pub time: f64,
    #[command(flatten)]
    pub scene: SceneArgs,
}

const EXAMPLES: &str = "\
Examples:
  surfel render scan.laz -o scan.png
  surfel render scan.laz -o close.png --camera-azimuth-angle 60 --camera-zoom-factor 1.5
  surfel render scan.laz -o map.png --camera-direction 0,0,-1 --camera-orthographic
  surfel render scan.laz -o classes.png --color class --light sky
  surfel render north.las south.las -o heights.png --color elevation --cmap terrain
  surfel render site.laz house.glb statue.ply -o plan.png --material statue.ply=glass
  surfel render scene.toml -o scene.png
  surfel render statue.ply -o statue.exr --up +Y --spp 64 --no-background
  surfel render huge.laz -o quick.png --select random:2000000 --spp 1 --stats -";

pub fn run(args: &Args, line: &Line, global: &Global, report: &Report) -> anyhow::Result<()> {
    args.scene.check()?;
    if args.dry_run {
        return picture::tell(args, line, global, report);
    }
    let stdout = Path::new("-");
    let Some(output) = &args.output else {
        return Err(Usage("name the picture with -o, as in -o picture.png".into()).into());
    };
    if output == stdout && args.stats.as_deref() == Some(stdout) {
        let text = "picture and stats cannot both go to stdout; name a file for one";
        return Err(Usage(text.into()).into());
    }
    picture::make(args, output, line, global, report)
}

//! Groups of options that commands share, and their translation into the library's structs.

mod camera;
mod clip;
mod color;
mod light;
pub mod material;
pub mod parse;
mod preparation;
mod scene;

pub use camera::{CAMERA, CameraArgs, is_georeferenced, short};
pub use clip::ClipArgs;
pub use color::ColorArgs;
pub use light::{Exposure, LightArgs, LightKind};
pub use material::{Choice, MaterialArgs};
pub use preparation::PreparationArgs;
pub use scene::SceneArgs;

use crate::report::Verbosity;
use anyhow::Context;
use clap::builder::PossibleValuesParser;
use clap::builder::TypedValueParser;
use clap::{Args, ValueEnum};
use surfel::points::PointCloud;
use surfel::surface::{Boundary, SurfaceKind};

/// Options that don't fit together: exit code 2.
#[derive(Debug)]
pub struct Usage(pub String);

impl std::fmt::Display for Usage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}

#[derive(Args, Clone)]
#[command(next_help_heading = "Everywhere")]
pub struct Global {
    /// Tell nothing but errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Tell how long each stage takes, too.
    #[arg(short, long, global = true)]
    verbose: bool,
    /// Threads to work with; all of the processor's if not given.
    #[arg(short, long, global = true, value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
    /// Refuse work that would need more memory than this, as in 8G.
    #[arg(long, global = true, value_name = "SIZE", value_parser = parse::memory)]
    pub memory_limit: Option<u64>,
    /// What does the work.
    #[arg(long, global = true, value_name = "NAME", default_value = "auto")]
    backend: Backend,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Backend {
    Auto,
    Cpu,
    Gpu,
}

impl Global {
    pub fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Verbose,
            _ => Verbosity::Normal,
        }
    }

    pub fn start_threads(&self) -> anyhow::Result<()> {
        if self.backend == Backend::Gpu {
            return Err(Usage("--backend gpu: not in this build; use cpu".into()).into());
        }
        let pool = rayon::ThreadPoolBuilder::new();
        pool.num_threads(self.threads.unwrap_or(0) as usize)
            .build_global()
            .context("the threads cannot be started; ask for fewer with --threads")
    }
}

/// What the points are traced as.
#[derive(Args)]
#[command(next_help_heading = "Surface")]
pub struct SurfaceArgs {
    /// The shape given to the points.
    #[arg(long, value_name = "KIND", default_value = "splat", value_parser = surfaces())]
    pub surface: SurfaceKind,
    /// Whether the surface ends at the outermost points (gap) or at the rims of their discs (off).
    #[arg(long, value_name = "TEST", default_value = "gap", value_parser = boundaries())]
    pub boundary: Boundary,
    /// Makes the radii of all points this many times as large, those of the file and those estimated.
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::positive)]
    radius_scale: f64,
}

impl SurfaceArgs {
    pub fn scale_radii(&self, cloud: &mut PointCloud) {
        let factor = self.radius_scale as f32;
        let of_morphs = cloud.morphs.iter_mut().filter_map(|morph| morph.radii.as_mut());
        let all = cloud.radii.iter_mut().chain(of_morphs).flatten();
        all.for_each(|radius| *radius *= factor);
    }
}

fn surfaces() -> impl TypedValueParser<Value = SurfaceKind> {
    PossibleValuesParser::new(SurfaceKind::ALL.map(|(name, _)| name))
        .try_map(|name| name.parse::<SurfaceKind>())
}

fn boundaries() -> impl TypedValueParser<Value = Boundary> {
    PossibleValuesParser::new(["gap", "off"]).try_map(|name| name.parse::<Boundary>())
}

/// Size and quality of the picture.
#[derive(Args)]
#[command(next_help_heading = "Picture")]
pub struct PictureArgs {
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = parse::resolution)]
    pub resolution: (u32, u32),
    /// Camera rays a pixel.
    #[arg(long, value_name = "N", default_value_t = 4,
        value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub spp: u32,
    /// Rays a pixel toward the sky, and toward the sun if its shadows are soft.
    #[arg(long, value_name = "N", default_value_t = 16,
        value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub samples: u32,
    /// Another number gives other noise.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Bits a channel of a PNG.
    #[arg(long, value_name = "BITS", default_value = "8",
        value_parser = PossibleValuesParser::new(["8", "16"]))]
    pub bit_depth: String,
}

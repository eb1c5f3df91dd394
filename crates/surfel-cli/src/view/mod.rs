//! `surfel view`: the interactive viewer, in a browser.

mod browser;
mod legend;
mod made;
mod point;
mod settings;
mod studio;

use crate::args::{Global, SceneArgs};
use crate::picture::check_files;
use crate::report::Report;
use crate::scene_file::Line;
use anyhow::anyhow;
use std::io::ErrorKind;
use std::net::IpAddr;
use std::sync::Arc;
use studio::ScanStudio;
use surfel::progress::Progress;
use surfel::render::CpuRenderer;
use surfel::trace::Simd;
use surfel_web::{Error, Server, Studio};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Where the page is served; 0 takes any port that is free.
    #[arg(long, value_name = "PORT", default_value_t = 8080, help_heading = "Server")]
    port: u16,
    /// The address to listen at; beyond this machine, as with 0.0.0.0, the link holds a token that is
    /// needed.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1", help_heading = "Server")]
    host: IpAddr,
    /// Open the page in a browser.
    #[arg(long, help_heading = "Server")]
    open: bool,
    #[command(flatten)]
    pub scene: SceneArgs,
}

impl Args {
    /// What is seen; of clouds all columns are kept, as any point may be asked for them.
    pub fn with_all_columns(mut self) -> SceneArgs {
        self.scene.preparation.keeps_all = true;
        self.scene
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel view scan.laz                   prints a link; open it in a browser
  surfel view scan.laz house.glb --open
  surfel view scene.toml --port 9000
  surfel view scan.laz --host 0.0.0.0    for other machines: the link holds a token
  ssh -L 8080:localhost:8080 server      on your own machine, to look at what a server views";

pub fn run(args: &Args, line: &Line, global: &Global, report: &Report) -> anyhow::Result<()> {
    args.scene.check()?;
    check_files(&args.scene, line, global)?;
    let server = Server::bind(args.host, args.port).map_err(|error| match error {
        Error::Io { ref source, .. } if source.kind() == ErrorKind::AddrNotAvailable => {
            anyhow!("{error}; choose an address of this machine with --host, or 0.0.0.0 for all")
        }
        Error::Io { .. } => anyhow!("{error}; choose another port with --port, or 0 for any"),
        error => anyhow!(error),
    })?;
    crate::report::print(&server.link())?;
    if args.open && !browser::open(&server.link()) {
        report.note("no browser could be started; open the link yourself");
    }
    let (line, global, report_there) = (line.clone(), global.clone(), report.twin());
    let open = move |progress: &dyn Progress| {
        let report = report_there.heard_by(progress);
        open_studio(line, &global, &report).map_err(settings::refusal)
    };
    let renderer = Arc::new(CpuRenderer { simd: Simd::detect() });
    server.run(renderer, report.cancellation(), open).map_err(|error| match error {
        Error::Cancelled => anyhow!(surfel::Error::Cancelled),
        error => anyhow!(error),
    })
}

/// Reads what is to be viewed.
pub fn open_studio(
    line: Line,
    global: &Global,
    report: &Report,
) -> anyhow::Result<Arc<dyn Studio>> {
    Ok(Arc::new(ScanStudio::open(line, global, report)?))
}

//! `surfel view`: the interactive viewer, in a browser.

mod browser;
mod rejection;
mod rows;
mod added_files;
mod file_names;
mod freed_memory;
mod legend;
mod facts;
mod histogram;
mod coordinates;
mod point;
mod temp_download;
mod camera_path;
mod page_camera;
mod shown_points;
mod page_overlay;
mod page_settings;
mod scene_provider;

use crate::global::Global;
use crate::options::Scope;
use crate::report::{Report, Verbosity, print};
use crate::scene_args::SceneArgs;
use anyhow::anyhow;
use file_names::ClientProgress;
use rejection::rejection;
use scene_provider::{FileSceneProvider, viewed_folders};
use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use surfel::description::Section;
use surfel::resolve::check_files;
use surfel::{RendererOnThreads, SceneDescription, SceneRenderer, start_global_threads};
use surfel_core::progress::Progress;
use surfel_core::render::Renderer;
use surfel_web::{Error, FrameAncestors, Limits, SceneProvider, Server, TlsError, TlsIdentity};

/// Arguments of `surfel view`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Port of the page; 0 takes any free one.
    #[arg(long, value_name = "PORT", default_value_t = 8080, help_heading = "Server")]
    port: u16,
    /// Address to listen at. Beyond this machine, as with 0.0.0.0, the link contains a token, without which
    /// nobody is let in.
    #[arg(
        long,
        value_name = "ADDRESS",
        default_value = "127.0.0.1",
        help_heading = "Server",
        hide_short_help = true
    )]
    host: IpAddr,
    /// Certificate of the server in PEM format, followed by those that sign it; connections are then encrypted.
    #[arg(
        long,
        value_name = "FILE",
        requires = "tls_key",
        help_heading = "Server",
        hide_short_help = true
    )]
    tls_cert: Option<PathBuf>,
    /// Private key of the certificate in PEM format.
    #[arg(
        long,
        value_name = "FILE",
        requires = "tls_cert",
        help_heading = "Server",
        hide_short_help = true
    )]
    tls_key: Option<PathBuf>,
    /// Opens the page in a browser.
    #[arg(long, help_heading = "Server")]
    open: bool,
    /// Files and options of the scene.
    #[command(flatten)]
    pub scene: SceneArgs<Args>,
}

impl Scope for Args {
    fn has(section: Section, path: &str) -> bool {
        ![Section::Everywhere, Section::Plans, Section::Output].contains(&section)
            && path != "bit_depth"
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel view scan.laz                   prints a link; open it in a browser
  surfel view scan.laz house.glb --open
  surfel view scene.toml --port 9000
  surfel view scan.laz --host 0.0.0.0    for other machines: the link holds a token
  surfel view scan.laz --host 0.0.0.0 --tls-cert cert.pem --tls-key key.pem
  ssh -L 8080:localhost:8080 server      on your own machine, to look at what a server views";

/// Serves the viewer until it is interrupted.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    freed_memory::keep_little();
    let description = args.scene.startup(global, report)?;
    start_global_threads(&description.run)?;
    let renderer = SceneRenderer::new(&description.run)?;
    check_files(&description)?;
    let identity = args.tls_cert.as_deref().zip(args.tls_key.as_deref());
    let identity =
        identity.map(|(certificate, key)| read_identity(certificate, key)).transpose()?;
    let server = Server::bind(args.host, args.port).map_err(|error| match error {
        Error::Io { ref source, .. } if source.kind() == ErrorKind::AddrNotAvailable => {
            anyhow!("{error}; choose an address of this machine with --host, or 0.0.0.0 for all")
        }
        Error::Io { .. } => anyhow!("{error}; choose another port with --port, or 0 for any"),
        error => anyhow!(error),
    })?;
    let server = match identity {
        Some(identity) => server.with_tls(identity),
        None => server,
    };
    let links = server.links();
    print(&links.join("\n"))?;
    if args.open && !browser::open(&links[0]) {
        report.note("no browser could be started; open the link yourself");
    }
    let served = serve(server, renderer, description, args.scene.files.clone(), report);
    served.map_err(|error| match error {
        Error::Cancelled => anyhow!(surfel_core::Error::Cancelled),
        error => anyhow!(error),
    })
}

/// Serves a description until `report` is cancelled.
fn serve(
    server: Server,
    renderer: impl Renderer + Send + 'static,
    description: SceneDescription,
    typed: Vec<PathBuf>,
    report: &Report,
) -> surfel_web::Result<()> {
    let report_for_loading = report.for_thread();
    let limits = server.limits().clone();
    let open = move |progress: &dyn Progress| {
        let folders = viewed_folders(&description, &typed);
        let progress = ClientProgress { folders: &folders, progress };
        let report = report_for_loading.with_listener(&progress);
        open_scene_provider(description, typed, limits, &report).map_err(rejection)
    };
    server.run(Arc::new(renderer), report.cancellation(), open)
}

/// A viewer that serves a scene on a thread of its own, to this machine alone.
pub struct RunningViewer {
    /// The link to its page.
    pub link: String,
    /// The origins whose pages may show the page in a frame.
    pub frame_ancestors: FrameAncestors,
    is_stopped: Arc<AtomicBool>,
    thread: JoinHandle<surfel_web::Result<()>>,
}

impl RunningViewer {
    /// Starts to serve a description at a port; port 0 takes any free one.
    ///
    /// # Errors
    ///
    /// Fails if the system refuses the port or a thread.
    pub fn start(description: SceneDescription, port: u16) -> surfel_web::Result<Self> {
        let server = Server::bind(Ipv4Addr::LOCALHOST.into(), port)?;
        let (link, frame_ancestors) = (server.links().swap_remove(0), server.frame_ancestors());
        let report = Report::new(Verbosity::Quiet);
        let is_stopped = report.cancellation();
        let typed = description.files.clone();
        let renderer = SceneRenderer::new(&description.run)
            .and_then(|renderer| RendererOnThreads::new(renderer, &description.run))
            .map_err(rejection)?;
        let run = move || serve(server, renderer, description, typed, &report);
        let thread = std::thread::Builder::new().name("viewer".into()).spawn(run);
        let thread = thread.map_err(|source| Error::Io { address: link.clone(), source })?;
        Ok(Self { link, frame_ancestors, is_stopped, thread })
    }

    /// Returns true once the server has ended, as where the files could not be read.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Stops the server and returns what ended it, if that was something else.
    ///
    /// # Errors
    ///
    /// Fails as reading the files did.
    pub fn stop(self) -> surfel_web::Result<()> {
        self.is_stopped.store(true, Ordering::Relaxed);
        match self.thread.join() {
            Ok(Err(Error::Cancelled)) | Err(_) => Ok(()),
            Ok(ended) => ended,
        }
    }
}

/// Maximum size of a file with certificates or a key, in bytes.
const MAX_PEM_BYTES: usize = 1 << 20;

fn read_identity(certificate: &Path, key: &Path) -> anyhow::Result<TlsIdentity> {
    let read = |file| surfel_formats::load_text(file, MAX_PEM_BYTES);
    let identity = TlsIdentity::from_pem(read(certificate)?.as_bytes(), read(key)?.as_bytes());
    identity.map_err(|error| {
        let file = if matches!(error, TlsError::Certificate(_)) { certificate } else { key };
        anyhow!("{}: {error}", file.display())
    })
}

/// Reads the files of a description for a viewer with these limits.
pub fn open_scene_provider(
    description: SceneDescription,
    typed: Vec<PathBuf>,
    limits: Limits,
    report: &Report,
) -> surfel::Result<Arc<dyn SceneProvider>> {
    Ok(Arc::new(FileSceneProvider::open(description, typed, limits, report)?))
}

//! `surfel bench`: how many rays a second are traced, by kind of ray, from rays stored beforehand.

mod camera_file;
mod clock;
mod measure;
mod rays;
mod search;
mod table;

use crate::args::{CameraArgs, Global, PreparationArgs, SurfaceArgs, Usage, parse, short};
use crate::memory::Plan;
use crate::report::{Report, print};
use crate::stats;
use anyhow::Context;
use camera_file::CameraFile;
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clock::{Spent, timed};
use measure::{Bench, Rays, closest_hits};
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use surfel::flat::FlatScene;
use surfel::math::{DVec3, Vec3};
use surfel::points::{PointCloud, prepare};
use surfel::scene::{Background, Camera, Light, Material, Scene};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_formats::{ColumnChoice, Source};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A point cloud.
    #[arg(value_name = "CLOUD")]
    cloud: PathBuf,
    /// Kinds of rays, separated by commas [default: primary,shadow,bounce-any,bounce,gather].
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    rays: Option<Vec<Rays>>,
    /// Width and height of the picture whose rays are traced.
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = parse::resolution)]
    resolution: (u32, u32),
    /// Times that all rays are traced; the median and the best count.
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// SIMD level, the fastest by default.
    #[arg(long, value_name = "LEVEL", value_parser = simd_levels())]
    simd: Option<Simd>,
    /// JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Camera and light from a file of one line: ex,ey,ez,tx,ty,tz,fovy_deg,lx,ly,lz (eye, target,
    /// vertical angle of view, point light; Z up).
    #[arg(long, value_name = "FILE", conflicts_with = "CameraArgs")]
    camera_file: Option<PathBuf>,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    surface: SurfaceArgs,
    #[command(flatten)]
    preparation: PreparationArgs,
}

const EXAMPLES: &str = "\
Examples:
  surfel bench scan.laz
  surfel bench scan.laz --threads 1 --surface sphere --rays primary,shadow --json
  surfel bench cloud.bin --camera-file cloud.cam --simd portable";

/// What is traced if nothing else is asked for.
const USUAL: [Rays; 5] = [Rays::Primary, Rays::Shadow, Rays::BounceAny, Rays::Bounce, Rays::Gather];

pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let kinds = kinds(args, report)?;
    args.camera.check()?;
    let file = args.camera_file.as_deref().map(CameraFile::read).transpose()?;
    plan(args)?.check(global)?;
    let scene = scene(args, file.as_ref(), report)?;
    let n_points = scene.cloud.len();
    let (flat, build) = build(&scene, report)?;
    drop(scene);
    report.end_stage();

    let simd = args.simd.unwrap_or_else(Simd::detect);
    let result = json!({
        "rays": measure(args, &kinds, &flat, simd, file.as_ref(), report)?,
        "build_s": build.wall,
        "bytes_per_point": stats::bytes_per_point(&flat, n_points),
        "peak_rss_bytes": stats::peak_rss_bytes(),
        "threads": rayon::current_num_threads(),
        "simd": simd.name(),
        "build_cpu_s": build.cpu,
        "points": n_points,
        "surface": flat.surface.name(),
    });
    Ok(print(&if args.json { format!("{result:#}") } else { table::table(&result) })?)
}

/// Each kind of ray by its name.
fn measure(
    args: &Args,
    kinds: &[Rays],
    scene: &FlatScene,
    simd: Simd,
    file: Option<&CameraFile>,
    report: &Report,
) -> surfel::Result<Map<String, Value>> {
    let primary = rays::camera_rays(scene, file, args.resolution);
    let hits = closest_hits(scene, simd, &primary);
    let light = light(scene, file, report);
    let bench = Bench { scene, simd, runs: args.runs, light, primary, hits, report };
    let name = |kind: &Rays| kind.to_possible_value().map(|value| value.get_name().to_owned());
    let named =
        kinds.iter().map(|kind| Ok((name(kind).unwrap_or_default(), bench.measure(*kind)?)));
    named.collect()
}

/// The kinds of rays that the surface can be traced with.
fn kinds(args: &Args, report: &Report) -> Result<Vec<Rays>, Usage> {
    let surface = args.surface.surface;
    if surface == SurfaceKind::Points {
        return Err(Usage("--surface points meets no rays; name another kind".into()));
    }
    let kinds = args.rays.clone().unwrap_or(USUAL.to_vec());
    if surface.is_oriented() || !kinds.contains(&Rays::Gather) {
        return Ok(kinds);
    }
    if args.rays.is_some() {
        let name = surface.name();
        return Err(Usage(format!("--rays gather blends discs, which --surface {name} has not")));
    }
    report.choice("gather left out: spheres do not blend", "--rays");
    Ok(kinds.into_iter().filter(|kind| *kind != Rays::Gather).collect())
}

fn plan(args: &Args) -> anyhow::Result<Plan> {
    let source = surfel_formats::inspect(&args.cloud)?;
    // Two rays and what is found along them take a little more than a pixel with its layers.
    let n_pixels = 2 * u64::from(args.resolution.0) * u64::from(args.resolution.1);
    let files = std::slice::from_ref(&args.cloud);
    Ok(Plan::new(&[source], files, args.preparation.select, n_pixels))
}

fn scene(args: &Args, file: Option<&CameraFile>, report: &Report) -> anyhow::Result<Scene> {
    let options = args.preparation.load_options(ColumnChoice::Only(args.preparation.geometry()));
    let loaded = surfel_formats::load(&args.cloud, &options, report)?;
    let (cloud, _) = prepare(loaded.cloud, &args.preparation.preparation(0, None), report)
        .with_context(|| args.cloud.display().to_string())?;
    let automatic = || camera(args, &cloud, &loaded.source, report);
    Ok(Scene {
        camera: file.map_or_else(automatic, CameraFile::camera),
        colors: vec![[200; 3]; cloud.len()],
        cloud,
        surface: args.surface.surface,
        boundary: args.surface.boundary,
        material: Material::MATTE,
        lights: vec![Light::Headlight(1.0)],
        background: Background::Transparent,
    })
}

fn camera(args: &Args, cloud: &PointCloud, source: &Source, report: &Report) -> Camera {
    let (width, height) = args.resolution;
    let up = args.camera.up(cloud, source, report);
    args.camera.camera(cloud, up, f64::from(width) / f64::from(height), report)
}

/// Builds the tree, a small one several times; the last scene and the least time.
fn build(scene: &Scene, report: &Report) -> anyhow::Result<(FlatScene, Spent)> {
    let n_builds = match scene.cloud.len() {
        0..=2_000_000 => 5,
        2_000_001..=20_000_000 => 2,
        _ => 1,
    };
    let (mut flat, mut least) = timed(|| FlatScene::new(scene, report));
    for _ in 1..n_builds {
        // Frees its memory before the next one takes as much.
        drop(flat?);
        let spent;
        (flat, spent) = timed(|| FlatScene::new(scene, report));
        least = least.least(spent);
    }
    Ok((flat?, least))
}

/// Where shadow rays end, relative to the scene's origin.
fn light(scene: &FlatScene, file: Option<&CameraFile>, report: &Report) -> Vec3 {
    if let Some(file) = file {
        return (file.light - scene.origin).as_vec3();
    }
    let eye = scene.camera.position - scene.origin;
    let light = eye + DVec3::new(-0.6, 0.3, 0.5) * eye.length();
    let line = format!("point light at {}", short(light + scene.origin));
    report.choice(&line, "--camera-file");
    light.as_vec3()
}

fn simd_levels() -> impl TypedValueParser<Value = Simd> {
    let of_name = |name: String| Simd::available().into_iter().find(|simd| simd.name() == name);
    PossibleValuesParser::new(Simd::available().into_iter().map(Simd::name))
        .map(move |name| of_name(name).unwrap_or_else(Simd::detect))
}

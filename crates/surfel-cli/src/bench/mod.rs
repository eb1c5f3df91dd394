//! `surfel bench`: the number of rays traced per second, by kind, from rays stored beforehand.

mod camera_file;
mod clock;
#[cfg(feature = "gpu")]
mod gpu;
mod measure;
#[cfg(not(feature = "gpu"))]
mod no_gpu;
mod rays;
mod search;
mod table;

use crate::global::Global;
use crate::options::{KeyOptions, Scope};
use crate::report::{Report, print};
use crate::stats;
use crate::usage::Usage;
use anyhow::Context;
use camera_file::CameraFile;
use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clock::{Elapsed, timed};
#[cfg(feature = "gpu")]
use gpu::BenchGpu;
use measure::{Bench, closest_hits};
#[cfg(not(feature = "gpu"))]
use no_gpu::BenchGpu;
use rays::Rays;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::SceneDescription;
use surfel::description::rule::{Resolution, Rule};
use surfel::description::{Backend, ObjectSettings, Section};
use surfel::resolve::{
    MemoryEstimate, PIXEL_WITH_LAYERS, choose_camera, choose_up, prepare_cloud, short_position,
    state_known_sides,
};
use surfel_core::flat::FlatGeometry;
use surfel_core::math::{DAffine3, DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Camera, CameraFit, CloudGeometry, Geometry, Graph, Material, Mesh};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{Hit, Simd};
use surfel_formats::{Column, ColumnChoice, FileInfo, Loaded};

/// Options that a file with a camera excludes.
const CAMERA_OPTIONS: [&str; 11] = [
    "up",
    "camera.position",
    "camera.focal_point",
    "camera.view_up",
    "camera.view_angle",
    "camera.orthographic",
    "camera.panorama",
    "camera.direction",
    "camera.azimuth_angle",
    "camera.elevation_angle",
    "camera.zoom_factor",
];

/// Arguments of `surfel bench`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A point cloud or a mesh.
    #[arg(value_name = "CLOUD")]
    cloud: PathBuf,
    /// Kinds of rays, separated by commas [default: primary,shadow,bounce-any,bounce,gather].
    #[arg(long, value_name = "KINDS", value_delimiter = ',')]
    rays: Option<Vec<Rays>>,
    /// Width and height of the picture whose rays are traced.
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = resolution)]
    resolution: (u32, u32),
    /// Number of times that all rays are traced; the median and the best are reported.
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// SIMD level [default: the fastest].
    #[arg(long, value_name = "LEVEL", value_parser = simd_levels())]
    simd: Option<Simd>,
    /// Prints JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Camera and light from a file of one line: ex,ey,ez,tx,ty,tz,fovy_deg,lx,ly,lz (eye, target,
    /// vertical angle of view, point light; Z up).
    #[arg(long, value_name = "FILE", conflicts_with_all = CAMERA_OPTIONS)]
    camera_file: Option<PathBuf>,
    #[command(flatten)]
    options: KeyOptions<Args>,
}

impl Scope for Args {
    fn has(section: Section, path: &str) -> bool {
        let unread = ["camera.name", "camera.lock", "camera.station", "camera.interior"];
        let is_of_camera = path.starts_with("camera.") && !unread.contains(&path);
        match section {
            Section::Preparation => !["animation_name", "reproject"].contains(&path),
            Section::Surface => !path.starts_with("clip"),
            _ => is_of_camera || path == "up",
        }
    }
}

const EXAMPLES: &str = "\
Examples:
  surfel bench scan.laz
  surfel bench scan.laz --threads 1 --surface sphere --rays primary,shadow --json
  surfel bench cloud.bin --camera-file cloud.cam --simd portable";

/// Kinds of rays that are traced unless others are asked for.
const DEFAULT_RAYS: [Rays; 5] =
    [Rays::Primary, Rays::Shadow, Rays::BounceAny, Rays::Bounce, Rays::Gather];

/// Measures rates and prints them.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let settings = global.start()?;
    let is_on_gpu = settings.chosen_backend() == Backend::Gpu;
    let gpu = is_on_gpu.then(|| BenchGpu::open(&settings)).transpose()?;
    let description = args.options.description.clone()?;
    check_surface(args, &description)?;
    let file = args.camera_file.as_deref().map(CameraFile::read).transpose()?;
    estimate_memory(args, &description)?.check(settings.memory_limit)?;
    let unbuilt = load_unbuilt(args, &description, file.as_ref(), report)?;
    let (n_points, n_triangles) = unbuilt.graph.n_points_and_triangles();
    let (scene, build) = build(unbuilt, report)?;
    report.end();

    let simd = args.simd.unwrap_or_else(Simd::detect);
    let kinds = kinds(args, &scene, report)?;
    let (bytes_of, bytes, count_of, count, surface) = match &*scene.geometry {
        FlatGeometry::Cloud(cloud) => {
            let bytes = stats::bytes_per_point(std::iter::once(cloud), n_points);
            ("bytes_per_point", bytes, "points", n_points, cloud.surface.name())
        }
        FlatGeometry::Mesh(mesh) => {
            let bytes = stats::bytes_per_triangle(std::iter::once(mesh), n_triangles);
            ("bytes_per_triangle", bytes, "triangles", n_triangles, "triangle")
        }
    };
    let result = json!({
        "rays": measure(args, &kinds, &scene, &Engine { simd, gpu: gpu.as_ref() }, file.as_ref(), report)?,
        "build_s": build.wall,
        bytes_of: bytes,
        "peak_rss_bytes": stats::peak_rss_bytes(),
        "threads": rayon::current_num_threads(),
        "simd": simd.name(),
        "backend": if gpu.is_some() { "gpu" } else { "cpu" },
        "device": gpu.as_ref().map_or_else(stats::device, BenchGpu::name),
        "build_cpu_s": build.cpu,
        count_of: count,
        "surface": surface,
    });
    Ok(print(&if args.json { format!("{result:#}") } else { table::table(&result) })?)
}

/// One geometry and a camera: what is measured.
pub struct BenchScene {
    /// World coordinates of the geometry's zero, to which all rays are relative.
    pub origin: DVec3,
    /// The geometry with its tree.
    pub geometry: Arc<FlatGeometry>,
    /// The camera of the primary rays.
    pub camera: Camera,
}

/// A scene before its tree is built.
struct Unbuilt {
    graph: Graph,
    camera: Camera,
}

/// The processor or GPU that traces the rays.
struct Engine<'a> {
    /// The SIMD level of the CPU's kernels.
    simd: Simd,
    /// The GPU; none if the CPU is measured.
    gpu: Option<&'a BenchGpu>,
}

/// Measures each kind of rays; returns the results by name.
fn measure(
    args: &Args,
    kinds: &[Rays],
    scene: &BenchScene,
    engine: &Engine,
    file: Option<&CameraFile>,
    report: &Report,
) -> surfel_core::Result<Map<String, Value>> {
    let primary = rays::camera_rays(scene, file, args.resolution);
    let hits = closest_hits(scene, engine.simd, &primary);
    if hits.iter().all(Hit::is_miss) {
        report.note("no camera ray hits anything; see --camera-position and --camera-file");
    }
    let light = light(scene, file, report);
    let Engine { simd, gpu } = *engine;
    let bench = Bench { scene, simd, gpu, runs: args.runs, light, primary, hits, report };
    let name = |kind: &Rays| kind.to_possible_value().map(|value| value.get_name().to_owned());
    let named =
        kinds.iter().map(|kind| Ok((name(kind).unwrap_or_default(), bench.measure(*kind)?)));
    named.collect()
}

fn check_surface(args: &Args, description: &SceneDescription) -> Result<(), Usage> {
    match (description.objects_default.surface.surface(), &args.rays) {
        (SurfaceKind::Points, _) => {
            Err(Usage("--surface points is not hit by rays; choose another kind".into()))
        }
        (SurfaceKind::Gaussian, _) => Err(Usage(
            "--surface gaussian is no surface that rays end at; time its pictures with `surfel render --stats -`"
                .into(),
        )),
        (kind, Some(kinds)) if !kind.uses_discs() => {
            reject_gather(kinds, &format!("--surface {}", kind.name()))
        }
        _ => Ok(()),
    }
}

/// Fails if gather rays are asked for on geometry without discs.
fn reject_gather(kinds: &[Rays], why: &str) -> Result<(), Usage> {
    if kinds.contains(&Rays::Gather) {
        return Err(Usage(format!("--rays gather blends discs, and {why} has none")));
    }
    Ok(())
}

/// Returns the kinds of rays that fit the geometry.
fn kinds(args: &Args, scene: &BenchScene, report: &Report) -> Result<Vec<Rays>, Usage> {
    let unblended = match &*scene.geometry {
        FlatGeometry::Cloud(cloud) if cloud.surface.uses_discs() => {
            return Ok(args.rays.clone().unwrap_or(DEFAULT_RAYS.to_vec()));
        }
        FlatGeometry::Cloud(cloud) if cloud.surface.is_continuous() => "balls",
        FlatGeometry::Cloud(_) => "spheres",
        FlatGeometry::Mesh(_) => "triangles",
    };
    if let Some(kinds) = &args.rays {
        // Clouds without discs were refused before the file was read.
        reject_gather(kinds, "a mesh")?;
        return Ok(kinds.clone());
    }
    report.choice(&format!("gather left out: {unblended} do not blend"), &["rays"]);
    Ok(DEFAULT_RAYS.into_iter().filter(|kind| *kind != Rays::Gather).collect())
}

fn estimate_memory(args: &Args, description: &SceneDescription) -> anyhow::Result<MemoryEstimate> {
    let info = surfel_formats::inspect(&args.cloud)?;
    // Two rays and what is found along them take a little more than a pixel with its layers.
    let n_rays = 2 * u64::from(args.resolution.0) * u64::from(args.resolution.1);
    let file_info = [(args.cloud.as_path(), &info)];
    let subsample = description.objects_default.preparation.subsample;
    let bytes = n_rays * PIXEL_WITH_LAYERS;
    Ok(MemoryEstimate::from_files(file_info, subsample, bytes).with_surfaces_of(description))
}

fn load_unbuilt(
    args: &Args,
    description: &SceneDescription,
    file: Option<&CameraFile>,
    report: &Report,
) -> anyhow::Result<Unbuilt> {
    let settings = &description.objects_default;
    let (geometry, info) = load(args, settings, report)?;
    report.end();
    let graph = Graph::from_geometry(geometry, Material::MATTE).try_map_clouds(|cloud| {
        let mut cloud = prepare_cloud(cloud, settings, 0, report)
            .with_context(|| args.cloud.display().to_string())?;
        cloud.scale_radii(settings.surface.radius_scale() as f32);
        let mut geometry = CloudGeometry::with_uniform_color(cloud, [200; 3]);
        geometry.surface = settings.surface.surface();
        geometry.options = settings.surface.options();
        geometry.edge_test = settings.surface.edge_test();
        geometry.octree_depth = settings.surface.octree_depth();
        state_known_sides(&mut geometry, &settings.preparation);
        anyhow::Ok(geometry)
    })?;
    let camera = match file {
        Some(file) => file.camera(),
        None => {
            let points = graph.sample_points();
            let (width, height) = args.resolution;
            let up = choose_up(description.world.up, &points, &[info], report);
            let aspect = f64::from(width) / f64::from(height);
            let frame = CameraFit { up, aspect, ..CameraFit::default() };
            choose_camera(&description.camera, &points, &frame, None, report)
        }
    };
    Ok(Unbuilt { graph, camera })
}

/// Reads the only geometry of the file, in world coordinates.
fn load(
    args: &Args,
    settings: &ObjectSettings,
    report: &Report,
) -> anyhow::Result<(Geometry<PointCloud>, FileInfo)> {
    let of_preparation = settings.columns_of_preparation().into_iter();
    let of_preparation = of_preparation.map(|name| Column::Scalar(name.to_owned()));
    let kept = settings.preparation.kept_columns().into_iter();
    let columns = ColumnChoice::Only(kept.chain(of_preparation).collect());
    let options = settings.preparation.load_options(columns)?;
    let vertices = || -> anyhow::Result<(Geometry<PointCloud>, FileInfo)> {
        let Loaded { cloud, info: source } = surfel_formats::load(&args.cloud, &options, report)?;
        Ok((Geometry::Points(cloud), source))
    };
    if settings.preparation.vertices() {
        return vertices();
    }
    let (mut graph, source) = surfel_formats::load_graph(&args.cloud, &options, report)?;
    let world_from_nodes = graph.world_from_nodes();
    let shown = graph
        .nodes
        .iter()
        .zip(&world_from_nodes)
        .flat_map(|(node, world)| node.primitives.iter().map(move |_| *world));
    let shown: Vec<DAffine3> = shown.collect();
    let ([world], 1) = (&shown[..], graph.geometries.len()) else {
        let (name, n) = (args.cloud.display(), shown.len());
        anyhow::bail!("{name}: holds {n} objects; bench measures one cloud or mesh at a time");
    };
    match graph.geometries.remove(0) {
        geometry if *world == DAffine3::IDENTITY => Ok((geometry, source)),
        Geometry::Points(_) => vertices(),
        Geometry::Triangles(mesh) => Ok((Geometry::Triangles(in_world(mesh, *world)), source)),
    }
}

/// Returns a mesh in world coordinates, with its corners alone: rays need nothing else.
fn in_world(mesh: Mesh, world: DAffine3) -> Mesh {
    let transformed = |position: &Vec3| world.transform_point3(mesh.origin + position.as_dvec3());
    let positions: Vec<DVec3> = mesh.positions.iter().map(transformed).collect();
    let origin = PointCloud::choose_origin(&positions);
    let positions = positions.iter().map(|position| (*position - origin).as_vec3()).collect();
    Mesh { origin, positions, triangles: mesh.triangles, ..Mesh::default() }
}

/// Builds the tree, a small one several times; the last scene and the least time.
fn build(unbuilt: Unbuilt, report: &Report) -> anyhow::Result<(BenchScene, Elapsed)> {
    let Unbuilt { graph, camera } = unbuilt;
    let source = &graph.geometries[0];
    let n_builds = match source.positions().len() {
        0..=2_000_000 => 5,
        2_000_001..=20_000_000 => 2,
        _ => 1,
    };
    let flat = || FlatGeometry::new(source, report);
    let (mut geometry, mut least) = timed(flat);
    for _ in 1..n_builds {
        // Frees its memory before the next one takes as much.
        drop(geometry?);
        let spent;
        (geometry, spent) = timed(flat);
        least = least.least(spent);
    }
    Ok((BenchScene { origin: source.origin(), geometry: Arc::new(geometry?), camera }, least))
}

/// Returns the position of the light relative to the scene's origin.
fn light(scene: &BenchScene, file: Option<&CameraFile>, report: &Report) -> Vec3 {
    if let Some(file) = file {
        return (file.light - scene.origin).as_vec3();
    }
    let Camera { position, focal_point, .. } = scene.camera;
    let away = position.distance(focal_point);
    let light = position - scene.origin + DVec3::new(-0.6, 0.3, 0.5) * away;
    let line = format!("point light at {}", short_position(light + scene.origin));
    report.choice(&line, &["camera_file"]);
    light.as_vec3()
}

fn simd_levels() -> impl TypedValueParser<Value = Simd> {
    let of_name = |name: String| Simd::available().into_iter().find(|simd| simd.name() == name);
    PossibleValuesParser::new(Simd::available().into_iter().map(Simd::name))
        .map(move |name| of_name(name).unwrap_or_else(Simd::detect))
}

fn resolution(text: &str) -> Result<(u32, u32), String> {
    Resolution.read(&json!(text), Path::new("")).map_err(|error| error.message)
}

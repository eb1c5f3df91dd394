//! `surfel bench`: how many rays a second are traced, by kind of ray, from rays stored beforehand.

mod camera_file;
mod clock;
mod measure;
mod rays;
mod search;
mod table;

use crate::args::{CameraArgs, Global, PreparationArgs, SurfaceArgs, Usage, parse, short};
use crate::cloud::tell_prepared;
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
use surfel::flat::FlatGeometry;
use surfel::math::{DAffine3, DVec3, Vec3};
use surfel::points::{PointCloud, prepare};
use surfel::progress::Progress;
use surfel::scene::{Camera, Geometry, Graph, Material, Mesh, Points};
use surfel::surface::SurfaceKind;
use surfel::trace::{Hit, Simd};
use surfel_formats::{ColumnChoice, Loaded, Source};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A point cloud or a mesh.
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
    check_surface(args)?;
    args.camera.check()?;
    let file = args.camera_file.as_deref().map(CameraFile::read).transpose()?;
    plan(args)?.check(global)?;
    let described = describe(args, file.as_ref(), report)?;
    let (n_points, n_triangles) = described.graph.counts();
    let (stage, build) = build(described, report)?;
    report.end_stage();

    let simd = args.simd.unwrap_or_else(Simd::detect);
    let kinds = kinds(args, &stage, report)?;
    let (bytes_of, bytes, count_of, count, surface) = match &stage.geometry {
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
        "rays": measure(args, &kinds, &stage, simd, file.as_ref(), report)?,
        "build_s": build.wall,
        bytes_of: bytes,
        "peak_rss_bytes": stats::peak_rss_bytes(),
        "threads": rayon::current_num_threads(),
        "simd": simd.name(),
        "build_cpu_s": build.cpu,
        count_of: count,
        "surface": surface,
    });
    Ok(print(&if args.json { format!("{result:#}") } else { table::table(&result) })?)
}

/// What is measured: one geometry, and who looks at it.
pub struct Stage {
    /// World coordinates of the geometry's zero, to which all rays are relative.
    pub origin: DVec3,
    pub geometry: FlatGeometry,
    pub camera: Camera,
}

/// A stage before its tree is built.
struct Described {
    graph: Graph,
    camera: Camera,
}

/// Each kind of ray by its name.
fn measure(
    args: &Args,
    kinds: &[Rays],
    stage: &Stage,
    simd: Simd,
    file: Option<&CameraFile>,
    report: &Report,
) -> surfel::Result<Map<String, Value>> {
    let primary = rays::camera_rays(stage, file, args.resolution);
    let hits = closest_hits(stage, simd, &primary);
    if hits.iter().all(Hit::is_miss) {
        report.note("no camera ray hits anything; see --camera-position and --camera-file");
    }
    let light = light(stage, file, report);
    let bench = Bench { stage, simd, runs: args.runs, light, primary, hits, report };
    let name = |kind: &Rays| kind.to_possible_value().map(|value| value.get_name().to_owned());
    let named =
        kinds.iter().map(|kind| Ok((name(kind).unwrap_or_default(), bench.measure(*kind)?)));
    named.collect()
}

fn check_surface(args: &Args) -> Result<(), Usage> {
    match (args.surface.surface, &args.rays) {
        (SurfaceKind::Points, _) => {
            Err(Usage("--surface points meets no rays; name another kind".into()))
        }
        (SurfaceKind::Sphere, Some(kinds)) => gathers_not(kinds, "--surface sphere"),
        _ => Ok(()),
    }
}

/// Fails if rays are asked for that gather on what has no discs.
fn gathers_not(kinds: &[Rays], why: &str) -> Result<(), Usage> {
    if kinds.contains(&Rays::Gather) {
        return Err(Usage(format!("--rays gather blends discs, which {why} has not")));
    }
    Ok(())
}

/// The kinds of rays that the geometry can be traced with.
fn kinds(args: &Args, stage: &Stage, report: &Report) -> Result<Vec<Rays>, Usage> {
    let unblended = match &stage.geometry {
        FlatGeometry::Cloud(cloud) if cloud.surface.is_oriented() => {
            return Ok(args.rays.clone().unwrap_or(USUAL.to_vec()));
        }
        FlatGeometry::Cloud(_) => "spheres",
        FlatGeometry::Mesh(_) => "triangles",
    };
    if let Some(kinds) = &args.rays {
        // Spheres were refused before the file was read.
        gathers_not(kinds, "a mesh")?;
        return Ok(kinds.clone());
    }
    report.choice(&format!("gather left out: {unblended} do not blend"), "--rays");
    Ok(USUAL.into_iter().filter(|kind| *kind != Rays::Gather).collect())
}

fn plan(args: &Args) -> anyhow::Result<Plan> {
    let source = surfel_formats::inspect(&args.cloud)?;
    // Two rays and what is found along them take a little more than a pixel with its layers.
    let n_pixels = 2 * u64::from(args.resolution.0) * u64::from(args.resolution.1);
    let sources = [(args.cloud.as_path(), source)].into();
    Ok(Plan::new(&sources, args.preparation.select, n_pixels))
}

fn describe(args: &Args, file: Option<&CameraFile>, report: &Report) -> anyhow::Result<Described> {
    let (mut geometry, source) = load(args, report)?;
    report.end_stage();
    if let Geometry::Points(points) = &mut geometry {
        let preparation = args.preparation.preparation(0, None);
        let (mut cloud, prepared) =
            prepare(std::mem::take(&mut points.cloud), &preparation, report)
                .with_context(|| args.cloud.display().to_string())?;
        report.end_stage();
        tell_prepared(&prepared, &args.preparation, report);
        args.surface.scale_radii(&mut cloud);
        *points = Points {
            colors: vec![[200; 3]; cloud.len()],
            cloud,
            surface: args.surface.surface,
            boundary: args.surface.boundary,
            has_outward_normals: false,
        };
    }
    let graph = Graph::of(geometry, Material::MATTE);
    let camera = match file {
        Some(file) => file.camera(),
        None => camera(args, &graph.outline(), &source, report),
    };
    Ok(Described { graph, camera })
}

/// The one thing that the file holds, where it stands in the world.
fn load(args: &Args, report: &Report) -> anyhow::Result<(Geometry, Source)> {
    let options = args.preparation.load_options(ColumnChoice::Only(args.preparation.geometry()));
    let vertices = || -> anyhow::Result<(Geometry, Source)> {
        let Loaded { cloud, source } = surfel_formats::load(&args.cloud, &options, report)?;
        Ok((Geometry::Points(Points { cloud, ..Points::default() }), source))
    };
    if args.preparation.vertices {
        return vertices();
    }
    let (mut graph, source) = surfel_formats::load_graph(&args.cloud, &options, report)?;
    let world = graph.world_from_nodes();
    let shown = graph
        .nodes
        .iter()
        .zip(&world)
        .flat_map(|(node, world)| node.parts.iter().map(move |_| *world));
    let shown: Vec<DAffine3> = shown.collect();
    let ([place], 1) = (&shown[..], graph.geometries.len()) else {
        let (name, n) = (args.cloud.display(), shown.len());
        anyhow::bail!("{name}: holds {n} things; one cloud or mesh is measured at a time");
    };
    match graph.geometries.remove(0) {
        geometry if *place == DAffine3::IDENTITY => Ok((geometry, source)),
        Geometry::Points(_) => vertices(),
        Geometry::Triangles(mesh) => Ok((Geometry::Triangles(moved(mesh, *place)), source)),
    }
}

/// Where `place` takes the corners; of what else they carry no ray asks.
fn moved(mesh: Mesh, place: DAffine3) -> Mesh {
    let in_world = |position: &Vec3| place.transform_point3(mesh.origin + position.as_dvec3());
    let places: Vec<DVec3> = mesh.positions.iter().map(in_world).collect();
    let origin = PointCloud::choose_origin(&places);
    let positions = places.iter().map(|place| (*place - origin).as_vec3()).collect();
    Mesh { origin, positions, triangles: mesh.triangles, ..Mesh::default() }
}

fn camera(args: &Args, outline: &PointCloud, source: &Source, report: &Report) -> Camera {
    let (width, height) = args.resolution;
    let up = args.camera.up(outline, std::slice::from_ref(source), report);
    args.camera.camera(outline, up, f64::from(width) / f64::from(height), report)
}

/// Builds the tree, a small one several times; the last stage and the least time.
fn build(described: Described, report: &Report) -> anyhow::Result<(Stage, Spent)> {
    let Described { graph, camera } = described;
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
    Ok((Stage { origin: source.origin(), geometry: geometry?, camera }, least))
}

/// Where shadow rays end, relative to the stage's origin.
fn light(stage: &Stage, file: Option<&CameraFile>, report: &Report) -> Vec3 {
    if let Some(file) = file {
        return (file.light - stage.origin).as_vec3();
    }
    let Camera { position, focal_point, .. } = stage.camera;
    let away = position.distance(focal_point);
    let light = position - stage.origin + DVec3::new(-0.6, 0.3, 0.5) * away;
    let line = format!("point light at {}", short(light + stage.origin));
    report.choice(&line, "--camera-file");
    light.as_vec3()
}

fn simd_levels() -> impl TypedValueParser<Value = Simd> {
    let of_name = |name: String| Simd::available().into_iter().find(|simd| simd.name() == name);
    PossibleValuesParser::new(Simd::available().into_iter().map(Simd::name))
        .map(move |name| of_name(name).unwrap_or_else(Simd::detect))
}

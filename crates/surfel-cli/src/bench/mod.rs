//! `surfel bench`: how many rays a second are traced, by kind of ray, from rays stored beforehand.

use crate::args::{Global, PreparationArgs, SurfaceArgs, is_georeferenced, parse};
use crate::memory::Plan;
use crate::report::{Report, print};
use crate::stats;
use anyhow::Context;
use clap::ValueEnum;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use std::time::Instant;
use surfel::flat::FlatScene;
use surfel::math::{Frame, Random, Ray, Vec3, cosine_hemisphere};
use surfel::points::{guess_up, prepare};
use surfel::progress::Progress;
use surfel::scene::{Background, Framing, Light, Material, Scene, frame};
use surfel::trace::{self, Gather, Hit, Simd, SurfaceHit};
use surfel_formats::ColumnChoice;

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// A point cloud.
    #[arg(value_name = "CLOUD")]
    cloud: PathBuf,
    /// Kinds of rays, separated by commas.
    #[arg(
        long,
        value_name = "KINDS",
        value_delimiter = ',',
        default_value = "primary,gather,surface,shadow,bounce-any,bounce"
    )]
    rays: Vec<Rays>,
    /// Width and height of the picture whose rays are traced.
    #[arg(long, value_name = "WxH", default_value = "1024x1024", value_parser = parse::resolution)]
    resolution: (u32, u32),
    /// Times that all rays are traced; the median and the best count.
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// JSON instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    surface: SurfaceArgs,
    #[command(flatten)]
    preparation: PreparationArgs,
}

const EXAMPLES: &str = "\
Examples:
  surfel bench scan.laz
  surfel bench scan.laz --threads 1 --surface disc --rays primary,shadow --json";

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Rays {
    /// Camera rays, nearest disc or sphere.
    Primary,
    /// Camera rays, all discs of the surface.
    Gather,
    /// Camera rays, the finished surface with its boundary.
    Surface,
    /// From each hit to a light at one point: is anything between?
    Shadow,
    /// From each hit in one random direction: is anything there?
    BounceAny,
    /// The same, nearest disc or sphere.
    Bounce,
}

/// Pixels along the side of a batch of rays.
const TILE: u32 = 16;

pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let source = surfel_formats::inspect(&args.cloud)?;
    let plan = Plan::new(&[source], std::slice::from_ref(&args.cloud), args.preparation.select, 0);
    plan.check(global)?;
    let scene = scene(args, report)?;
    let n_points = scene.cloud.len();
    let start = Instant::now();
    let flat = FlatScene::new(&scene, report)?;
    let build_s = start.elapsed().as_secs_f64();
    drop(scene);
    report.end_stage();

    let simd = Simd::detect();
    let bench = Bench { flat: &flat, simd, runs: args.runs, report };
    let primary = camera_rays(&flat, args.resolution);
    let hits = bench.surface_hits(&primary);
    let mut found = Map::new();
    for kind in &args.rays {
        let name = kind.to_possible_value().map_or(String::new(), |v| v.get_name().to_owned());
        found.insert(name, bench.measure(*kind, &primary, &hits)?);
    }
    let result = json!({
        "rays": found,
        "build_s": build_s,
        "bytes_per_point": stats::bytes_per_point(&flat, n_points),
        "peak_rss_bytes": stats::peak_rss_bytes(),
        "threads": rayon::current_num_threads(),
        "simd": simd.name(),
    });
    Ok(print(&if args.json { format!("{result:#}") } else { table(&result) })?)
}

fn scene(args: &Args, report: &Report) -> anyhow::Result<Scene> {
    let options = args.preparation.load_options(ColumnChoice::Only(args.preparation.geometry()));
    let loaded = surfel_formats::load(&args.cloud, &options, report)?;
    let (cloud, _) = prepare(loaded.cloud, &args.preparation.preparation(0, None), report)
        .with_context(|| args.cloud.display().to_string())?;
    let (width, height) = args.resolution;
    let up = guess_up(&cloud, is_georeferenced(&cloud, &loaded.source)).up;
    let aspect = f64::from(width) / f64::from(height);
    Ok(Scene {
        camera: frame(&cloud, &Framing::automatic(up, aspect)),
        colors: vec![[200; 3]; cloud.len()],
        cloud,
        surface: args.surface.surface,
        boundary: args.surface.boundary,
        material: Material::Matte,
        lights: vec![Light::Headlight(1.0)],
        background: Background::Transparent,
    })
}

/// Rays through all pixels' centres, a batch a tile.
fn camera_rays(flat: &FlatScene, (width, height): (u32, u32)) -> Vec<Vec<Ray>> {
    let view = flat.camera.view(flat.origin, width, height);
    let corners = |size: u32| (0..size).step_by(TILE as usize);
    let tile = |(x, y): (u32, u32)| {
        let rows = y..height.min(y + TILE);
        let pixels = rows.flat_map(|row| (x..width.min(x + TILE)).map(move |column| (column, row)));
        pixels.map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect()
    };
    corners(height).flat_map(|y| corners(width).map(move |x| (x, y))).map(tile).collect()
}

struct Bench<'a> {
    flat: &'a FlatScene,
    simd: Simd,
    runs: u32,
    report: &'a Report,
}

impl Bench<'_> {
    fn surface_hits(&self, rays: &[Vec<Ray>]) -> Vec<Vec<SurfaceHit>> {
        let hits = |rays: &Vec<Ray>| {
            let mut hits = vec![SurfaceHit::MISS; rays.len()];
            trace::surface_hits(self.flat, self.simd, rays, &mut hits);
            hits
        };
        rays.par_iter().map(hits).collect()
    }

    fn measure(
        &self,
        kind: Rays,
        primary: &[Vec<Ray>],
        hits: &[Vec<SurfaceHit>],
    ) -> surfel::Result<Value> {
        let rays = self.rays(kind, primary, hits);
        let n_rays: usize = rays.iter().map(Vec::len).sum();
        let (mut seconds, mut n_hits) = (Vec::new(), 0);
        for _ in 0..self.runs {
            self.report.check()?;
            let start = Instant::now();
            n_hits = rays.par_iter().map(|rays| self.trace(kind, rays)).sum();
            seconds.push(start.elapsed().as_secs_f64());
        }
        seconds.sort_unstable_by(f64::total_cmp);
        let speed = |secs: f64| stats::mrays_per_s(n_rays as u64, secs);
        Ok(json!({
            "rays": n_rays,
            "hits": n_hits,
            "median_mrays_per_s": speed(seconds[seconds.len() / 2]),
            "best_mrays_per_s": speed(seconds[0]),
        }))
    }

    fn rays(&self, kind: Rays, primary: &[Vec<Ray>], hits: &[Vec<SurfaceHit>]) -> Vec<Vec<Ray>> {
        let eye = (self.flat.camera.position - self.flat.origin).as_vec3();
        let light = eye + Vec3::new(-0.6, 0.3, 0.5) * eye.length();
        match kind {
            Rays::Primary | Rays::Gather | Rays::Surface => primary.to_vec(),
            Rays::Shadow => self.secondary(primary, hits, |_, position, _| (light - position, 1.0)),
            Rays::BounceAny | Rays::Bounce => self.secondary(primary, hits, |i, _, normal| {
                let mut random = Random::new(0, i as u64);
                let local = cosine_hemisphere((random.next_f32(), random.next_f32()));
                (Frame::around(normal).to_world(local), f32::INFINITY)
            }),
        }
    }

    /// Rays from hits; `aim(index of the ray, position, normal)` gives direction and share of its length.
    fn secondary(
        &self,
        primary: &[Vec<Ray>],
        hits: &[Vec<SurfaceHit>],
        aim: impl Fn(usize, Vec3, Vec3) -> (Vec3, f32) + Sync,
    ) -> Vec<Vec<Ray>> {
        let from_tile = |(tile_idx, (rays, hits)): (usize, (&Vec<Ray>, &Vec<SurfaceHit>))| {
            let met = rays.iter().zip(hits).enumerate().filter(|(_, (_, hit))| !hit.is_miss());
            let spawn = |(i, (ray, hit)): (usize, (&Ray, &SurfaceHit))| {
                let position = ray.at(hit.distance);
                let (toward, reach) = aim(tile_idx << 8 | i, position, hit.normal);
                let surface = self.flat.surface;
                let direction = toward.normalize_or(hit.normal);
                let ray = surface.spawn_ray(position, hit.normal, hit.radius, direction);
                Ray { t_max: reach * toward.length(), ..ray }
            };
            met.map(spawn).collect()
        };
        primary.par_iter().zip(hits).enumerate().map(from_tile).collect()
    }

    /// Traces a batch; the number of hits.
    fn trace(&self, kind: Rays, rays: &[Ray]) -> usize {
        let (flat, simd, n) = (self.flat, self.simd, rays.len());
        match kind {
            Rays::Primary | Rays::Bounce => {
                let mut hits = vec![Hit::MISS; n];
                trace::closest_hits(flat, simd, rays, &mut hits);
                hits.iter().filter(|hit| !hit.is_miss()).count()
            }
            Rays::Gather => {
                let mut gathers = vec![Gather::EMPTY; n];
                trace::gathers(flat, simd, rays, &mut gathers);
                gathers.iter().filter(|gather| !gather.hits().is_empty()).count()
            }
            Rays::Surface => {
                let mut hits = vec![SurfaceHit::MISS; n];
                trace::surface_hits(flat, simd, rays, &mut hits);
                hits.iter().filter(|hit| !hit.is_miss()).count()
            }
            Rays::Shadow | Rays::BounceAny => {
                let mut occluded = vec![false; n];
                trace::any_hits(flat, simd, rays, &mut occluded);
                occluded.iter().filter(|hit| **hit).count()
            }
        }
    }
}

fn table(result: &Value) -> String {
    let number = |value: &Value| value.as_f64().unwrap_or(0.0);
    let mut text = "rays            number      hits  median M/s    best M/s\n".to_owned();
    for (name, row) in result["rays"].as_object().into_iter().flatten() {
        let [rays, hits] = ["rays", "hits"].map(|key| number(&row[key]));
        let [median, best] =
            ["median_mrays_per_s", "best_mrays_per_s"].map(|key| number(&row[key]));
        text += &format!("{name:<12}{rays:>10}{hits:>10}{median:>12.2}{best:>12.2}\n");
    }
    let (build_s, bytes) =
        (number(&result["build_s"]), number(&result["bytes_per_point"]["total"]));
    let threads = &result["threads"];
    text + &format!("built in {build_s:.2} s, {bytes:.1} bytes a point, {threads} threads")
}

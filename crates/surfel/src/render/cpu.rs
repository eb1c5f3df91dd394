//! The CPU renderer: tiles on all threads, each a few batches of rays.

use super::{Piece, RenderStats, Renderer, Settings, raster};
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::{Band, Image};
use crate::integrator::{self, Batch, Integrator, RayCounts, Samples, Whitted};
use crate::math::{Ray, Vec3, Vec4, hash, morton_place, scrambled_pair};
use crate::progress::Progress;
use crate::scene::View;
use crate::trace::{SceneHit, Simd, Tracer, Which};
use rayon::prelude::*;
use std::time::Instant;

/// Runs on the current rayon pool.
#[derive(Clone, Copy, Debug)]
pub struct CpuRenderer {
    pub simd: Simd,
}

/// Pixels along a tile's side.
const TILE: u32 = 32;
/// Rays of a batch, about: enough to fill tiles of few samples, little enough for the caches.
const BATCH: u32 = 4096;

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn render_piece(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        piece: Piece,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)> {
        settings.check()?;
        piece.check(settings)?;
        let start = Instant::now();
        let view = scene.camera.view(scene.origin, settings.width, settings.height);
        let (image, mut stats) = if raster::is_asked_for(scene)? {
            (raster::render(scene, &view, settings, piece, progress)?, RenderStats::default())
        } else {
            let tracer = Tracer::new(scene, self.simd, progress);
            let job = Job { tracer: &tracer, view: &view, settings, piece };
            trace(&job)?
        };
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }
}

fn trace(job: &Job) -> Result<(Image, RenderStats)> {
    let Job { tracer: Tracer { progress, .. }, settings, piece, .. } = *job;
    progress.begin("render", u64::from(settings.width) * u64::from(piece.n_rows()));
    let mut image = settings.blank(piece);
    let bands: Vec<_> = image.bands_mut(TILE as usize).into_iter().enumerate().collect();
    let bands = bands.into_par_iter().map(|(row, mut band)| {
        let render = |place| {
            let tile = Tile::render(job, place)?;
            progress.advance(place.n_pixels() as u64);
            Ok(tile)
        };
        let places: Vec<_> = TilePlace::of_row(row as u32, job).collect();
        let tiles: Vec<_> = places.into_par_iter().map(render).collect::<Result<_>>()?;
        tiles.iter().for_each(|tile| tile.copy_to(&mut band, settings.width));
        Ok(tiles.iter().map(|tile| (tile.counts, tile.trace_secs)).collect::<Vec<_>>())
    });
    let mut stats = RenderStats::default();
    for (counts, trace_secs) in bands.collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        stats.rays += counts;
        stats.trace_secs += trace_secs / rayon::current_num_threads() as f64;
    }
    Ok((image, stats))
}

/// What all tiles share.
struct Job<'a> {
    tracer: &'a Tracer<'a>,
    view: &'a View,
    settings: &'a Settings,
    piece: Piece,
}

/// What is behind the scene in a row of pixels, with alpha.
fn background(job: &Job, y: u32) -> Vec4 {
    let height = (y as f32 + 0.5) / job.settings.height as f32;
    Vec4::from_array(job.tracer.scene.background.at(height))
}

/// Where a tile lies.
#[derive(Clone, Copy)]
struct TilePlace {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl TilePlace {
    /// The tiles of a row of them in the piece, from the left.
    fn of_row(row: u32, job: &Job) -> impl Iterator<Item = Self> {
        let (y, width) = (job.piece.rows.0 + row * TILE, job.settings.width);
        let height = TILE.min(job.piece.rows.1 - y);
        let place = move |x| Self { x, y, width: TILE.min(width - x), height };
        (0..width).step_by(TILE as usize).map(place)
    }

    fn n_pixels(self) -> usize {
        (self.width * self.height) as usize
    }

    /// Coordinates in the picture of the tile's pixels, in Morton order: rays of a packet should be close, and
    /// packets of a group.
    fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        let places = (0..TILE.pow(2)).map(morton_place);
        let places = places.filter(move |&(x, y)| x < self.width && y < self.height);
        places.map(move |(x, y)| (self.x + x, self.y + y))
    }
}

/// A finished tile, its pixels in the order of `TilePlace::pixels`.
struct Tile {
    place: TilePlace,
    color: Vec<Vec4>,
    coverage: Vec<f32>,
    layers: Vec<LayerPixel>,
    counts: RayCounts,
    trace_secs: f64,
}

/// What the ray through a pixel's centre met.
struct LayerPixel {
    depth: f32,
    position: Vec3,
    albedo: Vec3,
    hit: SceneHit,
}

impl Tile {
    fn render(job: &Job, place: TilePlace) -> Result<Self> {
        let Job { settings, .. } = *job;
        let n = place.n_pixels();
        let mut tile = Self {
            place,
            color: vec![Vec4::ZERO; n],
            coverage: vec![0.0; n],
            layers: Vec::new(),
            counts: RayCounts::default(),
            trace_secs: 0.0,
        };
        let n_samples = job.piece.n_samples();
        let (first, end) = job.piece.samples;
        let at_once = (BATCH / n as u32).clamp(1, n_samples);
        for first in (first..end).step_by(at_once as usize) {
            tile.add_samples(job, first..end.min(first + at_once))?;
        }
        for (i, (_, y)) in place.pixels().enumerate() {
            let n_samples = n_samples as f32;
            tile.coverage[i] /= n_samples;
            tile.color[i] =
                tile.color[i] / n_samples + (1.0 - tile.coverage[i]) * background(job, y);
        }
        if settings.with_layers && 1 < settings.samples_per_pixel {
            tile.trace_layers(job)?;
        }
        Ok(tile)
    }

    /// Adds up the camera rays of these numbers of all pixels.
    fn add_samples(&mut self, job: &Job, numbers: std::ops::Range<u32>) -> Result<()> {
        let Job { tracer, view, settings, .. } = *job;
        let per_pixel = numbers.len();
        let n = self.color.len() * per_pixel;
        let mut rays = Vec::with_capacity(n);
        let (mut keys, mut indices) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut behind = Vec::with_capacity(n);
        for (x, y) in self.place.pixels() {
            let key = hash(settings.seed ^ hash(u64::from(y) << 32 | u64::from(x)));
            let background = background(job, y);
            for index in numbers.clone() {
                let (dx, dy) = if settings.samples_per_pixel == 1 {
                    (0.5, 0.5)
                } else {
                    scrambled_pair(index, key)
                };
                rays.push(view.ray(x as f32 + dx, y as f32 + dy));
                keys.push(key);
                indices.push(index);
                behind.push(background);
            }
        }
        let start = Instant::now();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        tracer.hits(Which::All, &rays, &mut hits)?;
        self.trace_secs += start.elapsed().as_secs_f64();
        if settings.with_layers && settings.samples_per_pixel == 1 {
            self.keep_layers(job, &rays, &hits);
        }
        let n_light = settings.light_samples.div_ceil(settings.samples_per_pixel);
        let samples = Samples { keys: &keys, indices: &indices, behind: &behind, n_light };
        let batch = Batch { tracer, rays: &rays, hits: &hits, samples };
        let integrator = Whitted { max_depth: settings.max_depth };
        let (colors, counts) = integrator.radiance(&batch)?;
        for (i, color) in colors.iter().enumerate() {
            self.color[i / per_pixel] += *color;
            self.coverage[i / per_pixel] += color.w;
        }
        self.counts += counts;
        Ok(())
    }

    fn trace_layers(&mut self, job: &Job) -> Result<()> {
        let rays: Vec<Ray> = self
            .place
            .pixels()
            .map(|(x, y)| job.view.ray(x as f32 + 0.5, y as f32 + 0.5))
            .collect();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        job.tracer.hits(Which::All, &rays, &mut hits)?;
        self.counts.primary += rays.len() as u64;
        self.keep_layers(job, &rays, &hits);
        Ok(())
    }

    /// Takes the layers from the rays through the pixels' centres.
    fn keep_layers(&mut self, job: &Job, rays: &[Ray], hits: &[SceneHit]) {
        let layer = |(ray, hit): (&Ray, &SceneHit)| {
            if hit.is_miss() {
                let (depth, nothing) = (f32::INFINITY, Vec3::ZERO);
                return LayerPixel { depth, position: nothing, albedo: nothing, hit: *hit };
            }
            let position = ray.at(hit.distance);
            let albedo = integrator::albedo(job.tracer.scene, ray, hit);
            LayerPixel { depth: job.view.depth(position), position, albedo, hit: *hit }
        };
        self.layers = rays.iter().zip(hits).map(layer).collect();
    }

    fn copy_to(&self, band: &mut Band, width: u32) {
        for (i, (x, y)) in self.place.pixels().enumerate() {
            let pixel = ((y - self.place.y) * width + x) as usize;
            band.color[pixel] = self.color[i].to_array();
            band.coverage[pixel] = self.coverage[i];
            if let Some(layers) = &mut band.layers {
                let LayerPixel { depth, position, albedo, hit } = &self.layers[i];
                layers.depth[pixel] = *depth;
                layers.position[pixel] = *position;
                layers.normal[pixel] = hit.normal;
                layers.point_id[pixel] = hit.id;
                layers.instance_id[pixel] = hit.instance;
                layers.albedo[pixel] = *albedo;
            }
        }
    }
}

//! The CPU renderer: it renders tiles on all threads, each tile in a few batches of rays.

use super::adaptive::{
    MIN_ADAPTIVE_SAMPLES, block, is_adaptive, parts, squared_error, with_whole_blocks,
};
use super::raster;
use super::region::RenderRegion;
use super::renderer::{RenderStats, Renderer};
use super::settings::Settings;
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::{Band, Image};
use crate::integrator::{CameraRayBatch, Integrator, PixelSamples, RayCounts, Whitted, albedo};
use crate::math::{Ray, Vec3, Vec4, hash, morton_decode, owen_sobol_2d};
use crate::progress::Progress;
use crate::scene::{Background, Lens, View};
use crate::trace::{InstanceFilter, PixelSize, SceneHit, Simd, Support, Tracer};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// A renderer that runs on the current rayon pool.
#[derive(Clone, Copy, Debug)]
pub struct CpuRenderer {
    /// The SIMD level of its kernels.
    pub simd: Simd,
}

/// Side of a tile in pixels.
const TILE_SIZE: u32 = 32;
/// Approximate number of rays in a batch: enough to fill tiles of few samples, and few enough for the
/// caches.
const BATCH_SIZE: u32 = 4096;

impl Renderer for CpuRenderer {
    fn render_region(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)> {
        settings.check()?;
        region.check(settings)?;
        let start = Instant::now();
        let view = scene.camera.view(scene.origin, settings.width, settings.height);
        let (image, mut stats) = if raster::uses_rasterizer(scene)? {
            (raster::render(scene, &view, settings, region, progress)?, RenderStats::default())
        } else {
            let tracer = Tracer::new(scene, self.simd, pixel_size(&view), progress);
            let job = Job { tracer: &tracer, view: &view, settings, region };
            render_tiles(&job)?
        };
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }
}

/// Returns the size of a pixel along the rays of a view.
fn pixel_size(view: &View) -> PixelSize {
    let size = view.pixel_size();
    match view.lens {
        Lens::Orthographic { .. } => PixelSize { at_origin: size, per_distance: 0.0 },
        _ => PixelSize { at_origin: 0.0, per_distance: size },
    }
}

fn render_tiles(job: &Job) -> Result<(Image, RenderStats)> {
    let Job { tracer: Tracer { progress, .. }, settings, region, .. } = *job;
    if is_adaptive(settings, region) && with_whole_blocks(region, settings) != region {
        let blocks = with_whole_blocks(region, settings);
        let (image, stats) = render_tiles(&Job { region: blocks, ..*job })?;
        let [rows, columns] = [(region.rows, blocks.rows), (region.columns, blocks.columns)]
            .map(|((first, end), (zero, _))| (first - zero, end - zero));
        return Ok((image.cropped(rows, columns), stats));
    }
    progress.begin("render", region.n_pixels());
    let mut image = region.blank_image(settings);
    let bands: Vec<_> = image.bands_mut(TILE_SIZE as usize).into_iter().enumerate().collect();
    let bands = bands.into_par_iter().map(|(row, mut band)| {
        let render = |rect: TileRect| {
            let tile = Tile::render(job, rect)?;
            progress.advance(rect.n_pixels() as u64);
            Ok(tile)
        };
        let rects: Vec<_> = TileRect::row(row as u32, job).collect();
        let tiles: Vec<_> = rects.into_par_iter().map(render).collect::<Result<_>>()?;
        tiles.iter().for_each(|tile| tile.copy_to(&mut band, region.columns));
        Ok(tiles.iter().map(|tile| (tile.counts, tile.trace_secs)).collect::<Vec<_>>())
    });
    let mut stats = RenderStats::default();
    for (counts, trace_secs) in bands.collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        stats.rays += counts;
        stats.trace_secs += trace_secs / rayon::current_num_threads() as f64;
    }
    Ok((image, stats))
}

/// Inputs that all tiles share.
#[derive(Clone, Copy)]
struct Job<'a> {
    tracer: &'a Tracer<'a>,
    view: &'a View,
    settings: &'a Settings,
    region: RenderRegion,
}

impl Job<'_> {
    /// Returns the ray through a position in the picture, as far as the scene's planes show it.
    fn camera_ray(&self, x: f32, y: f32) -> Ray {
        let FlatScene { camera_planes, origin, .. } = self.tracer.scene;
        let ray = self.view.ray(x, y);
        camera_planes.iter().fold(ray, |ray, plane| plane.limited(ray, *origin))
    }
}

/// Returns the background in a row of pixels: linear colour and alpha.
fn background(job: &Job, y: u32) -> Vec4 {
    let height = (y as f32 + 0.5) / job.settings.height as f32;
    Vec4::from_array(job.tracer.scene.background.color_at(height))
}

/// Returns what is added to a row of pixels where no surface covers them: rays have found the colour of an environment.
fn added_background(job: &Job, y: u32) -> Vec4 {
    match job.tracer.scene.background {
        Background::Environment => Vec4::W,
        _ => background(job, y),
    }
}

/// The pixels of a tile: coordinates of its upper left pixel in the picture, and its size.
#[derive(Clone, Copy)]
struct TileRect {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl TileRect {
    /// Returns a row of the region's tiles, from left to right.
    fn row(row: u32, job: &Job) -> impl Iterator<Item = Self> {
        let y = job.region.rows.0 + row * TILE_SIZE;
        let (first, end) = job.region.columns;
        let height = TILE_SIZE.min(job.region.rows.1 - y);
        let rect = move |x| Self { x, y, width: TILE_SIZE.min(end - x), height };
        (first..end).step_by(TILE_SIZE as usize).map(rect)
    }

    fn n_pixels(self) -> usize {
        (self.width * self.height) as usize
    }

    /// Returns the picture coordinates of the tile's pixels in Morton order, so that the rays of a packet
    /// and the packets of a group are close to each other.
    fn pixels(self) -> impl Iterator<Item = (u32, u32)> {
        let offsets = (0..TILE_SIZE.pow(2)).map(morton_decode);
        let offsets = offsets.filter(move |&(x, y)| x < self.width && y < self.height);
        offsets.map(move |(x, y)| (self.x + x, self.y + y))
    }
}

/// A rendered tile; its pixels are in the order of `TileRect::pixels`.
struct Tile {
    rect: TileRect,
    /// Coordinates in the picture.
    pixels: Vec<(u32, u32)>,
    /// Number of samples of each pixel so far.
    n_samples: Vec<u32>,
    color: Vec<Vec4>,
    coverage: Vec<f32>,
    aovs: Vec<PixelAovs>,
    counts: RayCounts,
    trace_secs: f64,
}

/// AOVs of one pixel, from the ray through its centre.
struct PixelAovs {
    depth: f32,
    position: Vec3,
    albedo: Vec3,
    hit: SceneHit,
    support: Support,
}

impl Tile {
    fn render(job: &Job, rect: TileRect) -> Result<Self> {
        let Job { settings, .. } = *job;
        let n = rect.n_pixels();
        let mut tile = Self {
            rect,
            pixels: rect.pixels().collect(),
            n_samples: vec![0; n],
            color: vec![Vec4::ZERO; n],
            coverage: vec![0.0; n],
            aovs: Vec::new(),
            counts: RayCounts::default(),
            trace_secs: 0.0,
        };
        let mut open: Vec<usize> = (0..n).collect();
        if is_adaptive(settings, job.region) {
            let n_samples = job.region.n_samples();
            tile.add_samples(job, &open, 0..MIN_ADAPTIVE_SAMPLES / 2)?;
            for part in parts(n_samples) {
                let half: Vec<Vec4> = open.iter().map(|i| tile.mean(job, *i)).collect();
                tile.add_samples(job, &open, part.clone())?;
                if part.end < n_samples {
                    open = tile.pixels_of_noisy_blocks(job, &open, &half);
                }
            }
        } else {
            tile.add_samples(job, &open, job.region.samples.0..job.region.samples.1)?;
        }
        for i in 0..n {
            tile.color[i] = tile.mean(job, i);
            tile.coverage[i] /= tile.n_samples[i] as f32;
        }
        if settings.with_aovs && 1 < settings.samples_per_pixel {
            tile.trace_aovs(job)?;
        }
        Ok(tile)
    }

    /// Returns the mean of a pixel's samples before the background.
    fn mean(&self, job: &Job, i: usize) -> Vec4 {
        let n_samples = self.n_samples[i] as f32;
        let coverage = self.coverage[i] / n_samples;
        self.color[i] / n_samples + (1.0 - coverage) * added_background(job, self.pixels[i].1)
    }

    /// Returns those of the `open` pixels in whose block the error is above the threshold. `half` are
    /// their means when they had half as many samples.
    fn pixels_of_noisy_blocks(&self, job: &Job, open: &[usize], half: &[Vec4]) -> Vec<usize> {
        let max_error = job.settings.noise_threshold.powi(2);
        let block_of = |i: usize| block(self.pixels[i].0, self.pixels[i].1);
        let pairs: Vec<(usize, Vec4)> = open.iter().copied().zip(half.iter().copied()).collect();
        // In Morton order the pixels of a block follow each other.
        let blocks = pairs.chunk_by(|(a, _), (b, _)| block_of(*a) == block_of(*b));
        let is_noisy = |pixels: &&[(usize, Vec4)]| {
            let errors = pixels.iter().map(|(i, half)| squared_error(self.mean(job, *i), *half));
            let error = errors.sum::<f32>() / pixels.len() as f32;
            max_error < error
        };
        blocks.filter(is_noisy).flatten().map(|(i, _)| *i).collect()
    }

    /// Traces the camera rays with these sample indices of the pixels in `open` and adds up their radiance.
    fn add_samples(&mut self, job: &Job, open: &[usize], samples: Range<u32>) -> Result<()> {
        if open.is_empty() {
            return Ok(());
        }
        let per_batch = (BATCH_SIZE / open.len() as u32).clamp(1, job.region.n_samples());
        for first in samples.clone().step_by(per_batch as usize) {
            self.add_batch(job, open, first..samples.end.min(first + per_batch))?;
        }
        open.iter().for_each(|i| self.n_samples[*i] += samples.len() as u32);
        Ok(())
    }

    fn add_batch(&mut self, job: &Job, open: &[usize], samples: Range<u32>) -> Result<()> {
        let Job { tracer, settings, .. } = *job;
        let per_pixel = samples.len();
        let n = open.len() * per_pixel;
        let mut rays = Vec::with_capacity(n);
        let (mut keys, mut indices) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut backgrounds = Vec::with_capacity(n);
        for (x, y) in open.iter().map(|i| self.pixels[*i]) {
            let key = hash(settings.seed ^ hash(u64::from(y) << 32 | u64::from(x)));
            let background = background(job, y);
            for index in samples.clone() {
                let (dx, dy) = if settings.samples_per_pixel == 1 {
                    (0.5, 0.5)
                } else {
                    owen_sobol_2d(index, key)
                };
                rays.push(job.camera_ray(x as f32 + dx, y as f32 + dy));
                keys.push(key);
                indices.push(index);
                backgrounds.push(background);
            }
        }
        let start = Instant::now();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        tracer.hits(InstanceFilter::Surfaces, &rays, &mut hits)?;
        self.trace_secs += start.elapsed().as_secs_f64();
        if settings.with_aovs && settings.samples_per_pixel == 1 {
            match tracer.scene.has_gaussians {
                true => self.trace_aovs(job)?,
                false => self.set_aovs(job, &rays, &hits)?,
            }
        }
        let n_light_samples = settings.light_samples.div_ceil(settings.samples_per_pixel);
        let samples = PixelSamples {
            keys: &keys,
            indices: &indices,
            background: &backgrounds,
            n_light_samples,
        };
        let batch = CameraRayBatch { tracer, rays: &rays, hits: &hits, samples };
        let integrator = Whitted { max_depth: settings.max_depth };
        let (colors, counts) = integrator.radiance(&batch)?;
        for (sample, color) in colors.iter().enumerate() {
            let i = open[sample / per_pixel];
            self.color[i] += *color;
            self.coverage[i] += color.w;
        }
        self.counts += counts;
        Ok(())
    }

    /// Traces the rays through the pixels' centres for the AOVs.
    fn trace_aovs(&mut self, job: &Job) -> Result<()> {
        let center = |(x, y): &(u32, u32)| job.camera_ray(*x as f32 + 0.5, *y as f32 + 0.5);
        let rays: Vec<Ray> = self.pixels.iter().map(center).collect();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        let start = Instant::now();
        job.tracer.hits(InstanceFilter::All, &rays, &mut hits)?;
        self.trace_secs += start.elapsed().as_secs_f64();
        self.counts.primary += rays.len() as u64;
        self.set_aovs(job, &rays, &hits)
    }

    /// Sets the AOVs from the rays through the pixels' centres.
    fn set_aovs(&mut self, job: &Job, rays: &[Ray], hits: &[SceneHit]) -> Result<()> {
        let supports = job.tracer.supports(rays, hits)?;
        let aovs = |((ray, hit), support): ((&Ray, &SceneHit), Support)| {
            if hit.is_miss() {
                let (depth, zero) = (f32::INFINITY, Vec3::ZERO);
                return PixelAovs { depth, position: zero, albedo: zero, hit: *hit, support };
            }
            let position = ray.at(hit.distance);
            let albedo = albedo(job.tracer.scene, ray, hit);
            PixelAovs { depth: job.view.depth(position), position, albedo, hit: *hit, support }
        };
        self.aovs = rays.iter().zip(hits).zip(supports).map(aovs).collect();
        Ok(())
    }

    /// Copies the tile to its row of tiles, which has these columns of the picture.
    fn copy_to(&self, band: &mut Band, (first, end): (u32, u32)) {
        for (i, (x, y)) in self.pixels.iter().copied().enumerate() {
            let pixel = ((y - self.rect.y) * (end - first) + x - first) as usize;
            band.color[pixel] = self.color[i].to_array();
            band.coverage[pixel] = self.coverage[i];
            if let Some(aovs) = &mut band.aovs {
                let PixelAovs { depth, position, albedo, hit, support } = &self.aovs[i];
                aovs.depth[pixel] = *depth;
                aovs.position[pixel] = *position;
                aovs.normal[pixel] = hit.normal;
                aovs.point_id[pixel] = hit.id;
                aovs.instance_id[pixel] = hit.instance;
                aovs.albedo[pixel] = *albedo;
                aovs.support_count[pixel] = support.n_points;
                aovs.support_distance[pixel] = support.distance;
            }
        }
    }
}

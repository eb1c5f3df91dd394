//! Tiles of a picture: their camera rays, the sums over their samples, and their AOVs.

use super::noise::{self, HalfSums};
use super::region::RenderRegion;
use super::settings::Settings;
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::Band;
use crate::integrator::{CameraRayBatch, Integrator, PixelSamples, RayCounts, Whitted, albedo};
use crate::math::{Ray, Vec3, Vec4, hash, morton_decode, owen_sobol_2d};
use crate::scene::View;
use crate::trace::{InstanceFilter, SceneHit, Support, Tracer};
use std::ops::Range;
use std::time::Instant;

/// Side of a tile in pixels.
pub const TILE_SIZE: u32 = 32;
/// Side in pixels of a block, whose samples grow together: a contiguous range of a tile, as pixels are in Morton order.
const BLOCK_SIZE: u32 = 8;
/// Approximate number of rays in a batch: enough to fill tiles of few samples, and few enough for the
/// caches.
const BATCH_SIZE: u32 = 4096;

/// Inputs that all tiles share.
pub struct Job<'a> {
    pub tracer: &'a Tracer<'a>,
    pub view: &'a View,
    pub settings: &'a Settings,
    pub region: RenderRegion,
}

impl Job<'_> {
    /// Returns the ray through a position in the picture, as far as the scene's planes show it.
    fn camera_ray(&self, x: f32, y: f32) -> Ray {
        let FlatScene { camera_planes, origin, .. } = self.tracer.scene;
        let ray = self.view.ray(x, y);
        camera_planes.iter().fold(ray, |ray, plane| plane.limited(ray, *origin))
    }

    /// Returns the background in a row of pixels: linear colour and alpha.
    fn background(&self, y: u32) -> Vec4 {
        let height = (y as f32 + 0.5) / self.settings.height as f32;
        Vec4::from_array(self.tracer.scene.background.color_at(height))
    }

    /// Returns true if noisy blocks get more samples.
    fn is_adaptive(&self) -> bool {
        let is_whole = self.region == RenderRegion::whole(self.settings);
        is_whole && 0.0 < self.settings.noise_threshold && 1 < self.settings.samples_per_pixel
    }
}

/// The pixels of a tile: coordinates of its upper left pixel in the picture, and its size.
#[derive(Clone, Copy)]
pub struct TileRect {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl TileRect {
    /// Returns a row of the region's tiles, from left to right.
    pub fn row(row: u32, job: &Job) -> impl Iterator<Item = Self> {
        let (y, width) = (job.region.rows.0 + row * TILE_SIZE, job.settings.width);
        let height = TILE_SIZE.min(job.region.rows.1 - y);
        let rect = move |x| Self { x, y, width: TILE_SIZE.min(width - x), height };
        (0..width).step_by(TILE_SIZE as usize).map(rect)
    }

    /// Returns the number of pixels.
    pub fn n_pixels(self) -> usize {
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

/// A rendered tile.
pub struct Tile {
    rect: TileRect,
    /// In the order of `TileRect::pixels`.
    pixels: Vec<Pixel>,
    /// In the order of `pixels`.
    aovs: Vec<PixelAovs>,
    /// Numbers of rays traced.
    pub counts: RayCounts,
    /// Seconds spent in the search for the hits of camera rays.
    pub trace_secs: f64,
}

/// The samples of a pixel.
struct Pixel {
    /// Coordinates in the picture.
    position: (u32, u32),
    /// Sum of the samples' colours, premultiplied by alpha.
    sum: Vec4,
    /// The part of the sum that the first half of the samples contributed.
    sum_of_first_half: Vec4,
    n_samples: u32,
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
    /// Renders the pixels of `rect`.
    ///
    /// # Errors
    /// Fails once the work is cancelled.
    pub fn render(job: &Job, rect: TileRect) -> Result<Self> {
        let pixel = |position| Pixel {
            position,
            sum: Vec4::ZERO,
            sum_of_first_half: Vec4::ZERO,
            n_samples: 0,
        };
        let mut tile = Self {
            rect,
            pixels: rect.pixels().map(pixel).collect(),
            aovs: Vec::new(),
            counts: RayCounts::default(),
            trace_secs: 0.0,
        };
        let all: Vec<usize> = (0..tile.pixels.len()).collect();
        let (first, end) = job.region.samples;
        let half = job.settings.samples_per_pixel / 2;
        tile.add_samples(job, &all, first..end, half)?;
        if job.is_adaptive() {
            tile.refine(job)?;
        }
        if job.settings.with_aovs && 1 < job.settings.samples_per_pixel {
            tile.trace_aovs(job)?;
        }
        Ok(tile)
    }

    /// Doubles the samples of blocks until none is noisy or has the greatest number of samples.
    fn refine(&mut self, job: &Job) -> Result<()> {
        let min_samples = job.settings.samples_per_pixel;
        let (mut blocks, mut n_first, mut n_samples) =
            (self.blocks(), min_samples / 2, min_samples);
        while let Some(next) = noise::next_n_samples(n_samples, min_samples) {
            blocks.retain(|block| self.is_noisy(job, block, n_first));
            let pixels: Vec<usize> = blocks.iter().cloned().flatten().collect();
            if pixels.is_empty() {
                break;
            }
            for pixel in &pixels {
                self.pixels[*pixel].sum_of_first_half = self.pixels[*pixel].sum;
            }
            self.add_samples(job, &pixels, n_samples..next, n_samples)?;
            (n_first, n_samples) = (n_samples, next);
        }
        Ok(())
    }

    /// Returns the tile's blocks as ranges of its pixels.
    fn blocks(&self) -> Vec<Range<usize>> {
        let block = |pixel: &Pixel| (pixel.position.0 / BLOCK_SIZE, pixel.position.1 / BLOCK_SIZE);
        let sizes = self.pixels.chunk_by(|a, b| block(a) == block(b)).map(<[Pixel]>::len);
        let mut begin = 0;
        let range = |size| {
            begin += size;
            begin - size..begin
        };
        sizes.map(range).collect()
    }

    /// Returns true if a block's pixels deviate by more than the threshold, and enough to be seen; `n_first` samples are in the first half.
    fn is_noisy(&self, job: &Job, block: &Range<usize>, n_first: u32) -> bool {
        let pixels = &self.pixels[block.clone()];
        let n_samples = pixels.first().map_or(0, |pixel| pixel.n_samples);
        let halves = pixels.iter().map(|pixel| HalfSums {
            first: pixel.sum_of_first_half,
            all: pixel.sum,
            background: job.background(pixel.position.1).truncate(),
        });
        let deviation = noise::standard_deviation(halves.clone(), n_first, n_samples);
        job.settings.noise_threshold < deviation
            && noise::masked_deviation(halves, n_samples) < deviation
    }

    /// Adds samples to some of the pixels; those with indices below `end_of_half` are of the first half.
    fn add_samples(
        &mut self,
        job: &Job,
        pixels: &[usize],
        samples: Range<u32>,
        end_of_half: u32,
    ) -> Result<()> {
        let batch_size = (BATCH_SIZE / pixels.len() as u32).clamp(1, samples.len() as u32);
        for first in samples.clone().step_by(batch_size as usize) {
            let batch = first..samples.end.min(first + batch_size);
            self.add_batch(job, pixels, batch, end_of_half)?;
        }
        Ok(())
    }

    /// Traces the camera rays with these sample indices of some pixels and adds up their radiance.
    fn add_batch(
        &mut self,
        job: &Job,
        pixels: &[usize],
        sample_indices: Range<u32>,
        end_of_half: u32,
    ) -> Result<()> {
        let Job { tracer, settings, .. } = *job;
        let n = pixels.len() * sample_indices.len();
        let mut rays = Vec::with_capacity(n);
        let (mut keys, mut indices) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut backgrounds = Vec::with_capacity(n);
        for (x, y) in pixels.iter().map(|pixel| self.pixels[*pixel].position) {
            let key = hash(settings.seed ^ hash(u64::from(y) << 32 | u64::from(x)));
            let background = job.background(y);
            for index in sample_indices.clone() {
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
        tracer.hits(InstanceFilter::All, &rays, &mut hits)?;
        self.trace_secs += start.elapsed().as_secs_f64();
        if settings.with_aovs && settings.samples_per_pixel == 1 {
            self.set_aovs(job, &rays, &hits)?;
        }
        let samples = PixelSamples {
            keys: &keys,
            indices: &indices,
            background: &backgrounds,
            n_light_samples: settings.light_samples.div_ceil(settings.samples_per_pixel),
        };
        let batch = CameraRayBatch { tracer, rays: &rays, hits: &hits, samples };
        let integrator = Whitted { max_depth: settings.max_depth };
        let (colors, counts) = integrator.radiance(&batch)?;
        for (pixel, colors) in pixels.iter().zip(colors.chunks(sample_indices.len())) {
            self.pixels[*pixel].add(colors, sample_indices.clone(), end_of_half);
        }
        self.counts += counts;
        Ok(())
    }

    /// Traces the rays through the pixels' centres for the AOVs.
    fn trace_aovs(&mut self, job: &Job) -> Result<()> {
        let ray = |(x, y): (u32, u32)| job.camera_ray(x as f32 + 0.5, y as f32 + 0.5);
        let rays: Vec<Ray> = self.pixels.iter().map(|pixel| ray(pixel.position)).collect();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        job.tracer.hits(InstanceFilter::All, &rays, &mut hits)?;
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

    /// Copies the tile to its row of tiles in the picture.
    pub fn copy_to(&self, band: &mut Band, job: &Job) {
        for (i, pixel) in self.pixels.iter().enumerate() {
            let (x, y) = pixel.position;
            let idx = ((y - self.rect.y) * job.settings.width + x) as usize;
            let color = pixel.sum / pixel.n_samples as f32;
            band.color[idx] = (color + (1.0 - color.w) * job.background(y)).to_array();
            band.coverage[idx] = color.w;
            if let Some(aovs) = &mut band.aovs {
                let PixelAovs { depth, position, albedo, hit, support } = &self.aovs[i];
                aovs.depth[idx] = *depth;
                aovs.position[idx] = *position;
                aovs.normal[idx] = hit.normal;
                aovs.point_id[idx] = hit.id;
                aovs.instance_id[idx] = hit.instance;
                aovs.albedo[idx] = *albedo;
                aovs.support_count[idx] = support.n_points;
                aovs.support_distance[idx] = support.distance;
            }
        }
    }
}

impl Pixel {
    /// Adds the colours of samples with these indices; those below `end_of_half` are of the first half.
    fn add(&mut self, colors: &[Vec4], indices: Range<u32>, end_of_half: u32) {
        for (color, index) in colors.iter().zip(indices) {
            self.sum += *color;
            if index < end_of_half {
                self.sum_of_first_half += *color;
            }
        }
        self.n_samples += colors.len() as u32;
    }
}

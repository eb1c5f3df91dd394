//! The CPU renderer: it renders tiles on all threads, each tile in a few batches of rays.

use super::raster;
use super::region::RenderRegion;
use super::renderer::{RenderStats, Renderer};
use super::settings::Settings;
use super::tile::{Job, TILE_SIZE, Tile, TileRect};
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::Image;
use crate::progress::Progress;
use crate::trace::{Simd, Tracer};
use rayon::prelude::*;
use std::time::Instant;

/// A renderer that runs on the current rayon pool.
#[derive(Clone, Copy, Debug)]
pub struct CpuRenderer {
    /// The SIMD level of its kernels.
    pub simd: Simd,
}

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
            let tracer = Tracer::new(scene, self.simd, progress);
            let job = Job { tracer: &tracer, view: &view, settings, region };
            render_tiles(&job)?
        };
        stats.frame_secs = start.elapsed().as_secs_f64();
        Ok((image, stats))
    }
}

fn render_tiles(job: &Job) -> Result<(Image, RenderStats)> {
    let Job { tracer: Tracer { progress, .. }, settings, region, .. } = *job;
    progress.begin("render", u64::from(settings.width) * u64::from(region.n_rows()));
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
        tiles.iter().for_each(|tile| tile.copy_to(&mut band, job));
        Ok(tiles.iter().map(|tile| (tile.counts, tile.trace_secs)).collect::<Vec<_>>())
    });
    let mut stats = RenderStats::default();
    for (counts, trace_secs) in bands.collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        stats.rays += counts;
        stats.trace_secs += trace_secs / rayon::current_num_threads() as f64;
    }
    Ok((image, stats))
}

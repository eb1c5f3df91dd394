//! Rasterised points: one pixel per point with a z-buffer, shaded by eye-dome lighting.

use super::region::RenderRegion;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::flat::{FlatCloud, FlatGeometry, FlatScene, Instance};
use crate::image::{Image, NO_ID};
use crate::integrator::background_radiance;
use crate::math::LANES;
use crate::progress::Progress;
use crate::scene::{Background, View};
use crate::surface::SurfaceKind;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Value of an empty z-buffer pixel, greater than any depth.
const EMPTY: u64 = u64::MAX;

/// True if the surfaces of the scene are rasterised points.
///
/// # Errors
/// Fails if only some of the surfaces are: the rasterizer draws all of a scene or none of it.
pub fn uses_rasterizer(scene: &FlatScene) -> Result<bool> {
    let is_raster = |instance: &Instance| match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => cloud.surface == SurfaceKind::Points,
        FlatGeometry::Mesh(_) => false,
    };
    all_or_none(scene.instances.iter().map(is_raster))
}

/// Returns true if all surfaces are rasterised points, false if none is.
///
/// # Errors
/// Fails if only some of them are.
pub fn all_or_none(are_raster: impl Iterator<Item = bool>) -> Result<bool> {
    let (raster, traced): (Vec<bool>, Vec<bool>) = are_raster.partition(|is_raster| *is_raster);
    if !raster.is_empty() && !traced.is_empty() {
        return Err(Error::Setting {
            name: "surface",
            found: "points in a scene with traced surfaces".into(),
            expected: "points for all of the scene or for none of it",
        });
    }
    Ok(!raster.is_empty())
}

/// The nearest point in a pixel.
#[derive(Clone, Copy)]
struct VisiblePoint {
    /// Index of the instance, `NO_ID` if the pixel is empty.
    instance: u32,
    /// Slot of the point in its cloud.
    slot: u32,
}

/// A range of pixel rows, from `first` to before `end`.
#[derive(Clone, Copy)]
struct RowRange {
    width: usize,
    first: usize,
    end: usize,
}

impl RowRange {
    /// Returns the rows of a region and one row on each side, which eye-dome lighting reads.
    fn around(region: RenderRegion, settings: &Settings) -> Self {
        Self {
            width: settings.width as usize,
            first: region.rows.0.saturating_sub(1) as usize,
            end: settings.height.min(region.rows.1 + 1) as usize,
        }
    }

    fn n_pixels(self) -> usize {
        self.width * (self.end - self.first)
    }

    /// Returns the buffer index of a pixel of the picture, or `None` if it is outside of the rows.
    fn index(self, x: i64, y: i64) -> Option<usize> {
        let is_within = (0..self.width as i64).contains(&x)
            && (self.first as i64..self.end as i64).contains(&y);
        is_within.then(|| (y as usize - self.first) * self.width + x as usize)
    }
}

/// Draws the nearest point of each pixel. Ties go to the first instance and the lowest slot.
pub fn render(
    scene: &FlatScene,
    view: &View,
    settings: &Settings,
    region: RenderRegion,
    progress: &dyn Progress,
) -> Result<Image> {
    let rows = RowRange::around(region, settings);
    let n_pixels = rows.n_pixels();
    let n_blocks = |instance: &Instance| cloud(scene, instance).points.blocks.len() as u64;
    progress.begin("render", scene.instances.iter().map(n_blocks).sum());
    let z_buffer: Vec<AtomicU64> = (0..n_pixels).map(|_| AtomicU64::new(EMPTY)).collect();
    let mut depths = vec![f32::INFINITY; n_pixels];
    let mut visible = vec![VisiblePoint { instance: NO_ID, slot: 0 }; n_pixels];
    for (instance_idx, instance) in scene.instances.iter().enumerate() {
        project(scene, instance, view, rows, progress, &z_buffer)?;
        let keys = z_buffer.iter().map(|key| key.load(Ordering::Relaxed));
        for (pixel, key) in keys.enumerate().filter(|(_, key)| *key != EMPTY) {
            let depth = f32::from_bits((key >> 32) as u32);
            // Keys of earlier instances have the depth that is stored already.
            if depth < depths[pixel] {
                depths[pixel] = depth;
                visible[pixel] = VisiblePoint { instance: instance_idx as u32, slot: key as u32 };
            }
        }
    }
    Ok(Raster { rows, depths, visible }.shade(scene, view, settings, region))
}

/// Lowers each pixel of `z_buffer` to the nearest point of one instance: its depth in the upper 32 bits, its
/// slot in the lower ones.
fn project(
    scene: &FlatScene,
    instance: &Instance,
    view: &View,
    rows: RowRange,
    progress: &dyn Progress,
    z_buffer: &[AtomicU64],
) -> Result<()> {
    let blocks = &cloud(scene, instance).points.blocks;
    blocks.par_iter().enumerate().with_min_len(1024).try_for_each(|(block_idx, block)| {
        if block_idx % 1024 == 0 {
            progress.check()?;
            progress.advance(1024);
        }
        let occupied = block.occupied_lanes();
        for lane in (0..LANES).filter(|lane| occupied >> lane & 1 == 1) {
            let position = instance.world_position(block.position(lane));
            let Some((x, y, depth)) = view.project(position) else { continue };
            let Some(pixel) = rows.index(x.floor() as i64, y.floor() as i64) else { continue };
            // Positive floats order as their bits do.
            let slot = (block_idx * LANES + lane) as u64;
            let key = u64::from(depth.to_bits()) << 32 | slot;
            z_buffer[pixel].fetch_min(key, Ordering::Relaxed);
        }
        Ok(())
    })
}

fn cloud<'s>(scene: &'s FlatScene, instance: &Instance) -> &'s FlatCloud {
    match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => cloud,
        FlatGeometry::Mesh(_) => unreachable!("`uses_rasterizer` admits clouds only"),
    }
}

/// The nearest points of some rows of a picture.
struct Raster {
    rows: RowRange,
    depths: Vec<f32>,
    visible: Vec<VisiblePoint>,
}

impl Raster {
    fn shade(
        &self,
        scene: &FlatScene,
        view: &View,
        settings: &Settings,
        region: RenderRegion,
    ) -> Image {
        let mut image = region.blank_image(settings);
        let (first, end) = region.rows;
        let pixels = (first..end).flat_map(|y| (0..settings.width).map(move |x| (x, y)));
        for (pixel, (x, y)) in pixels.enumerate() {
            let Some(index) = self.rows.index(i64::from(x), i64::from(y)) else { continue };
            let VisiblePoint { instance: instance_idx, slot } = self.visible[index];
            if instance_idx == NO_ID {
                let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
                image.color[pixel] = match scene.background {
                    Background::Environment => {
                        let direction = view.ray(x, y).direction;
                        background_radiance(scene, direction, false).extend(1.0).to_array()
                    }
                    background => background.color_at(y / settings.height as f32),
                };
                continue;
            }
            let instance = &scene.instances[instance_idx as usize];
            let points = &cloud(scene, instance).points;
            let material = &scene.materials[instance.material_idx as usize];
            let albedo = material.base_color * points.surfel(slot).color;
            let shade = if material.is_unlit { 1.0 } else { self.eye_dome((x, y), index) };
            image.color[pixel] = (shade * albedo).extend(1.0).to_array();
            image.coverage[pixel] = 1.0;
            let Some(aovs) = &mut image.aovs else { continue };
            aovs.depth[pixel] = self.depths[index];
            aovs.position[pixel] = instance.world_position(points.center(slot));
            aovs.point_id[pixel] = points.id(slot);
            aovs.instance_id[pixel] = instance_idx;
            aovs.albedo[pixel] = albedo;
        }
        image
    }

    /// Returns the eye-dome lighting of a pixel (Boucheny 2009): the farther it lies behind its neighbours,
    /// the darker it is.
    fn eye_dome(&self, (x, y): (u32, u32), index: usize) -> f32 {
        const STRENGTH: f32 = 300.0 * 0.4;
        let log_depth = self.depths[index].log2();
        let ring = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        let neighbors = ring.map(|(dx, dy)| self.rows.index(i64::from(x) + dx, i64::from(y) + dy));
        // An empty neighbour is infinitely far away and does not darken.
        let darkening = |neighbor: usize| (log_depth - self.depths[neighbor].log2()).max(0.0);
        let sum: f32 = neighbors.into_iter().flatten().map(darkening).sum();
        (-STRENGTH * sum / 8.0).exp()
    }
}

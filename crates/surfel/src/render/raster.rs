//! Points as single pixels with a z-buffer, shaded by eye-dome lighting.

use super::Settings;
use crate::error::Result;
use crate::flat::FlatScene;
use crate::image::{Image, decode_srgb8};
use crate::math::{LANES, Vec3};
use crate::progress::Progress;
use crate::scene::{Material, View};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Holds no point: farther than any.
const EMPTY: u64 = u64::MAX;

/// The nearest point of each pixel; of equally near ones that of the lowest slot.
pub fn render(
    scene: &FlatScene,
    view: &View,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Image> {
    let (width, height) = (settings.width as usize, settings.height as usize);
    progress.begin("render", scene.points.blocks.len() as u64);
    let nearest: Vec<AtomicU64> = (0..width * height).map(|_| AtomicU64::new(EMPTY)).collect();
    scene.points.blocks.par_iter().enumerate().with_min_len(1024).try_for_each(
        |(block_idx, block)| {
            if block_idx % 1024 == 0 {
                progress.check()?;
                progress.advance(1024);
            }
            let occupied = block.occupied();
            for lane in (0..LANES).filter(|lane| occupied >> lane & 1 == 1) {
                let Some((x, y, depth)) = view.project(block.position(lane)) else { continue };
                if (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y) {
                    // The bits of positive floats are ordered as the floats are.
                    let slot = (block_idx * LANES + lane) as u64;
                    let key = u64::from(depth.to_bits()) << 32 | slot;
                    nearest[y as usize * width + x as usize].fetch_min(key, Ordering::Relaxed);
                }
            }
            Ok(())
        },
    )?;
    let nearest: Vec<u64> = nearest.into_iter().map(AtomicU64::into_inner).collect();
    Ok(shade(scene, settings, &nearest))
}

fn shade(scene: &FlatScene, settings: &Settings, nearest: &[u64]) -> Image {
    let mut image = settings.blank();
    let width = settings.width as usize;
    for (pixel, &key) in nearest.iter().enumerate() {
        let (x, y) = (pixel % width, pixel / width);
        if key == EMPTY {
            image.color[pixel] = scene.background.at((y as f32 + 0.5) / settings.height as f32);
            continue;
        }
        let slot = key as u32;
        let (block, lane) = (&scene.points.blocks[slot as usize / LANES], slot as usize % LANES);
        let albedo = Vec3::from_array(block.color(lane).map(decode_srgb8));
        let lit = scene.material != Material::UNLIT;
        let shade = if lit { eye_dome(nearest, settings, x, y) } else { 1.0 };
        image.color[pixel] = (shade * albedo).extend(1.0).to_array();
        image.coverage[pixel] = 1.0;
        let Some(layers) = &mut image.layers else { continue };
        layers.depth[pixel] = depth(key);
        layers.position[pixel] = block.position(lane);
        layers.point_id[pixel] = scene.points.id(slot);
        layers.instance_id[pixel] = 0;
        layers.albedo[pixel] = albedo;
    }
    image
}

fn depth(key: u64) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

/// Eye-dome lighting (Boucheny 2009): darker the farther a pixel lies behind its neighbours.
fn eye_dome(nearest: &[u64], settings: &Settings, x: usize, y: usize) -> f32 {
    const STRENGTH: f32 = 300.0 * 0.4;
    let (width, height) = (settings.width as i64, settings.height as i64);
    let own = depth(nearest[y * width as usize + x]).log2();
    let ring = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    let mut sum = 0.0;
    for (dx, dy) in ring {
        let (x, y) = (x as i64 + dx, y as i64 + dy);
        if (0..width).contains(&x) && (0..height).contains(&y) {
            let key = nearest[(y * width + x) as usize];
            if key != EMPTY {
                sum += (own - depth(key).log2()).max(0.0);
            }
        }
    }
    (-STRENGTH * sum / 8.0).exp()
}

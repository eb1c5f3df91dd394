//! Points as single pixels with a z-buffer, shaded by eye-dome lighting.

use super::Settings;
use crate::error::{Error, Result};
use crate::flat::{FlatCloud, FlatGeometry, FlatScene, Instance};
use crate::image::{Image, NO_ID};
use crate::integrator::surroundings;
use crate::math::LANES;
use crate::progress::Progress;
use crate::scene::{Background, View};
use crate::surface::SurfaceKind;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Holds no point: farther than any.
const EMPTY: u64 = u64::MAX;

/// Whether a scene is one of points as pixels. An error if only some of it is: there is one way for all.
pub fn is_asked_for(scene: &FlatScene) -> Result<bool> {
    let is_raster = |instance: &Instance| match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => cloud.surface == SurfaceKind::Points,
        FlatGeometry::Mesh(_) => false,
    };
    let n = scene.instances.iter().filter(|instance| is_raster(instance)).count();
    if n != 0 && n != scene.instances.len() {
        return Err(Error::Setting {
            name: "surface",
            found: "points beside surfaces that are traced".into(),
            expected: "points for all of the scene or for none of it",
        });
    }
    Ok(n != 0)
}

/// A point in a pixel.
#[derive(Clone, Copy)]
struct Seen {
    instance: u32,
    slot: u32,
}

/// The nearest point of each pixel; of equally near ones that of the first instance and lowest slot.
pub fn render(
    scene: &FlatScene,
    view: &View,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Image> {
    let n_pixels = settings.width as usize * settings.height as usize;
    let blocks = |instance: &Instance| cloud(scene, instance).points.blocks.len() as u64;
    progress.begin("render", scene.instances.iter().map(blocks).sum());
    let nearest: Vec<AtomicU64> = (0..n_pixels).map(|_| AtomicU64::new(EMPTY)).collect();
    let mut depths = vec![f32::INFINITY; n_pixels];
    let mut seen = vec![Seen { instance: NO_ID, slot: 0 }; n_pixels];
    for (instance_idx, instance) in scene.instances.iter().enumerate() {
        project(scene, instance, view, settings, progress, &nearest)?;
        let keys = nearest.iter().map(|nearest| nearest.load(Ordering::Relaxed));
        for (pixel, key) in keys.enumerate().filter(|(_, key)| *key != EMPTY) {
            let depth = f32::from_bits((key >> 32) as u32);
            // Those of instances before are no nearer than themselves.
            if depth < depths[pixel] {
                depths[pixel] = depth;
                seen[pixel] = Seen { instance: instance_idx as u32, slot: key as u32 };
            }
        }
    }
    Ok(shade(scene, view, settings, &depths, &seen))
}

/// Lowers `nearest` to depth and slot, as one number, of the nearest point of one instance in each pixel.
fn project(
    scene: &FlatScene,
    instance: &Instance,
    view: &View,
    settings: &Settings,
    progress: &dyn Progress,
    nearest: &[AtomicU64],
) -> Result<()> {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let blocks = &cloud(scene, instance).points.blocks;
    blocks.par_iter().enumerate().with_min_len(1024).try_for_each(|(block_idx, block)| {
        if block_idx % 1024 == 0 {
            progress.check()?;
            progress.advance(1024);
        }
        let occupied = block.occupied();
        for lane in (0..LANES).filter(|lane| occupied >> lane & 1 == 1) {
            let position = instance.world_position(block.position(lane));
            let Some((x, y, depth)) = view.project(position) else { continue };
            if (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y) {
                // The bits of positive floats are ordered as the floats are.
                let slot = (block_idx * LANES + lane) as u64;
                let key = u64::from(depth.to_bits()) << 32 | slot;
                nearest[y as usize * width + x as usize].fetch_min(key, Ordering::Relaxed);
            }
        }
        Ok(())
    })
}

fn cloud<'s>(scene: &'s FlatScene, instance: &Instance) -> &'s FlatCloud {
    match scene.geometry(instance) {
        FlatGeometry::Cloud(cloud) => cloud,
        FlatGeometry::Mesh(_) => unreachable!("asked for by `is_asked_for`"),
    }
}

fn shade(
    scene: &FlatScene,
    view: &View,
    settings: &Settings,
    depths: &[f32],
    seen: &[Seen],
) -> Image {
    let mut image = settings.blank();
    let width = settings.width as usize;
    for (pixel, Seen { instance, slot }) in seen.iter().enumerate() {
        let (x, y) = (pixel % width, pixel / width);
        if *instance == NO_ID {
            let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
            image.color[pixel] = match scene.background {
                Background::Surroundings => {
                    surroundings(scene, view.ray(x, y).direction, false).extend(1.0).to_array()
                }
                plain => plain.at(y / settings.height as f32),
            };
            continue;
        }
        let placed = &scene.instances[*instance as usize];
        let points = &cloud(scene, placed).points;
        let material = &scene.materials[placed.material as usize];
        let albedo = material.base_color * points.gathered(*slot).color;
        let shade = if material.is_unlit { 1.0 } else { eye_dome(depths, settings, x, y) };
        image.color[pixel] = (shade * albedo).extend(1.0).to_array();
        image.coverage[pixel] = 1.0;
        let Some(layers) = &mut image.layers else { continue };
        layers.depth[pixel] = depths[pixel];
        layers.position[pixel] = placed.world_position(points.center(*slot));
        layers.point_id[pixel] = points.id(*slot);
        layers.instance_id[pixel] = *instance;
        layers.albedo[pixel] = albedo;
    }
    image
}

/// Eye-dome lighting (Boucheny 2009): darker the farther a pixel lies behind its neighbours.
fn eye_dome(depths: &[f32], settings: &Settings, x: usize, y: usize) -> f32 {
    const STRENGTH: f32 = 300.0 * 0.4;
    let (width, height) = (settings.width as i64, settings.height as i64);
    let own = depths[y * width as usize + x].log2();
    let ring = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
    let mut sum = 0.0;
    for (dx, dy) in ring {
        let (x, y) = (x as i64 + dx, y as i64 + dy);
        if (0..width).contains(&x) && (0..height).contains(&y) {
            // Farther than all where there is nothing.
            sum += (own - depths[(y * width + x) as usize].log2()).max(0.0);
        }
    }
    (-STRENGTH * sum / 8.0).exp()
}

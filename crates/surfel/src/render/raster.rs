//! Points as single pixels with a z-buffer, shaded by eye-dome lighting.

use super::{Piece, Settings};
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

/// Rows of a picture, from `first` to before `end`.
#[derive(Clone, Copy)]
struct Rows {
    width: usize,
    first: usize,
    end: usize,
}

impl Rows {
    /// Those of a piece and those beside it, which shade it.
    fn around(piece: Piece, settings: &Settings) -> Self {
        Self {
            width: settings.width as usize,
            first: piece.rows.0.saturating_sub(1) as usize,
            end: settings.height.min(piece.rows.1 + 1) as usize,
        }
    }

    fn n_pixels(self) -> usize {
        self.width * (self.end - self.first)
    }

    /// Where a pixel of the picture is kept, if it is.
    fn index(self, x: i64, y: i64) -> Option<usize> {
        let is_in = (0..self.width as i64).contains(&x)
            && (self.first as i64..self.end as i64).contains(&y);
        is_in.then(|| (y as usize - self.first) * self.width + x as usize)
    }
}

/// The nearest point of each pixel; of equally near ones that of the first instance and lowest slot.
pub fn render(
    scene: &FlatScene,
    view: &View,
    settings: &Settings,
    piece: Piece,
    progress: &dyn Progress,
) -> Result<Image> {
    let rows = Rows::around(piece, settings);
    let n_pixels = rows.n_pixels();
    let blocks = |instance: &Instance| cloud(scene, instance).points.blocks.len() as u64;
    progress.begin("render", scene.instances.iter().map(blocks).sum());
    let nearest: Vec<AtomicU64> = (0..n_pixels).map(|_| AtomicU64::new(EMPTY)).collect();
    let mut depths = vec![f32::INFINITY; n_pixels];
    let mut seen = vec![Seen { instance: NO_ID, slot: 0 }; n_pixels];
    for (instance_idx, instance) in scene.instances.iter().enumerate() {
        project(scene, instance, view, rows, progress, &nearest)?;
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
    Ok(Raster { rows, depths, seen }.shade(scene, view, settings, piece))
}

/// Lowers `nearest` to depth and slot, as one number, of the nearest point of one instance in each pixel.
fn project(
    scene: &FlatScene,
    instance: &Instance,
    view: &View,
    rows: Rows,
    progress: &dyn Progress,
    nearest: &[AtomicU64],
) -> Result<()> {
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
            let Some(pixel) = rows.index(x.floor() as i64, y.floor() as i64) else { continue };
            // The bits of positive floats are ordered as the floats are.
            let slot = (block_idx * LANES + lane) as u64;
            let key = u64::from(depth.to_bits()) << 32 | slot;
            nearest[pixel].fetch_min(key, Ordering::Relaxed);
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

/// The nearest points of some rows of a picture.
struct Raster {
    rows: Rows,
    depths: Vec<f32>,
    seen: Vec<Seen>,
}

impl Raster {
    fn shade(&self, scene: &FlatScene, view: &View, settings: &Settings, piece: Piece) -> Image {
        let mut image = settings.blank(piece);
        let (first, end) = piece.rows;
        let places = (first..end).flat_map(|y| (0..settings.width).map(move |x| (x, y)));
        for (pixel, (x, y)) in places.enumerate() {
            let Some(place) = self.rows.index(i64::from(x), i64::from(y)) else { continue };
            let Seen { instance, slot } = self.seen[place];
            if instance == NO_ID {
                let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
                image.color[pixel] = match scene.background {
                    Background::Surroundings => {
                        surroundings(scene, view.ray(x, y).direction, false).extend(1.0).to_array()
                    }
                    plain => plain.at(y / settings.height as f32),
                };
                continue;
            }
            let placed = &scene.instances[instance as usize];
            let points = &cloud(scene, placed).points;
            let material = &scene.materials[placed.material as usize];
            let albedo = material.base_color * points.gathered(slot).color;
            let shade = if material.is_unlit { 1.0 } else { self.eye_dome((x, y), place) };
            image.color[pixel] = (shade * albedo).extend(1.0).to_array();
            image.coverage[pixel] = 1.0;
            let Some(layers) = &mut image.layers else { continue };
            layers.depth[pixel] = self.depths[place];
            layers.position[pixel] = placed.world_position(points.center(slot));
            layers.point_id[pixel] = points.id(slot);
            layers.instance_id[pixel] = instance;
            layers.albedo[pixel] = albedo;
        }
        image
    }

    /// Eye-dome lighting (Boucheny 2009): darker the farther a pixel lies behind its neighbours.
    fn eye_dome(&self, (x, y): (u32, u32), place: usize) -> f32 {
        const STRENGTH: f32 = 300.0 * 0.4;
        let own = self.depths[place].log2();
        let ring = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        let beside = ring.map(|(dx, dy)| self.rows.index(i64::from(x) + dx, i64::from(y) + dy));
        // Farther than all where there is nothing.
        let behind = |beside: usize| (own - self.depths[beside].log2()).max(0.0);
        let sum: f32 = beside.into_iter().flatten().map(behind).sum();
        (-STRENGTH * sum / 8.0).exp()
    }
}

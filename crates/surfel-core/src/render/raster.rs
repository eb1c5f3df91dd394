//! Rasterised points: round and of one size in pixels, with a z-buffer, lit by their normals or shaded by eye-dome lighting.

use super::footprint::RowRange;
use super::point_light::{LitPoint, has_lights};
use super::region::RenderRegion;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::flat::{FlatCloud, FlatGeometry, FlatScene, Instance};
use crate::image::{Band, Image, NO_ID};
use crate::integrator::background_radiance;
use crate::math::{LANES, Vec3};
use crate::progress::Progress;
use crate::scene::{Background, View};
use crate::surface::SurfaceKind;
use crate::trace::Support;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Value of an empty z-buffer pixel, greater than any depth.
const EMPTY: u64 = u64::MAX;

/// True if the surfaces of the scene are rasterised points.
///
/// # Errors
///
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
///
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

/// Returns the rows of a region and those around it that eye-dome lighting reads.
fn rows_around(region: RenderRegion, view: &View, settings: &Settings) -> RowRange {
    let margin = EyeDome::new(settings.point_size).step;
    RowRange {
        width: settings.width as usize,
        first: region.rows.0.saturating_sub(margin) as usize,
        end: settings.height.min(region.rows.1 + margin) as usize,
        wraps: view.is_panorama(),
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
    let rows = rows_around(region, view, settings);
    let n_blocks = |instance: &Instance| cloud(scene, instance).points.blocks.len() as u64;
    progress.begin("render", scene.instances.iter().map(n_blocks).sum());
    let z_buffer: Vec<AtomicU64> = (0..rows.n_pixels()).map(|_| AtomicU64::new(EMPTY)).collect();
    let mut raster = Raster::new(scene, view, settings, rows);
    for (instance_idx, instance) in scene.instances.iter().enumerate() {
        let target = Target { rows, radius: settings.point_size / 2.0, z_buffer: &z_buffer };
        project(scene, instance, view, progress, target)?;
        raster.add_instance(instance_idx as u32, &z_buffer, progress)?;
    }
    raster.shade(settings, region, progress)
}

/// The buffer that points are drawn to.
#[derive(Clone, Copy)]
struct Target<'b> {
    rows: RowRange,
    /// Radius of the points in pixels.
    radius: f32,
    /// The nearest point of each pixel: its depth in the upper 32 bits, its slot in the lower ones.
    z_buffer: &'b [AtomicU64],
}

/// Draws the points of one instance. All pixels of a point have its depth.
fn project(
    scene: &FlatScene,
    instance: &Instance,
    view: &View,
    progress: &dyn Progress,
    target: Target,
) -> Result<()> {
    let Target { rows, radius, z_buffer } = target;
    let blocks = &cloud(scene, instance).points.blocks;
    blocks.par_iter().enumerate().with_min_len(1024).try_for_each(|(block_idx, block)| {
        if block_idx % 1024 == 0 {
            progress.check()?;
            progress.advance(1024);
        }
        let occupied = block.occupied_lanes();
        for lane in (0..LANES).filter(|lane| occupied >> lane & 1 == 1) {
            let position = instance.world_position(block.position(lane));
            let world = scene.origin + position.as_dvec3();
            let is_hidden = scene.camera_planes.iter().any(|plane| plane.hides(world));
            let Some((x, y, depth)) = view.project(position).filter(|_| !is_hidden) else {
                continue;
            };
            // Positive floats order as their bits do.
            let slot = (block_idx * LANES + lane) as u64;
            let key = u64::from(depth.to_bits()) << 32 | slot;
            rows.for_each_covered((x, y), radius, |pixel| {
                // Most pixels of large points are covered by nearer ones, and reading is cheaper than exchanging.
                if key < z_buffer[pixel].load(Ordering::Relaxed) {
                    z_buffer[pixel].fetch_min(key, Ordering::Relaxed);
                }
            });
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
struct Raster<'s> {
    scene: &'s FlatScene,
    view: &'s View,
    rows: RowRange,
    depths: Vec<f32>,
    visible: Vec<VisiblePoint>,
    eye_dome: EyeDome,
}

impl<'s> Raster<'s> {
    /// Creates empty rows.
    fn new(scene: &'s FlatScene, view: &'s View, settings: &Settings, rows: RowRange) -> Self {
        let n_pixels = rows.n_pixels();
        Self {
            scene,
            view,
            rows,
            depths: vec![f32::INFINITY; n_pixels],
            visible: vec![VisiblePoint { instance: NO_ID, slot: 0 }; n_pixels],
            eye_dome: EyeDome::new(settings.point_size),
        }
    }

    /// Adds the points in the z-buffer that are nearer than those of earlier instances.
    fn add_instance(
        &mut self,
        instance: u32,
        z_buffer: &[AtomicU64],
        progress: &dyn Progress,
    ) -> Result<()> {
        let width = self.rows.width;
        let rows = self.depths.par_chunks_mut(width).zip(self.visible.par_chunks_mut(width));
        rows.zip(z_buffer.par_chunks(width)).try_for_each(|((depths, visible), keys)| {
            progress.check()?;
            for ((depth, visible), key) in depths.iter_mut().zip(visible).zip(keys) {
                let key = key.load(Ordering::Relaxed);
                let own_depth = f32::from_bits((key >> 32) as u32);
                // Keys of earlier instances have the depth that is stored already.
                if key != EMPTY && own_depth < *depth {
                    *depth = own_depth;
                    *visible = VisiblePoint { instance, slot: key as u32 };
                }
            }
            Ok(())
        })
    }

    /// Returns the picture of a region of the rows.
    fn shade(
        &self,
        settings: &Settings,
        region: RenderRegion,
        progress: &dyn Progress,
    ) -> Result<Image> {
        let mut image = region.blank_image(settings);
        let bands: Vec<_> = image.bands_mut(1).into_iter().zip(region.rows.0..).collect();
        bands.into_par_iter().try_for_each(|(mut band, y)| -> Result<()> {
            progress.check()?;
            for (pixel, x) in (region.columns.0..region.columns.1).enumerate() {
                let Some(index) = self.rows.index(i64::from(x), i64::from(y)) else { continue };
                match self.visible[index] {
                    VisiblePoint { instance: NO_ID, .. } => {
                        band.color[pixel] = self.background((x, y), settings.height);
                    }
                    visible => self.shade_point(visible, (x, y), index, (&mut band, pixel)),
                }
            }
            Ok(())
        })?;
        Ok(image)
    }

    /// Returns linear colour and alpha of a pixel without points.
    fn background(&self, (x, y): (u32, u32), height: u32) -> [f32; 4] {
        let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
        match self.scene.background {
            Background::Environment => {
                let direction = self.view.ray(x, y).direction;
                background_radiance(self.scene, direction, false).extend(1.0).to_array()
            }
            background => background.color_at(y / height as f32),
        }
    }

    /// Writes the visible point at `(x, y)` of the picture, the pixel `index` of the rows, to a pixel of a band.
    fn shade_point(
        &self,
        visible: VisiblePoint,
        (x, y): (u32, u32),
        index: usize,
        (band, pixel): (&mut Band, usize),
    ) {
        let Self { scene, view, .. } = *self;
        let VisiblePoint { instance: instance_idx, slot } = visible;
        let instance = &scene.instances[instance_idx as usize];
        let cloud = cloud(scene, instance);
        let points = &cloud.points;
        let material = &scene.materials[instance.material_idx as usize];
        let albedo = material.color_over(points.surfel(slot).color);
        let emission = match material.is_unlit {
            true => Vec3::ZERO,
            false => material.emissive + material.emissive_strength * albedo,
        };
        let lit = cloud.has_normals.then(|| {
            let normal = instance.world_normal(points.normal(slot));
            let to_viewer = -view.ray(x as f32 + 0.5, y as f32 + 0.5).direction;
            LitPoint::new(instance.world_position(points.center(slot)), normal, to_viewer)
        });
        let light = match &lit {
            _ if material.is_unlit => Vec3::ONE,
            Some(point) if has_lights(scene) => {
                point.reflected(&scene.lights, &scene.punctual_lights)
            }
            _ => Vec3::splat(self.eye_dome((x, y), index)),
        };
        band.color[pixel] = (light * albedo + emission).extend(1.0).to_array();
        band.coverage[pixel] = 1.0;
        let Some(aovs) = &mut band.aovs else { return };
        aovs.depth[pixel] = self.depths[index];
        aovs.position[pixel] = instance.world_position(points.center(slot));
        aovs.normal[pixel] = lit.map_or(Vec3::ZERO, |point| point.normal);
        aovs.point_id[pixel] = points.id(slot);
        aovs.instance_id[pixel] = instance_idx;
        aovs.albedo[pixel] = albedo;
        aovs.support_count[pixel] = Support::POINT.n_points;
        aovs.support_distance[pixel] = Support::POINT.distance;
    }

    /// Returns the light of a pixel, from 0 to 1.
    fn eye_dome(&self, (x, y): (u32, u32), index: usize) -> f32 {
        let step = i64::from(self.eye_dome.step);
        let ring = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        let neighbors = ring
            .map(|(dx, dy)| self.rows.index(i64::from(x) + step * dx, i64::from(y) + step * dy));
        let depths = neighbors.into_iter().flatten().map(|neighbor| self.depths[neighbor]);
        self.eye_dome.light(self.depths[index], depths)
    }
}

/// Eye-dome lighting (Boucheny 2009): the farther a pixel lies behind its neighbours, the darker it is.
///
/// The darkening by each neighbour is bounded. Without a bound, a single near point blackened all that showed beside it
/// through a thin cloud, and the far side of such a cloud was full of black pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct EyeDome {
    /// Distance of the neighbours in pixels, so that they belong to other points.
    step: u32,
}

impl EyeDome {
    /// Darkening for a difference of 1 of the logarithms of two depths, one pixel apart.
    const STRENGTH: f32 = 300.0 * 0.4;
    /// Darkening by neighbours that are all far nearer.
    const MAX_DARKENING: f32 = 2.0;

    fn new(point_size: f32) -> Self {
        Self { step: (point_size / 2.0).round().max(1.0) as u32 }
    }

    /// Returns the light of a pixel at `depth` with up to eight neighbours. An empty neighbour is infinitely far away and
    /// does not darken.
    fn light(self, depth: f32, neighbors: impl Iterator<Item = f32>) -> f32 {
        let (log_depth, per_step) = (depth.log2(), Self::STRENGTH / self.step as f32);
        let darkening = |neighbor: f32| {
            let difference = per_step * (log_depth - neighbor.log2()).max(0.0);
            difference / (1.0 + difference / Self::MAX_DARKENING)
        };
        let sum: f32 = neighbors.map(darkening).sum();
        (-sum / 8.0).exp()
    }
}

#[cfg(test)]
mod tests {
    //! Eye-dome lighting shows forms, and leaves the points of thin clouds their colours.

    use super::*;

    fn light(depth: f32, neighbors: [f32; 8]) -> f32 {
        EyeDome::new(1.0).light(depth, neighbors.into_iter())
    }

    #[test]
    fn empty_and_farther_neighbors_do_not_darken() {
        assert_eq!(light(5.0, [f32::INFINITY; 8]), 1.0);
        assert_eq!(light(5.0, [5.0, 6.0, 7.0, 50.0, f32::INFINITY, 5.0, 5.0, 1e9]), 1.0);
        assert_eq!(EyeDome::new(1.0).light(5.0, std::iter::empty()), 1.0);
    }

    #[test]
    fn one_near_neighbor_shades_and_all_darken() {
        let mut neighbors = [f32::INFINITY; 8];
        neighbors[3] = 0.1;
        let beside_one = light(5.0, neighbors);
        assert!((0.75..0.85).contains(&beside_one), "{beside_one}");
        let enclosed = light(5.0, [0.1; 8]);
        assert!((0.1..0.2).contains(&enclosed), "{enclosed}");
    }

    #[test]
    fn small_steps_darken_in_proportion() {
        // A step of a thousandth of the depth at half of the neighbours.
        let mut neighbors = [5.0; 8];
        neighbors[..4].fill(5.0 / 1.001);
        let expected = (-EyeDome::STRENGTH * 1.001f32.log2() / 2.0).exp();
        assert!((light(5.0, neighbors) - expected).abs() < 0.01);
    }

    #[test]
    fn slopes_are_shaded_alike_at_all_sizes() {
        // A slope that rises by a ten-thousandth of the depth a pixel.
        let of_size = |size: f32| {
            let eye_dome = EyeDome::new(size);
            let rise = 1.0 + 1e-4 * eye_dome.step as f32;
            let ring = [rise, 1.0 / rise, 1.0, 1.0, rise, rise, 1.0 / rise, 1.0 / rise];
            eye_dome.light(5.0, ring.into_iter().map(|factor| 5.0 * factor))
        };
        for size in [2.0, 4.0, 9.0, 30.0] {
            assert!((of_size(size) - of_size(1.0)).abs() < 1e-3, "{size}");
        }
    }
}

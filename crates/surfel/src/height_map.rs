//! Elevations of a plan: where the ray through the centre of each pixel meets a surface.

use crate::built_scene::BuiltScene;
use crate::error::Result;
use crate::live_view::LiveView;
use crate::resolve::height_map_place;
use rayon::prelude::*;
use surfel_core::flat::FlatScene;
use surfel_core::math::Ray;
use surfel_core::progress::Progress;
use surfel_core::render::Settings;
use surfel_core::trace::{InstanceFilter, SceneHit, Simd, scene_hits};
use surfel_formats::{Georeference, HeightMap};

impl BuiltScene {
    /// Finds the elevation at the centre of each pixel, in world coordinates.
    ///
    /// # Errors
    ///
    /// Fails unless the scene has a surface and the camera looks straight down without perspective, and if cancelled.
    pub fn height_map(&self, progress: &dyn Progress) -> Result<HeightMap> {
        let place = height_map_place(self.description(), self.georeference())?;
        height_map(self.flat(), &self.settings, place, self.simd(), progress)
    }
}

impl LiveView {
    /// Finds the elevation at the centre of each pixel, in world coordinates.
    ///
    /// # Errors
    ///
    /// Fails unless the scene has a surface and the camera looks straight down without perspective, and if cancelled.
    pub fn height_map(&self, simd: Simd, progress: &dyn Progress) -> Result<HeightMap> {
        let place = height_map_place(&self.description, self.georeference())?;
        height_map(&self.flat, &self.settings, place, simd, progress)
    }
}

fn height_map(
    flat: &FlatScene,
    settings: &Settings,
    georeference: Georeference,
    simd: Simd,
    progress: &dyn Progress,
) -> Result<HeightMap> {
    let Settings { width, height, .. } = *settings;
    let view = flat.camera.view(flat.origin, width, height);
    progress.begin("height map", height.into());
    let row = |y: u32| -> Result<Vec<f32>> {
        let ray = |x: u32| {
            let ray = view.ray(x as f32 + 0.5, y as f32 + 0.5);
            flat.camera_planes.iter().fold(ray, |ray, plane| plane.limited(ray, flat.origin))
        };
        let rays: Vec<Ray> = (0..width).map(ray).collect();
        let mut hits = vec![SceneHit::MISS; rays.len()];
        progress.check()?;
        scene_hits(flat, simd, InstanceFilter::All, &rays, &mut hits);
        progress.advance(1);
        let elevation = |(hit, ray): (&SceneHit, &Ray)| match hit.is_miss() {
            true => f32::NAN,
            false => (flat.origin.z + f64::from(ray.at(hit.distance).z)) as f32,
        };
        Ok(hits.iter().zip(&rays).map(elevation).collect())
    };
    let rows: Vec<Vec<f32>> = (0..height).into_par_iter().map(row).collect::<Result<_>>()?;
    progress.end();
    Ok(HeightMap { width, height, elevations: rows.concat(), georeference })
}

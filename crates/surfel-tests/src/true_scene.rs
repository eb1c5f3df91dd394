//! The pictures of a scene of signed distance fields, by sphere tracing.

use crate::picture_difference::{
    ALBEDO, HEADLIGHT, SUN, grey_scene, sun_and_headlight, toward_sun,
};
use rayon::prelude::*;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{Camera, Geometry, Projection};
use surfel_core::trace::Simd;
use surfel_scanner::scenes::{NamedScene, SceneView};
use surfel_scanner::{DRay, Instrument};

/// The surface that one pixel of a scene shows, and whether an instrument measured it.
#[derive(Clone, Copy, Debug)]
pub struct TruePixel {
    /// Index into the scene's kinds of objects.
    pub kind_idx: usize,
    /// Depth along the view axis in metres.
    pub depth: f64,
    /// Unit normal, facing the camera.
    pub normal: Vec3,
    /// True if a viewpoint of the instrument sees this part of the surface.
    pub is_scanned: bool,
    /// Linear radiance of the grey scene in the light of the sun and of the camera.
    pub radiance: f32,
}

/// The pixels of all views of a scene.
pub struct TrueScene {
    views: Vec<(SceneView, Vec<Option<TruePixel>>)>,
    kinds: Vec<&'static str>,
    resolution: u32,
}

impl TrueScene {
    /// Traces all views of a scene, each `resolution` pixels wide and high, and asks for each pixel whether
    /// `instrument` sees it.
    pub fn new(scene: &NamedScene, instrument: &dyn Instrument, resolution: u32) -> Self {
        let kinds = scene.object_kinds();
        let true_view = |view: &SceneView| {
            let rays = pixel_rays(view, resolution);
            let toward = (view.focal_point - view.position).normalize();
            let pixel = |ray: &Ray| true_pixel(scene, &kinds, instrument, ray, view, toward);
            (*view, rays.par_iter().map(pixel).collect())
        };
        let views = scene.views.iter().map(true_view).collect();
        Self { views, kinds, resolution }
    }

    /// Returns the kinds of objects.
    pub fn kinds(&self) -> &[&'static str] {
        &self.kinds
    }

    /// Returns the pixels of each view, row by row from the top.
    pub fn views(&self) -> impl Iterator<Item = &[Option<TruePixel>]> {
        self.views.iter().map(|(_, pixels)| &pixels[..])
    }

    /// Renders a prepared scan, or a mesh of one, in all views.
    pub fn render(&self, geometry: Geometry) -> Vec<Image> {
        let scene = grey_scene(geometry, sun_and_headlight(), camera(&self.views[0].0));
        let mut flat = FlatScene::new(&scene, &NoProgress).unwrap();
        let render = |(view, _): &(SceneView, _)| {
            flat.camera = camera(view);
            self.render_view(&flat)
        };
        self.views.iter().map(render).collect()
    }

    /// Returns the true pictures of all views.
    pub fn images(&self) -> Vec<Image> {
        let image = |(_, pixels): &(SceneView, Vec<Option<TruePixel>>)| {
            let mut image = Image::new(self.resolution, self.resolution);
            for (i, pixel) in pixels.iter().enumerate() {
                let Some(pixel) = pixel else { continue };
                let value = pixel.radiance;
                image.color[i] = [value, value, value, 1.0];
                image.coverage[i] = 1.0;
            }
            image
        };
        self.views.iter().map(image).collect()
    }

    fn render_view(&self, flat: &FlatScene) -> Image {
        let settings = Settings {
            width: self.resolution,
            height: self.resolution,
            samples_per_pixel: 1,
            light_samples: 1,
            point_size: 1.0,
            with_aovs: true,
            ..Settings::default()
        };
        CpuRenderer { simd: Simd::detect() }.render(flat, &settings, &NoProgress).unwrap().0
    }
}

fn camera(view: &SceneView) -> Camera {
    Camera {
        position: view.position,
        focal_point: view.focal_point,
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle_deg: view.view_angle_deg },
    }
}

fn pixel_rays(view: &SceneView, resolution: u32) -> Vec<Ray> {
    let view = camera(view).view(DVec3::ZERO, resolution, resolution);
    let pixels = (0..resolution * resolution).map(|i| (i % resolution, i / resolution));
    pixels.map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect()
}

fn true_pixel(
    scene: &NamedScene,
    kinds: &[&'static str],
    instrument: &dyn Instrument,
    ray: &Ray,
    view: &SceneView,
    toward: DVec3,
) -> Option<TruePixel> {
    const MAX_DISTANCE: f64 = 500.0;
    // A surface that pulses graze is not measured.
    const MIN_INCIDENCE_COSINE: f64 = 0.05;
    let direction = ray.direction.as_dvec3().normalize();
    let ray = DRay { origin: view.position, direction };
    let hit = scene.sdf.first_hit(&ray, MAX_DISTANCE)?;
    let point = ray.origin + hit.distance * direction;
    let normal = scene.sdf.normal(hit.part_idx, point);
    let is_seen = |viewpoint: &DVec3| {
        let toward_viewpoint = (viewpoint - point).normalize();
        MIN_INCIDENCE_COSINE < toward_viewpoint.dot(normal)
            && scene.sdf.is_visible_from(*viewpoint, point)
    };
    let name = scene.object_names[hit.part_idx];
    let facing = if 0.0 < normal.dot(direction) { -normal } else { normal };
    Some(TruePixel {
        kind_idx: kinds.iter().position(|kind| *kind == name)?,
        depth: hit.distance * direction.dot(toward),
        normal: facing.as_vec3(),
        is_scanned: instrument.viewpoints(point).iter().any(is_seen),
        radiance: radiance(scene, point, facing, -direction),
    })
}

/// Returns the radiance of a matte grey point toward the viewer in the light of [`sun_and_headlight`].
fn radiance(scene: &NamedScene, point: DVec3, normal: DVec3, to_viewer: DVec3) -> f32 {
    // No scene is as wide as this.
    const SUN_DISTANCE: f64 = 300.0;
    let toward_sun = toward_sun().as_dvec3();
    let cos = normal.dot(toward_sun).max(0.0);
    let is_lit = 0.0 < cos && scene.sdf.is_visible_from(point + SUN_DISTANCE * toward_sun, point);
    let sun = if is_lit { SUN * cos as f32 } else { 0.0 };
    ALBEDO * (sun + HEADLIGHT * normal.dot(to_viewer) as f32)
}

//! Lit pictures, and how much pictures of points differ from those of what the points were taken from.

use crate::deviation::cameras;
use crate::ground_truth::GroundTruth;
use surfel_core::flat::FlatScene;
use surfel_core::image::{Image, encode_srgb};
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, Geometry, Graph, Light, Material, Mesh, Scene, Sky, Sun,
};
use surfel_core::trace::Simd;

/// Linear albedo of everything in a lit picture.
pub const ALBEDO: f32 = 0.5;
/// Strength of the sun.
pub const SUN: f32 = 1.2;
/// Strength of the headlight that lights scans beside the sun.
pub const HEADLIGHT: f32 = 0.6;
/// Number of rays per pixel toward the sky.
const N_SKY_RAYS: u32 = 16;

/// Lit pictures of a mesh, one from each camera.
pub struct LitViews {
    cameras: [Camera; 4],
    resolution: u32,
    images: Vec<Image>,
}

/// The squared differences of pixels of two pictures.
#[derive(Clone, Copy, Debug, Default)]
pub struct PictureError {
    squares: f64,
    n_pixels: usize,
}

/// Returns the unit direction toward the sun.
pub fn toward_sun() -> Vec3 {
    Vec3::new(0.45, -0.6, 0.66).normalize()
}

/// Returns the light of shapes: a sun with hard shadows, and a sky with ambient occlusion.
fn sun_and_sky() -> Vec<Light> {
    let (zenith, ground) = (Vec3::splat(0.6), Vec3::splat(0.3));
    vec![sun(), Light::Sky(Sky { up: Vec3::Z, zenith, ground, ao_distance: f32::INFINITY })]
}

/// Returns the light of scans: a sun with hard shadows, and a headlight, so that a room is not dark.
pub fn sun_and_headlight() -> Vec<Light> {
    vec![sun(), Light::Headlight(HEADLIGHT)]
}

fn sun() -> Light {
    let (direction, color) = (toward_sun(), Vec3::splat(SUN));
    Light::Sun(Sun { direction, color, angular_diameter_deg: 0.0 })
}

/// Returns a scene of a grey geometry before a transparent background.
pub fn grey_scene(geometry: Geometry, lights: Vec<Light>, camera: Camera) -> Scene {
    let base_color = Vec3::splat(ALBEDO);
    let material = Material { base_color, ignores_vertex_colors: true, ..Material::MATTE };
    let graph = Graph::from_geometry(geometry, material);
    Scene { graph, lights, background: Background::Transparent, camera }
}

impl LitViews {
    /// Renders a mesh in four views, each `resolution` pixels wide and high.
    pub fn new(mesh: &GroundTruth, resolution: u32) -> Self {
        let cameras = cameras(mesh);
        let mut views = Self { cameras, resolution, images: Vec::new() };
        let (positions, triangles) = (mesh.vertices.clone(), mesh.triangle_indices().to_vec());
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        views.images = views.render(Geometry::Triangles(mesh));
        views
    }

    /// Returns the pictures of the mesh.
    pub fn images(&self) -> &[Image] {
        &self.images
    }

    /// Renders a geometry in the same views and the same light. Its coordinates are those of the mesh.
    pub fn render(&self, geometry: Geometry) -> Vec<Image> {
        let settings = Settings {
            width: self.resolution,
            height: self.resolution,
            samples_per_pixel: 1,
            light_samples: N_SKY_RAYS,
            ..Settings::default()
        };
        let scene = grey_scene(geometry, sun_and_sky(), self.cameras[0]);
        let mut flat = FlatScene::new(&scene, &NoProgress).unwrap();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let render = |camera: &Camera| {
            flat.camera = *camera;
            renderer.render(&flat, &settings, &NoProgress).unwrap().0
        };
        self.cameras.iter().map(render).collect()
    }

    /// Compares pictures with those of the mesh, over the pixels that show one or the other.
    pub fn compare(&self, images: &[Image]) -> PictureError {
        let mut error = PictureError::default();
        for (image, truth) in images.iter().zip(&self.images) {
            let is_covered = |i: &usize| 0.0 < image.coverage[*i].max(truth.coverage[*i]);
            for i in (0..truth.color.len()).filter(is_covered) {
                error.add(image.color[i][0], truth.color[i][0]);
            }
        }
        error
    }
}

impl PictureError {
    /// Adds a pixel by its linear values.
    pub fn add(&mut self, found: f32, truth: f32) {
        let [found, truth] = [found, truth].map(|linear| encode_srgb(linear.clamp(0.0, 1.0)));
        self.squares += f64::from(found - truth).powi(2);
        self.n_pixels += 1;
    }

    /// Returns the peak signal-to-noise ratio of the sRGB-encoded values in decibels: infinite if the pictures are
    /// equal, and NaN without pixels.
    pub fn psnr_db(&self) -> f64 {
        -10.0 * (self.squares / self.n_pixels as f64).log10()
    }
}

#[cfg(test)]
mod tests {
    //! A mesh equals itself, and shadows, missing pixels and false ones count.

    use super::*;
    use crate::shapes;

    #[test]
    fn a_mesh_has_no_error_and_a_moved_one_has() {
        let mesh = shapes::cube();
        let views = LitViews::new(&GroundTruth::from_mesh(&mesh), 32);
        let error = views.compare(&views.render(Geometry::Triangles(mesh.clone())));
        assert_eq!(error.psnr_db(), f64::INFINITY);
        let mut moved = mesh;
        moved.positions.iter_mut().for_each(|position| position.x += 0.2);
        let error = views.compare(&views.render(Geometry::Triangles(moved)));
        assert!((5.0..25.0).contains(&error.psnr_db()), "{error:?}");
    }

    #[test]
    fn missing_and_false_pixels_count() {
        let views = LitViews::new(&GroundTruth::from_mesh(&shapes::cube()), 32);
        let n_pixels = |images: &[Image]| views.compare(images).n_pixels;
        let n_true = n_pixels(views.images());
        let nothing = vec![Image::new(32, 32); 4];
        assert_eq!(n_pixels(&nothing), n_true);
        assert!(views.compare(&nothing).psnr_db() < 12.0);
        let mut wider = views.images().to_vec();
        wider[0].coverage[0] = 1.0;
        assert_eq!(n_pixels(&wider), n_true + 1);
    }

    #[test]
    fn a_tenth_of_the_peak_is_20_db() {
        let mut error = PictureError::default();
        assert!(error.psnr_db().is_nan());
        error.add(1.0, surfel_core::image::decode_srgb(0.9));
        assert!((error.psnr_db() - 20.0).abs() < 1e-4, "{error:?}");
    }
}

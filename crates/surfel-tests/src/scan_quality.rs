//! Pictures of scans compared with the scenes that were scanned, by kind of object.

use rayon::prelude::*;
use surfel_core::flat::FlatScene;
use surfel_core::image::{Aovs, Image};
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scanner::scenes::{NamedScene, SceneView};
use surfel_core::scanner::{DRay, Instrument};
use surfel_core::scene::{
    Background, Camera, CloudGeometry, Geometry, Graph, Light, Material, Projection, Scene,
};
use surfel_core::trace::Simd;

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
}

/// The pixels of all views of a scene.
pub struct TrueScene {
    views: Vec<(SceneView, Vec<Option<TruePixel>>)>,
    kinds: Vec<&'static str>,
    resolution: u32,
}

/// Figures of one kind of object over all views.
#[derive(Clone, Debug, Default)]
pub struct KindQuality {
    /// The kind of object.
    pub kind: &'static str,
    /// Number of pixels that show a scanned part of it.
    pub n_pixels: usize,
    /// Scanned pixels that show points at about the true depth, as a fraction of all scanned ones.
    pub shown: f64,
    /// Scanned pixels that show points far off the true depth, as a fraction of all scanned ones.
    pub far_off: f64,
    /// Root mean square of the depth differences of shown pixels in metres.
    pub depth_rms: f64,
    /// Mean angle between the normals of shown pixels in degrees.
    pub normal_deg: f64,
    /// Mean difference of the covered fraction of blocks of 16 x 16 pixels that show the kind.
    pub block_coverage_error: f64,
}

/// Figures of all views of a scan.
#[derive(Clone, Debug, Default)]
pub struct ScanQuality {
    /// Pixels that show points but nothing in truth, as a fraction of the pixels that show nothing in truth.
    pub false_hits: f64,
    /// Figures by kind of object.
    pub kinds: Vec<KindQuality>,
}

/// Width and height of blocks in pixels.
const BLOCK_SIZE: usize = 16;

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

    /// Renders a prepared scan in all views and compares the pictures with the scene.
    pub fn compare(&self, points: &CloudGeometry) -> ScanQuality {
        let mut tally = Tally::new(self.kinds.len());
        let scene = Scene {
            graph: Graph::from_geometry(Geometry::Points(points.clone()), Material::MATTE),
            lights: vec![Light::Headlight(1.0)],
            background: Background::Transparent,
            camera: camera(&self.views[0].0),
        };
        let mut flat = FlatScene::new(&scene, &NoProgress).unwrap();
        for (view, pixels) in &self.views {
            flat.camera = camera(view);
            let image = self.render(&flat);
            let aovs = image.aovs.as_ref().unwrap();
            tally.add_pixels(pixels, aovs);
            tally.add_blocks(pixels, aovs, self.resolution as usize);
        }
        tally.quality(&self.kinds)
    }

    fn render(&self, flat: &FlatScene) -> Image {
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
    Some(TruePixel {
        kind_idx: kinds.iter().position(|kind| *kind == name)?,
        depth: hit.distance * direction.dot(toward),
        normal: (if 0.0 < normal.dot(direction) { -normal } else { normal }).as_vec3(),
        is_scanned: instrument.viewpoints(point).iter().any(is_seen),
    })
}

/// Sums over pixels of one kind.
#[derive(Clone, Default)]
struct KindTally {
    n_pixels: usize,
    n_shown: usize,
    n_far_off: usize,
    squares: f64,
    angles: f64,
    n_blocks: usize,
    block_errors: f64,
}

struct Tally {
    n_background: usize,
    n_false: usize,
    kinds: Vec<KindTally>,
}

impl Tally {
    fn new(n_kinds: usize) -> Self {
        Self { n_background: 0, n_false: 0, kinds: vec![KindTally::default(); n_kinds] }
    }

    fn add_pixels(&mut self, pixels: &[Option<TruePixel>], aovs: &Aovs) {
        for (i, truth) in pixels.iter().enumerate() {
            let depth = f64::from(aovs.depth[i]);
            let Some(truth) = truth else {
                self.n_background += 1;
                self.n_false += usize::from(depth.is_finite());
                continue;
            };
            let kind = &mut self.kinds[truth.kind_idx];
            if !truth.is_scanned {
                continue;
            }
            kind.n_pixels += 1;
            // Points at another depth than this show another object.
            let tolerance = 0.1 + 0.01 * truth.depth;
            let error = depth - truth.depth;
            if tolerance < error.abs() {
                kind.n_far_off += usize::from(depth.is_finite());
                continue;
            }
            kind.n_shown += 1;
            kind.squares += error * error;
            kind.angles += f64::from(aovs.normal[i].angle_between(truth.normal));
        }
    }

    /// Adds the error of each block to every kind that it shows.
    fn add_blocks(&mut self, pixels: &[Option<TruePixel>], aovs: &Aovs, width: usize) {
        let n_blocks = width / BLOCK_SIZE;
        for block in 0..n_blocks * n_blocks {
            let corner = (block / n_blocks * width + block % n_blocks) * BLOCK_SIZE;
            let inside = (0..BLOCK_SIZE * BLOCK_SIZE)
                .map(|i| corner + i / BLOCK_SIZE * width + i % BLOCK_SIZE);
            let n_true = inside.clone().filter(|i| pixels[*i].is_some()).count() as f64;
            let n_shown = inside.clone().filter(|i| aovs.depth[*i].is_finite()).count() as f64;
            let error = (n_true - n_shown).abs() / (BLOCK_SIZE * BLOCK_SIZE) as f64;
            for (kind_idx, kind) in self.kinds.iter_mut().enumerate() {
                let shows = |i: usize| {
                    pixels[i].is_some_and(|pixel| pixel.kind_idx == kind_idx && pixel.is_scanned)
                };
                if inside.clone().any(shows) {
                    kind.n_blocks += 1;
                    kind.block_errors += error;
                }
            }
        }
    }

    fn quality(&self, names: &[&'static str]) -> ScanQuality {
        let quality = |(name, tally): (&&'static str, &KindTally)| KindQuality {
            kind: name,
            n_pixels: tally.n_pixels,
            shown: tally.n_shown as f64 / tally.n_pixels as f64,
            far_off: tally.n_far_off as f64 / tally.n_pixels as f64,
            depth_rms: (tally.squares / tally.n_shown as f64).sqrt(),
            normal_deg: (tally.angles / tally.n_shown as f64).to_degrees(),
            block_coverage_error: tally.block_errors / tally.n_blocks as f64,
        };
        ScanQuality {
            false_hits: self.n_false as f64 / self.n_background.max(1) as f64,
            kinds: names.iter().zip(&self.kinds).map(quality).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    //! Figures of pictures that differ from the scene by known amounts.

    use super::*;

    const RESOLUTION: usize = 32;

    /// Returns pixels whose left half shows the first kind, a wall 10 m away.
    fn pixels() -> Vec<Option<TruePixel>> {
        let wall = TruePixel { kind_idx: 0, depth: 10.0, normal: Vec3::X, is_scanned: true };
        let is_left = |i: usize| i % RESOLUTION < RESOLUTION / 2;
        (0..RESOLUTION * RESOLUTION).map(|i| is_left(i).then_some(wall)).collect()
    }

    fn aovs(depth: impl Fn(usize) -> f32) -> Aovs {
        let size = RESOLUTION as u32;
        let mut aovs = Image::with_aovs(size, size).aovs.unwrap();
        for (i, found) in aovs.depth.iter_mut().enumerate() {
            *found = depth(i);
        }
        aovs.normal.fill(Vec3::Y);
        aovs
    }

    fn compare(aovs: &Aovs) -> ScanQuality {
        let mut tally = Tally::new(1);
        tally.add_pixels(&pixels(), aovs);
        tally.add_blocks(&pixels(), aovs, RESOLUTION);
        tally.quality(&["wall"])
    }

    #[test]
    fn a_wall_that_covers_everything_is_false_on_the_other_half() {
        let quality = compare(&aovs(|_| 10.05));
        assert_eq!(quality.false_hits, 1.0);
        let wall = &quality.kinds[0];
        assert_eq!((wall.shown, wall.far_off, wall.block_coverage_error), (1.0, 0.0, 0.0));
        assert!((wall.depth_rms - 0.05).abs() < 1e-5 && (wall.normal_deg - 90.0).abs() < 1e-3);
    }

    #[test]
    fn every_second_row_missing_is_half_the_coverage() {
        let quality = compare(&aovs(|i| {
            let is_shown = (i / RESOLUTION).is_multiple_of(2) && i % RESOLUTION < RESOLUTION / 2;
            if is_shown { 10.0 } else { f32::INFINITY }
        }));
        let wall = &quality.kinds[0];
        assert_eq!((quality.false_hits, wall.shown, wall.block_coverage_error), (0.0, 0.5, 0.5));
    }

    #[test]
    fn depths_of_other_objects_are_far_off() {
        let wall = &compare(&aovs(|_| 12.0)).kinds[0];
        assert_eq!((wall.shown, wall.far_off), (0.0, 1.0));
    }
}

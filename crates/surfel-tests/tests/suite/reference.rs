//! Reference pictures, a small one for each surface kind: a change of a few pixels fails the test.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::render::{Renderer, Settings};
use surfel_core::scene::{Background, Camera, Light, Projection, Scene, Sky, Sun};
use surfel_core::surface::SurfaceKind;
use surfel_formats::{ImageOptions, encode_png, save_image};
use surfel_tests::backends;
use surfel_tests::clouds;
use surfel_tests::scenes;

/// The environment variable that makes the test accept the pictures as they come out now.
const ACCEPT: &str = "SURFEL_ACCEPT_REFERENCES";
const SIZE: (u32, u32) = (96, 72);

/// The greatest number of pixels that may differ.
///
/// The renderer gives the same bytes on every machine, so a picture should equal its reference. Only `sin`,
/// `cos` and `pow` come from the system's math library, whose results may differ in the last bit between
/// systems. Such a bit shows where it moves a value over the edge between two 8-bit steps or a light ray past
/// the rim of a disc, which is the case for hardly any of the 6912 pixels.
const MAX_PIXELS: usize = 2;
/// The greatest difference of a channel in 8-bit steps: one of a pixel's 64 light rays is 255 / 64 of them.
const MAX_STEPS: u8 = 4;

/// Returns a sun and a sky.
pub fn lights() -> Vec<Light> {
    let toward_sun = Vec3::new(0.6, -0.5, 0.7).normalize();
    vec![
        Light::Sun(Sun { direction: toward_sun, color: Vec3::ONE, angular_diameter_deg: 0.5 }),
        Light::Sky(Sky {
            up: Vec3::Z,
            zenith: Vec3::splat(0.4),
            ground: Vec3::splat(0.2),
            ao_distance: 3.0,
        }),
    ]
}

/// Returns a scene of a ball on a cube whose points have this kind.
pub fn scene(kind: SurfaceKind) -> Scene {
    scene_with_ball_at(1.7, kind)
}

/// Returns the scene with the middle of the ball at this height; at 1.7 it lies on the cube.
pub fn scene_with_ball_at(height: f32, kind: SurfaceKind) -> Scene {
    let mut cloud = clouds::cube(24, 0.4, 11);
    let ball = clouds::sphere(1500, 0.7).positions.into_iter().map(|p| p + height * Vec3::Z);
    cloud.positions.extend(ball);
    cloud.normals = None;
    let points = scenes::points(cloud, kind);
    let color = |p: &Vec3| if 1.0 < p.z { [230, 120, 60] } else { [150, 170, 190] };
    let colors = points.cloud().positions.iter().map(color).collect();
    Scene {
        lights: lights(),
        background: Background::Gradient { top: Vec3::splat(0.2), bottom: Vec3::splat(0.8) },
        camera: Camera {
            position: DVec3::new(6.0, -5.0, 3.5),
            focal_point: DVec3::new(0.0, 0.0, 0.6),
            view_up: DVec3::Z,
            projection: Projection::Perspective { view_angle_deg: 32.0 },
        },
        ..scenes::lit(scenes::colored(&points, colors))
    }
}

fn picture(kind: SurfaceKind, renderer: &dyn Renderer) -> Image {
    let settings = Settings {
        width: SIZE.0,
        height: SIZE.1,
        samples_per_pixel: 4,
        noise_threshold: 0.0,
        light_samples: 16,
        max_depth: 8,
        seed: 0,
        point_size: 1.0,
        with_aovs: false,
    };
    let flat = FlatScene::new(&scene(kind), &NoProgress).unwrap();
    backends::render(renderer, &flat, &settings)
}

#[test]
fn pictures_equal_their_references() {
    if std::env::var_os(ACCEPT).is_some() {
        for (name, kind) in SurfaceKind::ALL {
            let image = picture(kind, &backends::cpu());
            save_image(&reference(name), &image, &ImageOptions::default()).unwrap();
        }
    }
    let allowed = ByteDifference { n_pixels: MAX_PIXELS, n_steps: MAX_STEPS };
    check(&backends::cpu(), &SurfaceKind::ALL.map(|(_, kind)| kind), allowed);
}

/// Fails unless the pictures of a renderer equal the references of these kinds, up to an allowed difference.
pub fn check(renderer: &dyn Renderer, kinds: &[SurfaceKind], allowed: ByteDifference) {
    let failures = kinds.iter().filter_map(|kind| {
        let name = kind.name();
        compare(name, &picture(*kind, renderer), &reference(name), allowed)
    });
    let failures: Vec<_> = failures.collect();
    assert!(failures.is_empty(), "{}\nset {ACCEPT}=1 to accept them", failures.join("\n"));
}

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("references").join(format!("{name}.png"))
}

/// The number of pixels that differ and the greatest difference of a channel in 8-bit steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByteDifference {
    /// Number of pixels that differ.
    pub n_pixels: usize,
    /// Greatest difference of a channel.
    pub n_steps: u8,
}

impl ByteDifference {
    fn new(found: &[u8], expected: &[u8]) -> Self {
        let pairs = || found.iter().zip(expected);
        let n_pixels = found.chunks(4).zip(expected.chunks(4)).filter(|(a, b)| a != b).count();
        Self { n_pixels, n_steps: pairs().map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0) }
    }

    fn is_within(self, allowed: Self) -> bool {
        self.n_pixels <= allowed.n_pixels && self.n_steps <= allowed.n_steps
    }
}

/// Returns a message if a picture differs from its reference, and writes both and their difference.
fn compare(name: &str, image: &Image, reference: &Path, allowed: ByteDifference) -> Option<String> {
    let found = decode_png(&encode_png(image, &ImageOptions::default()).unwrap());
    let expected = fs::read(reference);
    let expected = expected.unwrap_or_else(|error| panic!("{}: {error}", reference.display()));
    let expected = decode_png(&expected);
    assert_eq!(found.len(), expected.len(), "{name}");
    let difference = ByteDifference::new(&found, &expected);
    if difference.is_within(allowed) {
        return None;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let write = |kind: &str, image: &Image| {
        let path = folder.join(format!("{name}.{kind}.png"));
        save_image(&path, image, &ImageOptions::default()).unwrap();
    };
    write("found", image);
    fs::copy(reference, folder.join(format!("{name}.expected.png"))).unwrap();
    let mut shown = Image::new(image.width, image.height);
    let pixels = found.chunks(4).zip(expected.chunks(4));
    for (shown, (found, expected)) in shown.color.iter_mut().zip(pixels) {
        // 32 steps and more are white.
        let channel = |i: usize| (f32::from(found[i].abs_diff(expected[i])) / 32.0).min(1.0);
        *shown = [channel(0), channel(1), channel(2), 1.0];
    }
    write("difference", &shown);
    let ByteDifference { n_pixels, n_steps } = difference;
    let folder = folder.display();
    Some(format!(
        "{name}: {n_pixels} pixels differ, by up to {n_steps} steps; see {folder}/{name}.*.png"
    ))
}

fn decode_png(png: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes
}

#[test]
fn three_changed_pixels_or_one_wrong_pixel_fail() {
    let reference: Vec<u8> = (0..96 * 72 * 4).map(|i| (i % 200) as u8).collect();
    let changed = |n_pixels: usize, n_steps: u8| {
        let mut found = reference.clone();
        found.iter_mut().step_by(4 * 97).take(n_pixels).for_each(|channel| *channel += n_steps);
        let difference = ByteDifference::new(&found, &reference);
        assert_eq!(difference, ByteDifference { n_pixels, n_steps });
        difference.is_within(ByteDifference { n_pixels: MAX_PIXELS, n_steps: MAX_STEPS })
    };
    assert!(changed(0, 0) && changed(2, 4));
    assert!(!changed(3, 1) && !changed(1, 5));
}

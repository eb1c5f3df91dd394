//! Small reference pictures, one a surface kind: a change that shows is seen.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use surfel::flat::FlatScene;
use surfel::image::{Image, Tone};
use surfel::math::{DVec3, Vec3};
use surfel::progress::Silent;
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::{Background, Camera, Light, Points, Projection, Scene, Sky, Sun};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_formats::{ImageOptions, save_image};
use surfel_tests::{clouds, scenes};

/// Set to accept the pictures as they come out now.
const ACCEPT: &str = "SURFEL_ACCEPT_REFERENCES";
const SIZE: (u32, u32) = (96, 72);
/// 8-bit steps, mean over all channels: pow, sin and cos may differ in their last bit between machines.
const MEAN_LIMIT: f64 = 0.1;

fn picture(kind: SurfaceKind) -> Image {
    let mut cloud = clouds::cube(24, 0.4, 11);
    let ball = clouds::sphere(1500, 0.7).positions.into_iter().map(|p| p + 1.7 * Vec3::Z);
    cloud.positions.extend(ball);
    cloud.normals = None;
    let points = scenes::points(cloud, kind);
    let color = |p: &Vec3| if 1.0 < p.z { [230, 120, 60] } else { [150, 170, 190] };
    let colors = points.cloud.positions.iter().map(color).collect();
    let toward_sun = Vec3::new(0.6, -0.5, 0.7).normalize();
    let scene = Scene {
        lights: vec![
            Light::Sun(Sun { direction: toward_sun, color: Vec3::ONE, angular_diameter_deg: 0.5 }),
            Light::Sky(Sky {
                up: Vec3::Z,
                zenith: Vec3::splat(0.4),
                ground: Vec3::splat(0.2),
                reach: 3.0,
            }),
        ],
        background: Background::Gradient { top: Vec3::splat(0.2), bottom: Vec3::splat(0.8) },
        camera: Camera {
            position: DVec3::new(6.0, -5.0, 3.5),
            focal_point: DVec3::new(0.0, 0.0, 0.6),
            view_up: DVec3::Z,
            projection: Projection::Perspective { view_angle_deg: 32.0 },
        },
        ..scenes::lit(Points { colors, ..points })
    };
    let settings = Settings {
        width: SIZE.0,
        height: SIZE.1,
        samples_per_pixel: 4,
        light_samples: 16,
        max_depth: 8,
        seed: 0,
        with_layers: false,
    };
    let flat = FlatScene::new(&scene, &Silent).unwrap();
    CpuRenderer { simd: Simd::detect() }.render(&flat, &settings, &Silent).unwrap().0
}

#[test]
fn pictures_look_as_they_did() {
    let references = Path::new(env!("CARGO_MANIFEST_DIR")).join("references");
    let mut failures = Vec::new();
    for (name, kind) in SurfaceKind::ALL {
        let image = picture(kind);
        let reference = references.join(format!("{name}.png"));
        if std::env::var_os(ACCEPT).is_some() {
            save_image(&reference, &image, &ImageOptions::default()).unwrap();
        }
        failures.extend(compare(name, &image, &reference));
    }
    assert!(failures.is_empty(), "{}\nset {ACCEPT}=1 to accept them", failures.join("\n"));
}

/// Writes picture, reference and difference where they differ, and says where.
fn compare(name: &str, image: &Image, reference: &Path) -> Option<String> {
    let found: Vec<u8> =
        image.color.iter().flat_map(|&pixel| Tone::default().rgba8(pixel)).collect();
    let expected = read_png(reference);
    assert_eq!(found.len(), expected.len(), "{name}");
    let differences: Vec<u8> = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = differences.iter().map(|&d| f64::from(d)).sum::<f64>() / differences.len() as f64;
    if mean <= MEAN_LIMIT {
        return None;
    }
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    save_image(&folder.join(format!("{name}.found.png")), image, &ImageOptions::default()).unwrap();
    fs::copy(reference, folder.join(format!("{name}.expected.png"))).unwrap();
    let mut shown = Image::new(image.width, image.height);
    for (pixel, difference) in shown.color.iter_mut().zip(differences.chunks(4)) {
        *pixel = [0, 1, 2]
            .map(|i| f32::from(difference[i]) / 32.0)
            .map(|d| d.min(1.0))
            .iter()
            .copied()
            .chain([1.0])
            .collect::<Vec<_>>()
            .try_into()
            .unwrap();
    }
    save_image(&folder.join(format!("{name}.difference.png")), &shown, &ImageOptions::default())
        .unwrap();
    let most = differences.iter().max().unwrap();
    Some(format!(
        "{name}: mean difference {mean:.3}, most {most}; see {}/{name}.*.png",
        folder.display()
    ))
}

fn read_png(path: &Path) -> Vec<u8> {
    let file = File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    bytes
}

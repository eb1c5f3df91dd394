//! Determinism: pictures, trees and regions have the same bytes whatever the number of threads and the SIMD level;
//! and every stage of the work can be cancelled.

use rayon::ThreadPoolBuilder;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::{Vec3, Vec4};
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, RenderRegion, Renderer, Settings};
use surfel_core::scene::{Light, Material, Scene, Sky, Sun};
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::Simd;
use surfel_tests::cancel_after::CancelAfter;
use surfel_tests::clouds;
use surfel_tests::scenes;

const SETTINGS: Settings = Settings {
    width: 70,
    height: 50,
    samples_per_pixel: 4,
    noise_threshold: 0.0,
    light_samples: 8,
    max_depth: 8,
    seed: 3,
    point_size: 5.0,
    with_aovs: true,
};

fn scene(kind: SurfaceKind) -> Scene {
    let mut cloud = clouds::cube(40, 0.4, 9);
    cloud.normals = None;
    let sun = Sun {
        direction: Vec3::new(1.0, 1.0, 1.0).normalize(),
        color: Vec3::ONE,
        angular_diameter_deg: 2.0,
    };
    let sky =
        Sky { up: Vec3::Z, zenith: Vec3::splat(0.5), ground: Vec3::splat(0.2), ao_distance: 2.0 };
    Scene { lights: vec![Light::Sun(sun), Light::Sky(sky)], ..scenes::scene(cloud, kind) }
}

/// Prepares bare points, builds the scene and renders it, on `n_threads`.
fn picture(kind: SurfaceKind, n_threads: usize, simd: Simd) -> Image {
    let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    pool.install(|| {
        let flat = FlatScene::new(&scene(kind), &NoProgress).unwrap();
        CpuRenderer { simd }.render(&flat, &SETTINGS, &NoProgress).unwrap().0
    })
}

#[test]
fn pictures_do_not_depend_on_threads_or_simd_level() {
    for (name, kind) in SurfaceKind::ALL {
        let reference = picture(kind, 1, Simd::PORTABLE);
        for n_threads in [1, 2, 3] {
            for simd in Simd::available() {
                assert!(
                    picture(kind, n_threads, simd) == reference,
                    "{name}, {n_threads} threads, {}",
                    simd.name()
                );
            }
        }
    }
}

#[test]
fn preparation_and_tree_do_not_depend_on_threads() {
    let build = |n_threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let mut cloud = clouds::sphere(60_000, 1.0);
            cloud.normals = None;
            let flat = scenes::flat(cloud, SurfaceKind::Splat);
            (flat.points.nodes, flat.points.blocks, flat.points.ids)
        })
    };
    assert!(build(1) == build(2));
}

#[test]
fn every_stage_can_be_cancelled() {
    for left in [0, 1, 5, 20] {
        let progress = CancelAfter::new(left);
        let result = FlatScene::new(&scene(SurfaceKind::Splat), &progress).and_then(|flat| {
            CpuRenderer { simd: Simd::detect() }.render(&flat, &SETTINGS, &progress)
        });
        assert!(matches!(result, Err(surfel_core::Error::Cancelled)), "after {left}");
    }
}

#[test]
fn traced_pictures_can_be_cancelled_at_every_check() {
    let flat = FlatScene::new(&scene(SurfaceKind::Splat), &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    // The six tiles ask before their work, and before each chunk of rays. Fast rays have larger chunks, so that the
    // number of questions varies, but the camera rays alone make more than 16 however fast they are.
    for left in [0, 1, 3, 6, 16] {
        let progress = CancelAfter::new(left);
        let result = renderer.render(&flat, &SETTINGS, &progress);
        assert!(matches!(result, Err(surfel_core::Error::Cancelled)), "after {left}");
        assert_eq!(progress.n_left(), 0);
    }
}

#[test]
fn rasterised_points_can_be_cancelled_in_every_row() {
    let flat = FlatScene::new(&scene(SurfaceKind::Points), &NoProgress).unwrap();
    let n_rows = u64::from(SETTINGS.height);
    // The first question is asked while the points are drawn, and two more in each row of pixels.
    for left in [0, 1, n_rows / 2, n_rows + 1, 2 * n_rows] {
        let progress = CancelAfter::new(left);
        let result = CpuRenderer { simd: Simd::detect() }.render(&flat, &SETTINGS, &progress);
        assert!(matches!(result, Err(surfel_core::Error::Cancelled)), "after {left}");
    }
}

#[test]
fn regions_make_the_whole_picture() {
    for (name, kind) in SurfaceKind::ALL {
        let flat = FlatScene::new(&scene(kind), &NoProgress).unwrap();
        let renderer = CpuRenderer { simd: Simd::detect() };
        let whole = renderer.render(&flat, &SETTINGS, &NoProgress).unwrap().0;
        let piece = |rows, samples| {
            let region = RenderRegion { rows, samples, ..RenderRegion::whole(&SETTINGS) };
            renderer.render_region(&flat, &SETTINGS, region, &NoProgress).unwrap().0
        };
        let rows = [(0, 7), (7, 40), (40, 50)].map(|rows| piece(rows, (0, 4)));
        assert_eq!(rows.each_ref().map(|image| image.height), [7, 33, 10]);
        let stacked: Vec<[f32; 4]> = rows.iter().flat_map(|image| image.color.clone()).collect();
        assert!(stacked == whole.color, "{name}");
        let (rows, columns) = ((11, 47), (5, 44));
        let region = RenderRegion { rows, columns, ..RenderRegion::whole(&SETTINGS) };
        let part = renderer.render_region(&flat, &SETTINGS, region, &NoProgress).unwrap().0;
        assert_eq!((part.width, part.height), (39, 36));
        for (row, y) in part.color.chunks(39).zip(11..) {
            let first = y * SETTINGS.width as usize;
            assert!(row == &whole.color[first + 5..first + 44], "{name}, row {y}");
        }
        if kind == SurfaceKind::Points {
            continue;
        }
        let samples = [(0, 1), (1, 2), (2, 4)].map(|samples| piece((0, 50), samples));
        for (pixel, expected) in whole.color.iter().enumerate() {
            let weighted = samples.iter().zip([0.25, 0.25, 0.5]);
            let mean: Vec4 = weighted.map(|(s, w)| w * Vec4::from_array(s.color[pixel])).sum();
            let difference = (mean - Vec4::from_array(*expected)).abs().max_element();
            assert!(difference < 1e-5, "{name}, pixel {pixel}");
        }
    }
}

#[test]
fn pictures_of_fewer_samples_do_not_depend_on_threads_or_regions() {
    let flat = FlatScene::new(&scene(SurfaceKind::Smooth), &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    let all = Settings { samples_per_pixel: 64, light_samples: 64, ..SETTINGS };
    let settings = Settings { noise_threshold: 0.02, ..all };
    let whole = |settings: &Settings, n_threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| renderer.render(&flat, settings, &NoProgress).unwrap())
    };
    let ((image, stats), (reference, all_stats)) = (whole(&settings, 1), whole(&all, 2));
    assert!(whole(&settings, 3).0 == image);
    let [fewer, most] = [stats, all_stats].map(|stats| stats.rays.primary);
    assert!(most / 8 < fewer && fewer < most * 3 / 4, "{fewer} of {most} rays");
    let brightness = |color: &[f32; 4]| color[..3].iter().sum::<f32>() / 3.0;
    let errors = image.color.iter().zip(&reference.color).map(|(found, expected)| {
        let [found, expected] = [found, expected].map(brightness);
        (found - expected).powi(2) / expected.max(0.01)
    });
    let error = (errors.sum::<f32>() / image.color.len() as f32).sqrt();
    assert!(0.0 < error && error < 0.02, "{error}");
    let (rows, columns) = ((11, 47), (5, 44));
    let region = RenderRegion { rows, columns, ..RenderRegion::whole(&settings) };
    let part = renderer.render_region(&flat, &settings, region, &NoProgress).unwrap().0;
    assert!(part == image.cropped(rows, columns));
    assert_eq!((part.width, part.height), (39, 36));
}

#[test]
fn rays_of_many_branches_give_the_same_picture_in_parts() {
    // 64 branches a ray: the paths of half a tile are followed at once.
    let settings =
        Settings { width: 32, height: 32, samples_per_pixel: 1, light_samples: 64, ..SETTINGS };
    let mut rough = scenes::scene(clouds::cube(10, 0.4, 9), SurfaceKind::Disc);
    rough.graph.materials[0] = Material::METAL;
    let flat = FlatScene::new(&rough, &NoProgress).unwrap();
    let rendered = |rows| {
        let region = RenderRegion { rows, ..RenderRegion::whole(&settings) };
        let renderer = CpuRenderer { simd: Simd::detect() };
        let (image, stats) = renderer.render_region(&flat, &settings, region, &NoProgress).unwrap();
        (image.color, stats.rays.secondary)
    };
    let (whole, n_secondary) = rendered((0, 32));
    let ((top, n_top), (bottom, n_bottom)) = (rendered((0, 16)), rendered((16, 32)));
    assert!(whole == [top, bottom].concat());
    assert!(1000 < n_secondary && n_secondary == n_top + n_bottom, "{n_secondary}");
}

#[test]
fn a_region_outside_the_picture_is_an_error() {
    let flat = FlatScene::new(&scene(SurfaceKind::Disc), &NoProgress).unwrap();
    let renderer = CpuRenderer { simd: Simd::detect() };
    let width = SETTINGS.width;
    for (rows, columns, samples) in [
        ((0, 51), (0, width), (0, 4)),
        ((9, 9), (0, width), (0, 4)),
        ((0, 50), (0, width), (3, 5)),
        ((5, 4), (0, width), (0, 1)),
        ((0, 50), (0, width + 1), (0, 4)),
        ((0, 50), (3, 3), (0, 4)),
    ] {
        let region = RenderRegion { rows, columns, samples };
        let error = renderer.render_region(&flat, &SETTINGS, region, &NoProgress).unwrap_err();
        assert!(error.to_string().contains("region"), "{error}");
    }
}

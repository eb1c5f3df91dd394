//! The same inputs give the same bytes: threads, SIMD levels, progress and cancellation.

use rayon::ThreadPoolBuilder;
use std::sync::atomic::{AtomicU64, Ordering};
use surfel::flat::FlatScene;
use surfel::image::Image;
use surfel::math::Vec3;
use surfel::progress::{Progress, Silent};
use surfel::render::{CpuRenderer, Renderer, Settings};
use surfel::scene::{Light, Scene, Sky, Sun};
use surfel::surface::SurfaceKind;
use surfel::trace::Simd;
use surfel_tests::{clouds, scenes};

const SETTINGS: Settings = Settings {
    width: 70,
    height: 50,
    samples_per_pixel: 4,
    light_samples: 8,
    max_depth: 8,
    seed: 3,
    with_layers: true,
};

fn scene(kind: SurfaceKind) -> Scene {
    let mut cloud = clouds::cube(40, 0.4, 9);
    cloud.normals = None;
    let sun = Sun {
        direction: Vec3::new(1.0, 1.0, 1.0).normalize(),
        color: Vec3::ONE,
        angular_diameter_deg: 2.0,
    };
    let sky = Sky { up: Vec3::Z, zenith: Vec3::splat(0.5), ground: Vec3::splat(0.2), reach: 2.0 };
    Scene { lights: vec![Light::Sun(sun), Light::Sky(sky)], ..scenes::scene(cloud, kind) }
}

/// Everything from bare points to the picture, on `n_threads`.
fn picture(kind: SurfaceKind, n_threads: usize, simd: Simd) -> Image {
    let pool = ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
    pool.install(|| {
        let flat = FlatScene::new(&scene(kind), &Silent).unwrap();
        CpuRenderer { simd }.render(&flat, &SETTINGS, &Silent).unwrap().0
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

/// Cancels at its n-th question.
struct CancelAt {
    left: AtomicU64,
}

impl Progress for CancelAt {
    fn is_cancelled(&self) -> bool {
        self.left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| n.checked_sub(1)).is_err()
    }
}

#[test]
fn every_stage_can_be_cancelled() {
    for left in [0, 1, 5, 20] {
        let progress = CancelAt { left: AtomicU64::new(left) };
        let result = FlatScene::new(&scene(SurfaceKind::Splat), &progress).and_then(|flat| {
            CpuRenderer { simd: Simd::detect() }.render(&flat, &SETTINGS, &progress)
        });
        assert!(matches!(result, Err(surfel::Error::Cancelled)), "after {left}");
    }
}

//! Surfaces of points compared with the meshes that the points were taken from, in a short form of the benchmark.

use crate::rays::{hits, rays_from_above};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{Random, Ray, Vec3};
use surfel_core::points::{PointCloud, Preparation};
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_core::trace::{self, Simd, SurfaceHit};
use surfel_tests::deviation::{Deviation, TrueViews};
use surfel_tests::ground_truth::GroundTruth;
use surfel_tests::sampling::{Sampling, mean_spacing};
use surfel_tests::scenes;
use surfel_tests::shapes;
use surfel_tests::shared_data::shared_data;

const RESOLUTION: u32 = 128;

fn deviation(points: &PointCloud, mesh: &GroundTruth, kind: SurfaceKind) -> Deviation {
    let views = TrueViews::new(mesh, RESOLUTION);
    let hits = views.trace(&scenes::flat(points.clone(), kind));
    views.compare(&hits, mean_spacing(mesh, points.len()))
}

/// Returns false hits and misses in percent, the depth in spacings, and the normals' mean and 95 % angle in degrees.
fn figures(found: &Deviation) -> [f64; 5] {
    let Deviation { false_hits, misses, depth_rms, normal_deg, normal_p95_deg, .. } = *found;
    [100.0 * false_hits, 100.0 * misses, depth_rms, normal_deg, normal_p95_deg]
}

#[test]
fn the_bunny_of_points_looks_like_its_mesh() {
    let Some(data) = shared_data() else { return };
    let mesh = GroundTruth::from_file(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    // False hits and mean angles of the normals in degrees, of pictures of this size, with a tenth to a third more.
    let bounds = [
        (SurfaceKind::Sphere, 0.035, 21.5),
        (SurfaceKind::Disc, 0.0065, 14.3),
        (SurfaceKind::SplatMean, 0.0065, 7.8),
        (SurfaceKind::Splat, 0.006, 7.1),
        (SurfaceKind::SplatFit, 0.018, 10.9),
    ];
    for (kind, silhouette, normal_deg) in bounds {
        let deviation = deviation(&cloud, &mesh, kind);
        let differing = deviation.false_hits + deviation.misses;
        assert!(differing < silhouette, "{}: {deviation:?}", kind.name());
        assert!(deviation.normal_deg < normal_deg, "{}: {deviation:?}", kind.name());
        assert!(deviation.misses < 0.001, "{}: {deviation:?}", kind.name());
    }
}

#[test]
fn sampled_shapes_look_like_their_meshes() {
    let cube = GroundTruth::from_mesh(&shapes::cube());
    let blob = GroundTruth::from_mesh(&shapes::low_poly_blob());
    // Upper limits of false hits and misses in percent, depth in spacings, normals in degrees (mean and 95 %).
    let cases = [
        ("cube, uniform", &cube, Sampling::Uniform, [2.0, 0.6, 0.9, 11.0, 48.0]),
        ("cube, random", &cube, Sampling::Random, [2.0, 0.6, 0.9, 11.0, 48.0]),
        ("blob, uniform", &blob, Sampling::Uniform, [0.8, 0.05, 0.6, 6.0, 14.0]),
        ("blob, noise", &blob, Sampling::Noisy(0.3), [3.5, 0.05, 1.6, 8.0, 17.0]),
        ("blob, falling", &blob, Sampling::Falling, [1.0, 0.1, 0.8, 7.0, 15.0]),
    ];
    for (name, mesh, sampling, limits) in cases {
        let cloud = PointCloud::from_positions(sampling.sample(mesh, 6000, 1));
        let found = deviation(&cloud, mesh, SurfaceKind::Splat);
        let figures = figures(&found);
        let is_within = figures.iter().zip(limits).all(|(figure, limit)| *figure <= limit);
        assert!(is_within, "{name}: {figures:?} exceeds {limits:?}");
    }
}

/// Returns a cloud with the default surface, prepared as users see it.
fn as_by_default(cloud: PointCloud) -> FlatCloud {
    let points = scenes::prepared(cloud, &Preparation::default(), SurfaceKind::Smooth);
    FlatCloud::new(&points, &NoProgress).unwrap()
}

#[test]
fn smooth_surfaces_of_sampled_shapes_look_like_their_meshes() {
    let cube = GroundTruth::from_mesh(&shapes::cube());
    let blob = GroundTruth::from_mesh(&shapes::low_poly_blob());
    let head = GroundTruth::from_mesh(&shapes::head());
    // Upper limits as above, a tenth to a fifth above the figures.
    let cases = [
        ("cube, uniform", &cube, 6000, Sampling::Uniform, [0.09, 0.06, 0.1, 0.9, 1.1]),
        ("cube, random", &cube, 6000, Sampling::Random, [0.22, 0.22, 0.14, 2.3, 4.5]),
        ("blob, uniform", &blob, 6000, Sampling::Uniform, [0.01, 0.2, 0.06, 3.6, 7.8]),
        ("blob, noise", &blob, 6000, Sampling::Noisy(0.3), [0.13, 0.36, 0.3, 5.1, 10.2]),
        ("blob, falling", &blob, 6000, Sampling::Falling, [0.01, 0.23, 0.07, 3.9, 8.2]),
        ("head, uniform", &head, 20_000, Sampling::Uniform, [0.01, 0.09, 0.12, 5.0, 19.5]),
    ];
    for (name, mesh, n_points, sampling, limits) in cases {
        let points = sampling.sample(mesh, n_points, 1);
        let spacing = mean_spacing(mesh, points.len());
        let views = TrueViews::new(mesh, RESOLUTION);
        let hits = views.trace(&as_by_default(PointCloud::from_positions(points)));
        let figures = figures(&views.compare(&hits, spacing));
        let is_within = figures.iter().zip(limits).all(|(figure, limit)| *figure <= limit);
        assert!(is_within, "{name}: {figures:?} exceeds {limits:?}");
    }
}

#[test]
fn a_plane_of_random_points_has_no_hole() {
    let mut random = Random::new(1, 0);
    let mut coordinate = || 2.0 * random.next_f32() - 1.0;
    let points = (0..20_000).map(|_| Vec3::new(coordinate(), coordinate(), 0.0)).collect();
    let flat = as_by_default(PointCloud::from_positions(points));
    // A margin of four spacings is left out.
    let cell = |i: u32| 1.886 * ((i as f32 + 0.5) / 500.0 - 0.5);
    let rays = (0..250_000).map(|i| {
        let origin = Vec3::new(cell(i % 500), cell(i / 500), 5.0);
        Ray::new(origin, Vec3::NEG_Z)
    });
    let rays: Vec<Ray> = rays.collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    trace::surface_hits(&flat, Simd::detect(), &rays, &mut hits);
    assert_eq!(hits.iter().filter(|hit| hit.is_miss()).count(), 0);
}

/// Neither denoising nor the closing of gaps covers openings that are much wider than the spacing of the points; only corners
/// are rounded by a few spacings.
#[test]
fn windows_of_a_noisy_wall_stay_open() {
    // The wall |x| < 3, |y| < 2 has two rows of windows, 0.6 wide and 0.8 high, about these centres.
    let windows =
        || (0..8).map(|i| Vec3::new((i % 4) as f32 * 1.4 - 2.1, (i / 4) as f32 - 0.5, 0.0));
    let size = Vec3::new(0.6, 0.8, 0.0);
    let beside = |position: Vec3| {
        let beyond = |center: Vec3| ((position - center).abs() - 0.5 * size).with_z(-9.0);
        windows().map(|center| beyond(center).max_element()).fold(f32::INFINITY, f32::min)
    };
    let mut random = Random::new(12, 0);
    let mut anywhere =
        || Vec3::new(6.0 * random.next_f32() - 3.0, 4.0 * random.next_f32() - 2.0, 0.0);
    let mut points: Vec<Vec3> = (0..48_000).map(|_| anywhere()).collect();
    points.retain(|position| 0.0 < beside(*position));
    let spacing = (24.0 / 48_000f32).sqrt();
    let mut random = Random::new(13, 0);
    let mut noise = || 0.5 * spacing * random.next_gaussian() as f32;
    points.iter_mut().for_each(|p| *p += Vec3::new(noise(), noise(), noise()));
    let wall = as_by_default(PointCloud::from_positions(points));
    let rays = rays_from_above(1.9, 200);
    let (mut n_open, mut n_covered, mut n_missing) = (0, 0, 0);
    for (ray, hit) in rays.iter().zip(hits(&wall, &rays)) {
        let beside = beside(ray.origin.with_z(0.0));
        if beside < -3.0 * spacing {
            n_open += 1;
            n_covered += usize::from(!hit.is_miss());
        } else if spacing < beside {
            n_missing += usize::from(hit.is_miss());
        }
    }
    assert!(n_covered < n_open / 50 && n_missing == 0, "{n_covered} of {n_open}, {n_missing}");
}

//! Surfaces of points compared with the meshes that the points were taken from, in a short form of the benchmark.

use surfel_core::points::PointCloud;
use surfel_core::surface::SurfaceKind;
use surfel_tests::deviation::{Deviation, TrueViews};
use surfel_tests::ground_truth::{GroundTruth, shared_data};
use surfel_tests::sampling::{Sampling, mean_spacing};
use surfel_tests::scenes;
use surfel_tests::shapes;

const RESOLUTION: u32 = 128;

fn deviation(points: &PointCloud, mesh: &GroundTruth, kind: SurfaceKind) -> Deviation {
    let views = TrueViews::new(mesh, RESOLUTION);
    let hits = views.trace(&scenes::flat(points.clone(), kind));
    views.compare(&hits, mean_spacing(mesh, points.len()))
}

#[test]
fn the_bunny_of_points_looks_like_its_mesh() {
    let Some(data) = shared_data() else { return };
    let mesh = GroundTruth::from_file(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    // docs/quality.md has the figures of larger pictures; these limits allow about a tenth more.
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
        let figures = [
            100.0 * found.false_hits,
            100.0 * found.misses,
            found.depth_rms,
            found.normal_deg,
            found.normal_p95_deg,
        ];
        let is_within = figures.iter().zip(limits).all(|(figure, limit)| *figure <= limit);
        assert!(is_within, "{name}: {figures:?} exceeds {limits:?}");
    }
}

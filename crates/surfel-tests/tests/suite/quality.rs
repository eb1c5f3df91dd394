//! The Stanford bunny's vertices against its mesh, for every surface kind.

use surfel_core::points::{PointCloud, spacing};
use surfel_core::progress::NoProgress;
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_tests::deviation::compare;
use surfel_tests::ground_truth::{GroundTruth, shared_data};

#[test]
fn the_bunny_of_points_looks_like_its_mesh() {
    let Some(data) = shared_data() else { return };
    let mesh = GroundTruth::from_ascii_ply(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    let spacing = spacing(&cloud.positions, &NoProgress).unwrap();
    // Measured values are in docs/quality.md; these limits allow a tenth more for rounding on other machines.
    let bounds = [
        (SurfaceKind::Sphere, 0.130, 20.4),
        (SurfaceKind::Disc, 0.025, 13.6),
        (SurfaceKind::SplatMean, 0.025, 7.2),
        (SurfaceKind::Splat, 0.025, 6.6),
        (SurfaceKind::SplatFit, 0.063, 10.1),
    ];
    for (kind, silhouette, normal_deg) in bounds {
        let deviation = compare(&cloud, &mesh, kind, EdgeTest::AngularGap, spacing);
        let differing = deviation.false_hits + deviation.misses;
        assert!(differing < silhouette, "{}: {deviation:?}", kind.name());
        assert!(deviation.normal_deg < normal_deg, "{}: {deviation:?}", kind.name());
        assert!(deviation.misses < 0.001, "{}: {deviation:?}", kind.name());
    }
}

//! The Stanford bunny's vertices against its mesh, for every surface kind.

use surfel::points::{PointCloud, spacing};
use surfel::progress::Silent;
use surfel::surface::{Boundary, SurfaceKind};
use surfel_tests::mesh::{Mesh, shared_data};
use surfel_tests::quality::compare;

#[test]
fn the_bunny_of_points_looks_like_its_mesh() {
    let Some(data) = shared_data() else { return };
    let mesh = Mesh::from_ascii_ply(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    let spacing = spacing(&cloud.positions, &Silent).unwrap();
    // Measured values are in docs/quality.md; these leave a tenth for other machines' rounding.
    let bounds = [
        (SurfaceKind::Sphere, 0.130, 20.4),
        (SurfaceKind::Disc, 0.025, 13.6),
        (SurfaceKind::SplatMean, 0.025, 7.2),
        (SurfaceKind::Splat, 0.025, 6.6),
        (SurfaceKind::SplatFit, 0.063, 10.1),
    ];
    for (kind, silhouette, normal_deg) in bounds {
        let quality = compare(&cloud, &mesh, kind, Boundary::Gap, spacing);
        let differing = quality.false_hits + quality.misses;
        assert!(differing < silhouette, "{}: {quality:?}", kind.name());
        assert!(quality.normal_deg < normal_deg, "{}: {quality:?}", kind.name());
        assert!(quality.misses < 0.001, "{}: {quality:?}", kind.name());
    }
}

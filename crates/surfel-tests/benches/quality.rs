//! The figures of docs/quality.md: every surface kind against the shape its points were taken from.
#![expect(clippy::print_stdout, reason = "a benchmark prints its table")]

use surfel::points::{PointCloud, spacing};
use surfel::progress::Silent;
use surfel::surface::{Boundary, SurfaceKind};
use surfel_tests::mesh::{Mesh, shared_data};
use surfel_tests::quality::{Quality, compare};

fn main() {
    let Some(data) = shared_data() else { return };
    let mesh = Mesh::from_ascii_ply(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    let spacing = spacing(&cloud.positions, &Silent).unwrap();
    println!("the bunny's {} vertices against its mesh, spacing {spacing:.5}", cloud.len());
    println!("| surface | boundary | false hits | misses | normals | depth rms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (name, kind) in SurfaceKind::ALL {
        if kind == SurfaceKind::Points {
            continue;
        }
        for (test, boundary) in [("gap", Boundary::Gap), ("off", Boundary::Off)] {
            let Quality { false_hits, misses, normal_deg, depth_rms } =
                compare(&cloud, &mesh, kind, boundary, spacing);
            println!(
                "| `{name}` | {test} | {:.2} % | {:.2} % | {normal_deg:.2} deg | {depth_rms:.2} spacings |",
                100.0 * false_hits,
                100.0 * misses,
            );
        }
    }
}

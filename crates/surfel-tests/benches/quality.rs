//! The figures of docs/quality.md: every surface kind compared with the mesh that its points were taken from.
#![expect(clippy::print_stdout, reason = "a benchmark prints its table")]

use surfel_core::math::{Mat3, Vec3};
use surfel_core::points::{PointCloud, Preparation, Radius, prepare, spacing};
use surfel_core::progress::NoProgress;
use surfel_core::surface::{EdgeTest, SurfaceKind};
use surfel_tests::clouds;
use surfel_tests::deviation::{Deviation, compare};
use surfel_tests::ground_truth::{GroundTruth, shared_data};

fn main() {
    cube();
    // `cargo test` only checks that the program works.
    if is_complete() {
        bunny();
    }
}

/// Whether `cargo bench` runs this program.
fn is_complete() -> bool {
    std::env::args().any(|argument| argument == "--bench")
}

/// Compares a rotated cube of exact normals, whose sharp edges need the angular-gap test.
fn cube() {
    let turn = Mat3::from_axis_angle(Vec3::new(1.0, 2.0, 0.5).normalize(), 0.8);
    let corner = |i: u32| {
        turn * (Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0)
    };
    let side = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let sides =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let mesh = GroundTruth::new((0..8).map(corner).collect(), sides.map(side).concat());
    let mut cloud = clouds::cube(58, 0.45, 1);
    cloud.positions.iter_mut().for_each(|position| *position = turn * *position);
    cloud.normals.iter_mut().flatten().for_each(|normal| *normal = turn * *normal);
    println!("a cube's {} points", cloud.len());
    table(&cloud, &mesh);
}

fn bunny() {
    let Some(data) = shared_data() else { return };
    let mesh = GroundTruth::from_ascii_ply(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    println!("the bunny's {} vertices against its mesh", cloud.len());
    table(&cloud, &mesh);
    radii(&cloud, &mesh);
}

/// Compares radii of several sizes.
fn radii(cloud: &PointCloud, mesh: &GroundTruth) {
    let spacing = spacing(&cloud.positions, &NoProgress).unwrap();
    println!("| `splat`, angular-gap | false hits | misses | normals |");
    println!("| --- | --- | --- | --- |");
    for k in [6, 8, 10, 12] {
        let preparation = Preparation { radius: Radius::Adaptive { k }, ..Preparation::default() };
        let (cloud, _) = prepare(cloud.clone(), &preparation, &NoProgress).unwrap();
        let Deviation { false_hits, misses, normal_deg, .. } =
            compare(&cloud, mesh, SurfaceKind::Splat, EdgeTest::AngularGap, spacing);
        println!(
            "| `--radius adaptive:{k}` | {:.2} % | {:.2} % | {normal_deg:.2} deg |",
            100.0 * false_hits,
            100.0 * misses,
        );
    }
}

fn table(cloud: &PointCloud, mesh: &GroundTruth) {
    let spacing = spacing(&cloud.positions, &NoProgress).unwrap();
    println!("spacing {spacing:.5}");
    println!("| surface | edge test | false hits | misses | normals | depth rms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (name, kind) in SurfaceKind::ALL {
        if kind == SurfaceKind::Points || (kind != SurfaceKind::Disc && !is_complete()) {
            continue;
        }
        for (test, edge_test) in [("angular-gap", EdgeTest::AngularGap), ("off", EdgeTest::Off)] {
            let Deviation { false_hits, misses, normal_deg, depth_rms } =
                compare(cloud, mesh, kind, edge_test, spacing);
            println!(
                "| `{name}` | {test} | {:.2} % | {:.2} % | {normal_deg:.2} deg | {depth_rms:.2} spacings |",
                100.0 * false_hits,
                100.0 * misses,
            );
        }
    }
}

//! The figures of docs/quality.md: every surface kind against the shape its points were taken from.
#![expect(clippy::print_stdout, reason = "a benchmark prints its table")]

use surfel::math::{Mat3, Vec3};
use surfel::points::{PointCloud, Preparation, Radius, prepare, spacing};
use surfel::progress::Silent;
use surfel::surface::{Boundary, SurfaceKind};
use surfel_tests::clouds;
use surfel_tests::mesh::{Mesh, shared_data};
use surfel_tests::quality::{Quality, compare};

fn main() {
    cube();
    bunny();
}

/// Sharp edges with exact normals, turned against the axes: what the angular-gap test is for.
fn cube() {
    let turn = Mat3::from_axis_angle(Vec3::new(1.0, 2.0, 0.5).normalize(), 0.8);
    let corner = |i: u32| {
        turn * (Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0)
    };
    let side = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let sides =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let mesh = Mesh::new((0..8).map(corner).collect(), sides.map(side).concat());
    let mut cloud = clouds::cube(58, 0.45, 1);
    cloud.positions.iter_mut().for_each(|position| *position = turn * *position);
    cloud.normals.iter_mut().flatten().for_each(|normal| *normal = turn * *normal);
    println!("a cube's {} points", cloud.len());
    table(&cloud, &mesh);
}

fn bunny() {
    let Some(data) = shared_data() else { return };
    let mesh = Mesh::from_ascii_ply(&data.join("meshes/bun_zipper.ply"));
    let cloud = PointCloud::from_positions(mesh.vertices.clone());
    println!("the bunny's {} vertices against its mesh", cloud.len());
    table(&cloud, &mesh);
    radii(&cloud, &mesh);
}

/// What larger radii cost.
fn radii(cloud: &PointCloud, mesh: &Mesh) {
    let spacing = spacing(&cloud.positions, &Silent).unwrap();
    println!("| `splat`, gap | false hits | misses | normals |");
    println!("| --- | --- | --- | --- |");
    for k in [6, 8, 10, 12] {
        let preparation = Preparation { radius: Radius::Adaptive { k }, ..Preparation::default() };
        let (cloud, _) = prepare(cloud.clone(), &preparation, &Silent).unwrap();
        let Quality { false_hits, misses, normal_deg, .. } =
            compare(&cloud, mesh, SurfaceKind::Splat, Boundary::Gap, spacing);
        println!(
            "| `--radius adaptive:{k}` | {:.2} % | {:.2} % | {normal_deg:.2} deg |",
            100.0 * false_hits,
            100.0 * misses,
        );
    }
}

fn table(cloud: &PointCloud, mesh: &Mesh) {
    let spacing = spacing(&cloud.positions, &Silent).unwrap();
    println!("spacing {spacing:.5}");
    println!("| surface | boundary | false hits | misses | normals | depth rms |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for (name, kind) in SurfaceKind::ALL {
        if kind == SurfaceKind::Points {
            continue;
        }
        for (test, boundary) in [("gap", Boundary::Gap), ("off", Boundary::Off)] {
            let Quality { false_hits, misses, normal_deg, depth_rms } =
                compare(cloud, mesh, kind, boundary, spacing);
            println!(
                "| `{name}` | {test} | {:.2} % | {:.2} % | {normal_deg:.2} deg | {depth_rms:.2} spacings |",
                100.0 * false_hits,
                100.0 * misses,
            );
        }
    }
}

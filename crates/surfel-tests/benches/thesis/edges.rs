//! Normals at the edges of a cube, as in figures 7 to 11 of the thesis.

use super::clouds::{self, Subject};
use surfel_core::flat::FlatCloud;
use surfel_core::math::{DVec3, Ray, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::surface::{Align, EdgeTest, SurfaceKind};
use surfel_core::trace::{Simd, SurfaceHit, surface_hits};

/// Distance from an edge of the cube in which hits count, in sides of the cube.
const EDGE_WIDTH: f32 = 0.02;
/// Angle in degrees from which on a normal is wrong.
const WRONG_DEG: f32 = 30.0;

/// Asserts that outward normals of discs are right at the edges of a cube.
pub fn check() {
    let cube = clouds::cube();
    for row in rows().iter().filter(|row| row.label == "`disc`") {
        let Shares { visible, silhouettes } = wrong_edges(&cube, &flat(&cube, row), 128);
        assert!(visible < 0.1 && silhouettes < 0.1, "{visible}, {silhouettes}");
    }
}

/// Prints the percentages of wrong normals at the edges of a cube.
pub fn print_edges() {
    let outward = clouds::cube();
    let random = outward.with_random_signs();
    println!(
        "\n| surface | visible, outward | visible, random signs | silhouettes, outward | \
         silhouettes, random signs |\n{}|",
        "| --- ".repeat(5)
    );
    for row in rows() {
        let [outward, random] =
            [&outward, &random].map(|subject| wrong_edges(subject, &flat(subject, &row), 512));
        let columns = [outward.visible, random.visible, outward.silhouettes, random.silhouettes];
        let columns = columns.map(|share| format!("{:.1}", 100.0 * share));
        println!("| {} | {} |", row.label, columns.join(" | "));
    }
}

/// A surface whose normals are compared.
struct Row {
    label: String,
    kind: SurfaceKind,
    align: Align,
    edge_test: EdgeTest,
}

/// Returns every kind, and `splat` with every rule that turns normals before they are blended.
fn rows() -> Vec<Row> {
    let row = |label: String, kind, align, edge_test| Row { label, kind, align, edge_test };
    let (align, edge_test) = (Align::default(), EdgeTest::AngularGap);
    let kinds = SurfaceKind::ALL.into_iter();
    let kinds =
        kinds.filter(|(_, kind)| !matches!(kind, SurfaceKind::Points | SurfaceKind::Gaussian));
    let kinds = kinds.map(|(name, kind)| row(format!("`{name}`"), kind, align, edge_test));
    let rules = [(edge_test, ""), (EdgeTest::Off, " --edge-test off")];
    let rules = rules.into_iter().flat_map(|(edge_test, option)| {
        Align::ALL.map(|(name, align)| {
            let label = format!("`splat --align {name}{option}`");
            row(label, SurfaceKind::Splat, align, edge_test)
        })
    });
    kinds.chain(rules).collect()
}

fn flat(subject: &Subject, row: &Row) -> FlatCloud {
    let mut geometry = subject.geometry(row.kind);
    geometry.options.align = row.align;
    geometry.edge_test = row.edge_test;
    FlatCloud::new(&geometry, &NoProgress).unwrap()
}

/// Shares of pixels at edges whose normal is wrong.
struct Shares {
    /// Share at edges of which both sides are seen.
    visible: f64,
    /// Share at edges of which one side is seen.
    silhouettes: f64,
}

/// Compares normals at the edges of the cube with those of both sides and their mean.
fn wrong_edges(subject: &Subject, flat: &FlatCloud, resolution: u32) -> Shares {
    let view = subject.camera.view(DVec3::ZERO, resolution, resolution);
    let pixels = (0..resolution * resolution).map(|i| (i % resolution, i / resolution));
    let ray = |(x, y): (u32, u32)| view.ray(x as f32 + 0.5, y as f32 + 0.5);
    let rays: Vec<Ray> = pixels.map(ray).collect();
    let mut hits = vec![SurfaceHit::MISS; rays.len()];
    surface_hits(flat, Simd::detect(), &rays, &mut hits);
    let [mut visible, mut silhouettes] = [(0, 0); 2];
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| !hit.is_miss()) {
        let position = ray.at(hit.distance);
        let is_near = |axis: &usize| 1.0 - 2.0 * EDGE_WIDTH < position[*axis].abs();
        let sides: Vec<Vec3> = (0..3).filter(is_near).map(|axis| side(axis, position)).collect();
        let n_seen = sides.iter().filter(|normal| normal.dot(ray.direction) < 0.0).count();
        if sides.len() != 2 || n_seen == 0 {
            continue;
        }
        let (n, n_wrong) = if n_seen == 2 { &mut visible } else { &mut silhouettes };
        let between = (sides[0] + sides[1]).normalize();
        let angle = |normal: &Vec3| normal.angle_between(hit.normal).to_degrees();
        let least = sides.iter().chain([&between]).map(angle).fold(f32::INFINITY, f32::min);
        *n += 1;
        *n_wrong += u32::from(WRONG_DEG < least);
    }
    let share = |(n, n_wrong): (u32, u32)| f64::from(n_wrong) / f64::from(n.max(1));
    Shares { visible: share(visible), silhouettes: share(silhouettes) }
}

/// Returns the outward normal of the cube's side at a position.
fn side(axis: usize, position: Vec3) -> Vec3 {
    Vec3::AXES[axis] * position[axis].signum()
}

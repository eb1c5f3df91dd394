//! Points a second of building a tree and of refitting it to points that have moved, on all threads.
//!
//! `cargo bench -p surfel-tests --bench building`; `RAYON_NUM_THREADS` sets the threads, `POINTS` the
//! number of points (1 million by default).

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use surfel::flat::{FlatPoints, Refit};
use surfel::math::{Random, Vec3};
use surfel::points::PointCloud;
use surfel::progress::Silent;
use surfel::surface::SurfaceKind;

criterion_group!(benches, building);
criterion_main!(benches);

const KIND: SurfaceKind = SurfaceKind::Splat;

/// Waves with one point at a random place in each unit square, row by row.
fn waves(n_points: usize, phase: f32) -> PointCloud {
    let row_length = n_points.isqrt();
    let mut random = Random::new(1, 0);
    let mut cloud = PointCloud::default();
    let (mut normals, radii) = (Vec::new(), vec![1.0; n_points]);
    for i in 0..n_points {
        let x = (i / row_length) as f32 + random.next_f32();
        let y = (i % row_length) as f32 + random.next_f32();
        let (sin_x, cos_x) = (0.02 * x + phase).sin_cos();
        let (sin_y, cos_y) = (0.03 * y).sin_cos();
        cloud.positions.push(Vec3::new(x, y, 20.0 * sin_x * cos_y));
        normals.push(Vec3::new(-0.4 * cos_x * cos_y, 0.6 * sin_x * sin_y, 1.0).normalize());
    }
    PointCloud { normals: Some(normals), radii: Some(radii), ..cloud }
}

fn building(criterion: &mut Criterion) {
    let n_points = std::env::var("POINTS").ok().and_then(|text| text.parse().ok());
    let n_points = n_points.unwrap_or(1_000_000);
    let mut group = criterion.benchmark_group("tree");
    group.sample_size(20).throughput(Throughput::Elements(n_points as u64));
    let colors = vec![[188; 3]; n_points];
    let still = waves(n_points, 0.0);
    let build = || FlatPoints::new(&still, KIND, &colors, &Silent).unwrap();
    group.bench_function("build", |bencher| bencher.iter(build));
    let moving = [0.1, 0.2].map(|phase| waves(n_points, phase));
    let mut moving = moving.iter().cycle();
    let mut points = build();
    group.bench_function("refit", |bencher| {
        bencher.iter(|| {
            let cloud = moving.next().unwrap();
            let refit = points.refit(cloud, KIND, &colors, &Silent).unwrap();
            assert!(matches!(refit, Refit::Kept { .. }), "{refit:?}");
        });
    });
}

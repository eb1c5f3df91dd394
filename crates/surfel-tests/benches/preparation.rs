//! Points a second of each step of preparation, from bare positions to a cloud that can be traced.
//!
//! `cargo bench -p surfel-tests --bench preparation`; `RAYON_NUM_THREADS` sets the threads, `POINTS` the
//! number of points (1 million by default).

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use surfel_core::math::{Random, Vec3};
use surfel_core::points::neighbors::{NeighborMethod, Neighborhood, map_neighborhoods};
use surfel_core::points::{CleanOptions, clean, fit_plane, orient, prepare, subsample};
use surfel_core::points::{Orientation, PointCloud, Preparation, Subsample};
use surfel_core::progress::NoProgress;

criterion_group!(benches, normals, steps);
criterion_main!(benches);

fn n_points() -> usize {
    std::env::var("POINTS").ok().and_then(|text| text.parse().ok()).unwrap_or(1_000_000)
}

/// Returns points of a wavy surface in the order of a scanner: row by row, at random positions in unit squares.
fn in_scan_order() -> Vec<Vec3> {
    let n_points = n_points();
    let row_length = n_points.isqrt();
    let mut random = Random::new(1, 0);
    let point = |i| {
        let x = (i / row_length) as f32 + random.next_f32();
        let y = (i % row_length) as f32 + random.next_f32();
        Vec3::new(x, y, 20.0 * (0.02 * x).sin() * (0.03 * y).cos())
    };
    (0..n_points).map(point).collect()
}

fn shuffled(mut positions: Vec<Vec3>) -> Vec<Vec3> {
    let mut random = Random::new(2, 0);
    for i in (1..positions.len()).rev() {
        positions.swap(i, random.below(i as u64 + 1) as usize);
    }
    positions
}

/// Measures index, search and plane fit as one.
fn normals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("normals");
    group.sample_size(10).throughput(Throughput::Elements(n_points() as u64));
    let orders = [("scan order", in_scan_order()), ("shuffled", shuffled(in_scan_order()))];
    // About sixteen points are within a distance of 2.26.
    let searches = [
        (NeighborMethod::Knn, Neighborhood::Nearest(16)),
        (NeighborMethod::Knn, Neighborhood::Within(2.26)),
        (NeighborMethod::Grid, Neighborhood::Within(2.26)),
        (NeighborMethod::ScanLine, Neighborhood::Within(2.26)),
    ];
    for (order, positions) in &orders {
        for (method, query) in searches {
            let id = BenchmarkId::new(format!("{method} {query:?}"), order);
            group.bench_function(id, |bencher| {
                bencher.iter(|| {
                    let fit =
                        |point: usize, neighbors: &[_]| fit_plane(positions, point, neighbors);
                    map_neighborhoods(positions, method, query, &NoProgress, fit)
                });
            });
        }
    }
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("steps");
    group.sample_size(10).throughput(Throughput::Elements(n_points() as u64));
    let cloud = PointCloud::from_positions(in_scan_order());
    group.bench_function("clean", |bencher| {
        bencher.iter(|| clean(cloud.clone(), &CleanOptions::default(), &NoProgress))
    });
    group.bench_function("subsample spacing", |bencher| {
        bencher.iter(|| subsample(black_box(&cloud), Subsample::Spacing(2.0), 0, &NoProgress));
    });
    let preparation = Preparation::default();
    group.bench_function("prepare", |bencher| {
        bencher.iter(|| prepare(cloud.clone(), &preparation, &NoProgress));
    });
    let prepared = prepare(cloud.clone(), &preparation, &NoProgress).unwrap().0;
    let normals = prepared.normals().to_vec();
    group.bench_function("orient by spanning tree", |bencher| {
        bencher.iter(|| orient(&prepared, normals.clone(), Orientation::SpanningTree, &NoProgress));
    });
}

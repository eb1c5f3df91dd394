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
use surfel_tests::bench_args;
use surfel_tests::clouds::waves;

criterion_group!(benches, normals, steps);
criterion_main!(benches);

/// Returns the points in the order of a scanner: row by row.
fn in_scan_order() -> Vec<Vec3> {
    waves(n_points(), 0.0).positions
}

/// Returns the number of points.
fn n_points() -> usize {
    bench_args::n_points(1_000_000)
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

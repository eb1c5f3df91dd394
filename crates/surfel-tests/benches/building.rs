//! Points a second of building a tree and of refitting the tree to moved points, on all threads.
//!
//! `cargo bench -p surfel-tests --bench building`; `RAYON_NUM_THREADS` sets the threads, `POINTS` the
//! number of points (1 million by default).

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use surfel_core::flat::{FlatPoints, Refit};
use surfel_core::progress::NoProgress;
use surfel_core::surface::SurfaceKind;
use surfel_tests::bench_args::n_points;
use surfel_tests::clouds::waves;
use surfel_tests::scenes::columns;

criterion_group!(benches, building);
criterion_main!(benches);

const KIND: SurfaceKind = SurfaceKind::Splat;

fn building(criterion: &mut Criterion) {
    let n_points = n_points(1_000_000);
    let mut group = criterion.benchmark_group("tree");
    group.sample_size(20).throughput(Throughput::Elements(n_points as u64));
    let colors = vec![[188; 3]; n_points];
    let still = waves(n_points, 0.0);
    let build = || FlatPoints::new(columns(&still, KIND, &colors), &NoProgress).unwrap();
    group.bench_function("build", |bencher| bencher.iter(build));
    let moving = [0.1, 0.2].map(|phase| waves(n_points, phase));
    let mut moving = moving.iter().cycle();
    let mut points = build();
    group.bench_function("refit", |bencher| {
        bencher.iter(|| {
            let cloud = moving.next().unwrap();
            let refit = points.refit(columns(cloud, KIND, &colors));
            assert!(matches!(refit, Refit::Kept { .. }), "{refit:?}");
        });
    });
}

//! Whole scenes: the time to update a moving frame, the time of several objects relative to each on its own, and the time
//! until cancelled work stops.
//!
//! `cargo bench -p surfel-tests --bench scenes`; `RAYON_NUM_THREADS` sets the threads, `POINTS` the number
//! of points (by default 10 million at rest, and a million that move, of several objects and of the cancelled picture).
#![expect(clippy::print_stdout, reason = "a benchmark prints its figures")]

use criterion::{Criterion, criterion_group, criterion_main};
use std::f32::consts::{PI, TAU};
use std::time::{Duration, Instant};
use surfel_core::flat::{FlatMesh, FlatScene, Refit};
use surfel_core::math::{DAffine3, DQuat, DVec3, Ray, Vec3};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::scene::{
    Background, Camera, CloudGeometry, Geometry, Graph, Joint, Light, Material, Mesh, Morph, Node,
    Primitive, Projection, Scene, Skin, Sky, Sun, Transform,
};
use surfel_core::trace::{InstanceFilter, SceneHit, Simd, scene_hits};
use surfel_tests::bench_args::{is_timed, n_points};
use surfel_tests::clouds::waves;
use surfel_tests::scenes;

criterion_group!(benches, moving, deforming, several_objects, cancelling);
criterion_main!(benches);

fn cloud(n: usize) -> CloudGeometry {
    scenes::grey(waves(n, 0.0))
}

/// Returns a ball with bumps, of `2 * n_along * n_around` triangles.
fn bumpy_ball(n_along: usize, n_around: usize, phase: f32) -> Mesh {
    let position = |i: usize, j: usize| {
        // The ball is open at the poles, where triangles would have no area.
        let height = PI * (i as f32 + 0.5) / (n_along + 1) as f32;
        let turn = TAU * j as f32 / n_around as f32;
        let radius = 1.0 + 0.05 * (11.0 * turn + phase).sin() * (9.0 * height).sin();
        let (sin, cos) = height.sin_cos();
        radius * Vec3::new(sin * turn.cos(), sin * turn.sin(), cos)
    };
    let positions =
        (0..=n_along).flat_map(|i| (0..n_around).map(move |j| position(i, j))).collect();
    let vertex = |i: usize, j: usize| (i * n_around + j % n_around) as u32;
    let quads = (0..n_along).flat_map(|i| (0..n_around).map(move |j| (i, j)));
    let triangles = quads.flat_map(|(i, j)| {
        let [a, b] = [vertex(i, j), vertex(i + 1, j)];
        let [c, d] = [vertex(i + 1, j + 1), vertex(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Mesh { positions, triangles: triangles.collect(), ..Mesh::default() }
}

fn camera(position: DVec3, focal_point: DVec3) -> Camera {
    let projection = Projection::Perspective { view_angle_deg: 40.0 };
    Camera { position, focal_point, view_up: DVec3::Z, projection }
}

fn scene(graph: Graph, camera: Camera) -> Scene {
    Scene { graph, lights: Vec::new(), background: Background::Transparent, camera }
}

/// Returns a graph of one object with a transform.
fn thing(geometry: Geometry, material: Material, translation: DVec3, scale: f64) -> Graph {
    let mut graph = Graph::from_geometry(geometry, material);
    graph.nodes[0].transform =
        Transform::Trs { translation, rotation: DQuat::IDENTITY, scale: DVec3::splat(scale) };
    graph
}

fn moving(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(20);
    let mut graph =
        Graph::from_geometry(Geometry::Points(cloud(n_points(10_000_000))), Material::MATTE);
    graph.geometries.push(Geometry::Triangles(bumpy_ball(100, 200, 0.0)));
    graph.nodes.extend((0..100).map(|i| {
        let parts = vec![Primitive { geometry: 1, material: 0 }];
        Node { primitives: parts, ..Node::new(format!("ball {i}")) }
    }));
    let camera = camera(DVec3::new(0.0, 0.0, 300.0), DVec3::ZERO);
    let mut flat = FlatScene::new(&scene(graph.clone(), camera), &NoProgress).unwrap();
    graph.release_static();
    let mut time = 0.0;
    group.bench_function("100 instances moved", |bencher| {
        bencher.iter(|| {
            time += 0.04;
            for (i, node) in graph.nodes[1..].iter_mut().enumerate() {
                let turn = DQuat::from_rotation_z(time + i as f64);
                let position = turn * DVec3::new(30.0 * i as f64, 0.0, 40.0);
                node.transform = Transform::Trs {
                    translation: position,
                    rotation: turn,
                    scale: DVec3::splat(5.0),
                };
            }
            flat.update(&graph, &NoProgress).unwrap();
            assert_eq!(flat.instances.len(), 101);
        });
    });
    drop(flat);
    let meshes = [0.0, 0.3].map(|phase| bumpy_ball(500, 1000, phase));
    let mut mesh = FlatMesh::new(&meshes[0], &NoProgress).unwrap().triangles;
    let mut next = meshes.iter().cycle();
    group.bench_function("1 million triangles deformed", |bencher| {
        bencher.iter(|| {
            let Mesh { positions, triangles, .. } = next.next().unwrap();
            let refit = mesh.refit(positions, triangles);
            assert!(matches!(refit, Refit::Kept { .. }), "{refit:?}");
        });
    });
    group.finish();
}

/// Measures the update of deformed clouds, from weights and joints to boxes.
fn deforming(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(20);
    let points = cloud(n_points(1_000_000));
    let n = points.cloud().len();
    let offsets = points.cloud().positions.iter().map(|position| 0.01 * position.x * Vec3::Z);
    let morph = Morph { positions: offsets.collect(), ..Morph::default() };
    let joints =
        points.cloud().positions.iter().map(|position| (position.x / 1000.0).clamp(0.0, 1.0));
    let weights = joints.map(|weight| [weight, 1.0 - weight, 0.0, 0.0]).collect();
    let skin = Skin { joints: vec![[0, 1, 0, 0]; n], weights };
    let camera = camera(DVec3::new(0.0, 0.0, 300.0), DVec3::ZERO);
    let mut measure = |name: &str, points: CloudGeometry| {
        let mut graph = Graph::from_geometry(Geometry::Points(points), Material::MATTE);
        graph.nodes.extend([Node::new("left"), Node::new("right")]);
        let joint = |node| Joint { node, joint_from_mesh: DAffine3::IDENTITY };
        graph.nodes[0].joints = vec![joint(1), joint(2)];
        let mut flat = FlatScene::new(&scene(graph.clone(), camera), &NoProgress).unwrap();
        let mut time = 0.0;
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                time += 0.04f64;
                graph.nodes[0].morph_weights = vec![time.sin() as f32];
                graph.nodes[1].transform = Transform::from_translation(time.sin() * DVec3::Z);
                flat.update(&graph, &NoProgress).unwrap();
            });
        });
    };
    let morphed = scenes::changed(&points, |cloud| cloud.morphs = vec![morph]);
    measure("1 million points morphed", morphed);
    let skinned = scenes::changed(&points, |cloud| cloud.skin = Some(skin));
    measure("1 million points skinned by joints", skinned);
    group.finish();
}

/// Measures all primary rays of a scene of points, a mesh and a mirror, and for each of these on its own the rays that end
/// on it.
fn several_objects(criterion: &mut Criterion) {
    const SIZE: u32 = 1024;
    let mut group = criterion.benchmark_group("primary rays");
    group.sample_size(20);
    let floor = Mesh {
        positions: [(0.0, -300.0), (1000.0, -300.0), (1000.0, 0.0), (0.0, 0.0)]
            .map(|(x, y)| Vec3::new(x, y, -10.0))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let ball = bumpy_ball(150, 304, 0.0);
    let things = [
        thing(Geometry::Points(cloud(1_000_000)), Material::MATTE, DVec3::ZERO, 1.0),
        thing(Geometry::Triangles(ball), Material::MATTE, DVec3::new(500.0, 200.0, 140.0), 130.0),
        thing(Geometry::Triangles(floor), Material::MIRROR, DVec3::ZERO, 1.0),
    ];
    let camera = camera(DVec3::new(500.0, -700.0, 420.0), DVec3::new(500.0, 250.0, 20.0));
    let flat = |graph: Graph| FlatScene::new(&scene(graph, camera), &NoProgress).unwrap();
    let mut together = Graph::default();
    for graph in &things {
        together.append(graph.clone());
    }
    let together = flat(together);
    let view = camera.view(together.origin, SIZE, SIZE);
    // Rays are in cells of four by four pixels, like those of pictures.
    let cells = (0..SIZE * SIZE / 16).flat_map(|cell| (0..16).map(move |i| (cell, i)));
    let pixel = |(cell, i): (u32, u32)| (cell % 256 * 4 + i % 4, cell / 256 * 4 + i / 4);
    let rays: Vec<Ray> =
        cells.map(pixel).map(|(x, y)| view.ray(x as f32 + 0.5, y as f32 + 0.5)).collect();
    let mut hits = vec![SceneHit::MISS; rays.len()];
    let trace = |flat: &FlatScene, rays: &[Ray], hits: &mut [SceneHit]| {
        for (rays, hits) in rays.chunks(4096).zip(hits.chunks_mut(4096)) {
            scene_hits(flat, Simd::detect(), InstanceFilter::All, rays, hits);
        }
    };
    trace(&together, &rays, &mut hits);
    let separate: Vec<(FlatScene, Vec<Ray>)> = things
        .into_iter()
        .enumerate()
        .map(|(i, graph)| {
            let is_own = |hit: &SceneHit| hit.instance == i as u32 || (i == 0 && hit.is_miss());
            let own = rays.iter().zip(&hits).filter(|(_, hit)| is_own(hit)).map(|(ray, _)| *ray);
            let own: Vec<Ray> = own.collect();
            assert!(rays.len() < 50 * own.len(), "{} rays end on thing {i}", own.len());
            (flat(graph), own)
        })
        .collect();
    let mut others = hits.clone();
    let mut all = || trace(&together, &rays, &mut hits);
    let mut each = || {
        for (flat, rays) in &separate {
            trace(flat, rays, &mut others[..rays.len()]);
        }
    };
    group.bench_function("together", |bencher| bencher.iter(&mut all));
    group.bench_function("each on its own", |bencher| bencher.iter(&mut each));
    group.finish();
    if is_timed() {
        let [median, least] = ratio_in_turn(&mut all, &mut each);
        println!(
            "together : each on its own, in turn: {median:.3} (median), {least:.3} (least times)"
        );
    }
}

/// Returns how many times as long the first takes as the second, on a machine of varying speed: the median of the
/// ratios of consecutive runs, and the ratio of the least times.
fn ratio_in_turn(first: &mut dyn FnMut(), second: &mut dyn FnMut()) -> [f64; 2] {
    let secs = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    let times: Vec<[f64; 2]> = (0..40).map(|_| [secs(first), secs(second)]).collect();
    let mut ratios: Vec<f64> = times.iter().map(|[a, b]| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    let least = |i: usize| times.iter().map(|pair| pair[i]).fold(f64::INFINITY, f64::min);
    [ratios[ratios.len() / 2], least(0) / least(1)]
}

/// Cancels work at a time.
struct CancelAt(Instant);

impl Progress for CancelAt {
    fn is_cancelled(&self) -> bool {
        self.0 < Instant::now()
    }
}

/// Measures the time from the cancellation of a picture until all work on it has stopped.
fn cancelling(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cancelled picture");
    group.sample_size(50);
    let points = Geometry::Points(cloud(n_points(1_000_000)));
    let sun =
        Sun { direction: Vec3::new(0.6, 0.0, 0.8), color: Vec3::ONE, angular_diameter_deg: 0.5 };
    let (zenith, ground) = (Vec3::splat(0.3), Vec3::splat(0.1));
    let sky = Sky { up: Vec3::Z, zenith, ground, ao_distance: 100.0 };
    let scene = Scene {
        lights: vec![Light::Sun(sun), Light::Sky(sky)],
        ..scene(
            Graph::from_geometry(points, Material::MATTE),
            camera(DVec3::new(500.0, -300.0, 420.0), DVec3::new(500.0, 350.0, 20.0)),
        )
    };
    let flat = FlatScene::new(&scene, &NoProgress).unwrap();
    let settings = Settings {
        width: 1280,
        height: 720,
        samples_per_pixel: 16,
        noise_threshold: 0.0,
        light_samples: 64,
        max_depth: 3,
        seed: 0,
        point_size: 1.0,
        with_aovs: false,
    };
    let renderer = CpuRenderer { simd: Simd::detect() };
    group.bench_function("1280 x 720", |bencher| {
        bencher.iter_custom(|n| {
            (0..n)
                .map(|i| {
                    // The work is cancelled at several stages of it.
                    let until = Instant::now() + Duration::from_micros(20_000 + 7_919 * (i % 10));
                    let stopped = renderer.render(&flat, &settings, &CancelAt(until));
                    let late = until.elapsed();
                    assert!(matches!(stopped, Err(surfel_core::Error::Cancelled)));
                    late
                })
                .sum()
        });
    });
    group.finish();
}

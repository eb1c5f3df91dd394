//! Work on pictures beside other work.

use super::*;
use crate::Error;
use crate::description::ObjectDescription;
use crate::memory_files::{FileContent, MemoryContent};
use crate::resolve::resolve;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;
use surfel_core::math::Random;
use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, Subsample};
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Graph, Material, Primitive};
use surfel_formats::{FileInfo, SaveOptions};

/// Holds up the threads of a picture at the end of their first tile.
#[derive(Default)]
struct Halt {
    n_held: AtomicUsize,
    is_over: AtomicBool,
}

impl Halt {
    fn wait_until(&self, is_reached: impl Fn() -> bool) {
        while !is_reached() {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Progress for Halt {
    fn advance(&self, _: u64) {
        self.n_held.fetch_add(1, Ordering::Relaxed);
        self.wait_until(|| self.is_over.load(Ordering::Relaxed));
    }
}

fn scene_of_a_plane(name: &str) -> (LiveScene, SceneDescription) {
    let name = format!("surfel-live-{name}-{}.ply", std::process::id());
    let path = std::env::temp_dir().join(name);
    let mut random = Random::new(1, 0);
    let mut next = || random.below(1000) as f32;
    let positions = (0..400).map(|_| Vec3::new(next(), next(), 0.0)).collect();
    let cloud = PointCloud::from_positions(positions);
    surfel_formats::save(&path, &cloud, &SaveOptions::default(), &NoProgress).unwrap();
    let description = SceneDescription { files: vec![path.clone()], ..SceneDescription::default() };
    let scene = LiveScene::open(&description, UseCase::Viewers, &NoProgress).unwrap();
    std::fs::remove_file(path).unwrap();
    (scene, description)
}

#[test]
fn settings_change_while_all_threads_of_a_picture_are_busy() {
    let (scene, mut description) = scene_of_a_plane("change");
    (description.picture.spp, description.picture.light_samples) = (Some(1), Some(1));
    let view = scene.view(&description, &NoProgress).unwrap();
    let halt = Halt::default();
    let n_threads = scene.picture_threads().unwrap().current_num_threads();
    let mut changed = description.clone();
    changed.objects_default.surface.radius_scale = Some(1.5);
    thread::scope(|scope| {
        let picture = scope.spawn(|| scene.render(&view, &halt));
        halt.wait_until(|| halt.n_held.load(Ordering::Relaxed) == n_threads);
        let (sender, receiver) = channel();
        let (scene, changed) = (&scene, &changed);
        scope.spawn(move || sender.send(scene.view(changed, &NoProgress).is_ok()));
        let is_changed = receiver.recv_timeout(Duration::from_secs(120));
        halt.is_over.store(true, Ordering::Relaxed);
        assert_eq!(is_changed, Ok(true));
        assert!(picture.join().unwrap().is_ok());
    });
}

#[test]
fn an_added_object_joins_the_scene_and_leaves_it() {
    let (scene, description) = scene_of_a_plane("added");
    let n_instances = |description: &SceneDescription| {
        scene.view(description, &NoProgress).unwrap().flat.instances.len()
    };
    let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 50.0);
    let cloud = PointCloud::from_positions((0..400).map(corner).collect());
    let mut more = description.clone();
    more.memory.insert("memory:more", MemoryContent::Points(Arc::new(cloud), None));
    more.objects.push(ObjectDescription::new("memory:more"));
    assert_eq!(n_instances(&more), 2);
    // The points of the start are prepared once for both.
    assert!(scene.is_prepared(&more) && scene.is_prepared(&description));
    assert_eq!(n_instances(&description), 1);
    let mut other = more.clone();
    other.objects[0].settings.preparation.subsample = Some(Subsample::Stride(2.0));
    assert!(!scene.is_prepared(&other));
    assert_eq!(n_instances(&other), 2);
    assert!(scene.is_prepared(&description));
}

#[test]
fn an_added_object_leaves_the_trees_of_the_others() {
    let (scene, description) = scene_of_a_plane("trees");
    let first = scene.view(&description, &NoProgress).unwrap();
    let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 5.0);
    let cloud = PointCloud::from_positions((0..400).map(corner).collect());
    let mut more = description.clone();
    more.memory.insert("memory:more", MemoryContent::Points(Arc::new(cloud), None));
    more.objects.push(ObjectDescription::new("memory:more"));
    let second = scene.view(&more, &NoProgress).unwrap();
    let is_same = |a: &LiveView, b: &LiveView, i: usize| {
        Arc::ptr_eq(&a.flat.geometries[i], &b.flat.geometries[i])
    };
    assert!(is_same(&first, &second, 0));
    // Another surface of the added object.
    more.objects[0].settings.surface.radius_scale = Some(1.5);
    let third = scene.view(&more, &NoProgress).unwrap();
    assert!(is_same(&first, &third, 0) && !is_same(&second, &third, 1));
    // Another surface of all.
    more.objects_default.surface.radius_scale = Some(2.0);
    let fourth = scene.view(&more, &NoProgress).unwrap();
    assert!(!is_same(&first, &fourth, 0));
    // Trees that no view has are freed.
    scene.release();
    let tree = Arc::downgrade(&fourth.flat.geometries[0]);
    assert!(tree.upgrade().is_some());
    drop(fourth);
    assert!(tree.upgrade().is_none() && !scene.is_prepared(&more));
    assert_eq!(scene.view(&more, &NoProgress).unwrap().flat.instances.len(), 2);
}

#[test]
fn choices_are_those_of_a_picture_of_the_same_points() {
    let path = std::env::temp_dir().join(format!("surfel-live-kept-{}.ply", std::process::id()));
    // A wall, and far from it a floor.
    let wall = (0..400).map(|i| Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32));
    let floor = (0..900).map(|i| Vec3::new(500.0 + (i % 30) as f32, (i / 30) as f32, -40.0));
    let cloud = PointCloud::from_positions(wall.chain(floor).collect());
    surfel_formats::save(&path, &cloud, &SaveOptions::default(), &NoProgress).unwrap();
    let mut description =
        SceneDescription { files: vec![path.clone()], ..SceneDescription::default() };
    let scene = LiveScene::open(&description, UseCase::Viewers, &NoProgress).unwrap();
    let all = scene.view(&description, &NoProgress).unwrap();
    for filter in ["z > -1", "z < -1", "x < 10 && z > 3"] {
        description.objects_default.preparation.filter = Some(filter.parse().unwrap());
        let view = scene.view(&description, &NoProgress).unwrap();
        let rendered = resolve(&description, &NoProgress).unwrap().description;
        assert_eq!(view.description.camera, rendered.camera, "{filter}");
        assert_eq!(view.description.sun, rendered.sun);
        assert_eq!(view.description.world.up, rendered.world.up);
        assert_ne!(view.description.camera, all.description.camera, "{filter}");
        // Points are still told by the index that they have in the file.
        assert_eq!(view.color_source, all.color_source);
        let sources = view.sources()[0];
        let is_floor = filter == "z < -1";
        assert!(sources.iter().all(|source| (400 <= *source) == is_floor), "{filter}");
    }
    description.objects_default.preparation.filter = Some("z > 1e6".parse().unwrap());
    let error = scene.view(&description, &NoProgress).unwrap_err();
    assert!(matches!(error, Error::NoPointKept { key: Some("filter"), .. }), "{error}");
    assert_eq!(error.to_string(), "no point meets z > 1000000");
    std::fs::remove_file(path).unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn threads_of_pictures_have_the_lowest_priority() {
    let (scene, _) = scene_of_a_plane("priority");
    // The niceness is the 19th value of the file, the 17th behind the name of the thread.
    let niceness = || {
        let file = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let after_name = file.rsplit_once(") ").unwrap().1.to_owned();
        after_name.split(' ').nth(16).unwrap().parse::<i32>().unwrap()
    };
    assert_eq!(scene.picture_threads().unwrap().install(niceness), 19);
    assert_eq!(scene.preparation_threads.install(niceness), niceness());
}

#[test]
fn points_of_several_clouds_of_one_material_have_their_own_indices() {
    let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
    let whole = PointCloud::from_positions((0..400).map(corner).collect());
    // The first points of the first cloud are nowhere.
    let mut broken = whole.clone();
    broken.positions[..5].fill(Vec3::NAN);
    let mut graph = Graph::from_geometry(Geometry::Points(broken), Material::MATTE);
    graph.geometries.push(Geometry::Points(whole));
    graph.nodes[0].primitives.push(Primitive { geometry: 1, material: 0 });
    let mut description = SceneDescription::of_files(["memory:two"]);
    let content = MemoryContent::File(Arc::new(FileContent { graph, info: FileInfo::default() }));
    description.memory.insert("memory:two", content);
    let scene = LiveScene::open(&description, UseCase::Viewers, &NoProgress).unwrap();
    let view = scene.view(&description, &NoProgress).unwrap();
    let first = |sources: Vec<&[u32]>| sources.iter().map(|source| source[0]).collect::<Vec<u32>>();
    assert_eq!(first(view.sources()), [5, 0]);
    let resolved = resolve(&description, &NoProgress).unwrap();
    let built = resolved.build_trees(&NoProgress).unwrap();
    assert_eq!(first(built.sources()), [5, 0]);
}

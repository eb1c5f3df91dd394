//! Facts that pages get about files, and the command lines that they export.

use super::*;
use crate::report::Verbosity;
use surfel::memory_files::MemoryContent;
use surfel_core::math::DVec3;
use surfel_core::scene::Mesh;

fn open(startup: SceneDescription) -> FileSceneProvider {
    let typed = vec![PathBuf::from("scene.toml")];
    FileSceneProvider::open(startup, typed, Limits::default(), &Report::new(Verbosity::Quiet))
        .unwrap()
}

fn corners() -> Vec<Vec3> {
    (0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0)).collect()
}

/// A scene of a mesh and a cloud in memory.
fn startup() -> SceneDescription {
    let triangles = vec![[0, 19, 399]];
    let mesh = Mesh { positions: corners(), triangles, ..Mesh::default() };
    let cloud = PointCloud::from_positions(corners());
    let mut startup = SceneDescription::of_files(["memory:0:mesh", "memory:1:cloud"]);
    let memory = &mut startup.memory;
    memory.insert("memory:0:mesh", MemoryContent::Triangles(Arc::new(mesh)));
    memory.insert("memory:1:cloud", MemoryContent::Points(Arc::new(cloud), None));
    startup
}

fn kinds(provider: &FileSceneProvider) -> Vec<Value> {
    provider.objects().iter().map(|object| object["kind"].clone()).collect()
}

#[test]
fn what_was_read_decides_whether_an_object_is_a_cloud() {
    assert_eq!(kinds(&open(startup())), ["triangles", "points"]);
    let lines: String = corners().iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z)).collect();
    let file = std::env::temp_dir().join(format!("surfel-kinds-{}.obj", std::process::id()));
    std::fs::write(&file, [lines, "f 1 20 400\n".to_owned()].concat()).unwrap();
    let mut startup = SceneDescription::of_files([&file]);
    assert_eq!(kinds(&open(startup.clone())), ["triangles"]);
    startup.objects_default.preparation.vertices = Some(true);
    assert_eq!(kinds(&open(startup)), ["points"]);
    std::fs::remove_file(&file).unwrap();
}

#[test]
fn classes_of_noise_are_hidden_where_others_are_shown() {
    let hidden = |classes: [u8; 2]| {
        let classification = (0..400).map(|i| classes[i % 2]).collect();
        let cloud = PointCloud {
            classification: Some(classification),
            ..PointCloud::from_positions(corners())
        };
        let mut startup = SceneDescription::of_files(["memory:0:cloud"]);
        let content = MemoryContent::Points(Arc::new(cloud), None);
        startup.memory.insert("memory:0:cloud", content);
        let info = open(startup).info();
        let classes = info["classes"].as_array().unwrap().iter();
        classes.map(|one| one["is_hidden"] == json!(true)).collect::<Vec<_>>()
    };
    assert_eq!(hidden([2, 18]), [false, true]);
    assert_eq!(hidden([7, 18]), [false, false]);
}

#[test]
fn exported_commands_restore_defaults_that_a_scene_file_changes() {
    let mut startup = startup();
    startup.picture.spp = Some(64);
    startup.camera.lock = Some(true);
    let provider = open(startup);
    let mut settings = provider.startup_settings();
    settings.insert("spp".into(), json!(4));
    settings.insert("camera".into(), json!({ "lock": false }));
    let command = provider.export(&settings, &NoProgress).unwrap().command;
    let has = |option: &str| command.split(' ').any(|word| word == option);
    assert!(has("--spp=4") && has("--camera-lock=false"), "{command}");
}

#[test]
fn facts_are_found_once() {
    let provider = open(startup());
    assert_eq!(provider.info(), provider.facts());
    let other = FileSceneProvider { info: json!({ "name": "found" }), ..provider };
    assert_eq!(other.info()["name"], "found");
}

#[test]
fn an_export_chooses_once_unless_its_picture_lacks_a_setting() {
    struct Choices(Mutex<Vec<String>>, bool);
    impl Progress for Choices {
        fn note(&self, line: &str) {
            self.0.lock().unwrap().push(line.to_owned());
        }
        fn is_cancelled(&self) -> bool {
            self.1
        }
    }
    let provider = open(startup());
    let mut settings = provider.startup_settings();
    let mut exported = |is_cancelled, scale_bar: bool| {
        settings.insert("scale_bar".into(), json!(scale_bar));
        let choices = Choices(Mutex::default(), is_cancelled);
        let export = provider.export(&settings, &choices);
        let choices = choices.0.into_inner().unwrap();
        (export, choices.iter().filter(|line| line.starts_with("camera at")).count())
    };
    let (export, n_cameras) = exported(false, false);
    assert_eq!((n_cameras, export.unwrap().command.contains("scale-bar")), (1, false));
    let (export, n_cameras) = exported(false, true);
    assert_eq!((n_cameras, export.unwrap().command.contains("scale-bar")), (2, false));
    assert!(matches!(exported(true, false).0, Err(Error::Cancelled)));
}

#[test]
fn a_camera_that_a_scene_file_may_have_is_one_of_a_page() {
    let mut startup = startup();
    startup.camera.view_angle = Some(0.05);
    let provider = open(startup);
    let prepared = provider.prepare(&provider.initial_settings(40, 30), &NoProgress).unwrap();
    let camera = provider.camera(&prepared.settings["camera"]).unwrap();
    assert_eq!(camera, prepared.flat.camera);
}

#[test]
fn points_of_a_later_file_of_a_sequence_have_no_columns_of_the_first() {
    let cloud = |n: usize| {
        let positions = corners().into_iter().take(n).collect();
        let cloud =
            PointCloud { intensity: Some(vec![7.0; n]), ..PointCloud::from_positions(positions) };
        MemoryContent::Points(Arc::new(cloud), None)
    };
    let mut object = ObjectDescription::new("memory:0:a");
    object.files.push("memory:1:b".into());
    object.fps = Some(1.0);
    let mut startup = SceneDescription::default();
    startup.objects.push(object);
    startup.memory.insert("memory:0:a", cloud(100));
    startup.memory.insert("memory:1:b", cloud(400));
    let provider = open(startup);
    let mut settings = provider.startup_settings();
    settings.insert("time".into(), json!(1));
    let prepared = provider.prepare(&settings, &NoProgress).unwrap();
    let position = DVec3::new(1.0, 2.0, 3.0);
    let indices = (0..400).map(|primitive_idx| {
        let (instance_idx, normal, depth) = (0, Vec3::Z, 1.0);
        let picked = PickedPoint { instance_idx, primitive_idx, position, normal, depth };
        let facts = (prepared.describe)(&prepared.flat, &picked);
        assert_eq!(facts["columns"], json!([]));
        assert_eq!(facts["position"], json!([1.0, 2.0, 3.0]));
        facts["index"].as_u64().unwrap()
    });
    let mut indices: Vec<u64> = indices.collect();
    indices.sort_unstable();
    assert!(indices.into_iter().eq(0..400));
}

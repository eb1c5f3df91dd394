//! Cameras of glTF files: which is taken, what it looks at, and how a dry run tells it.

use super::common::{Folder, SMALL, fail, gltf_with_cameras, read_png, shot, succeed};
use serde_json::{Value, json};

fn site() -> (Folder, String) {
    let folder = Folder::new();
    let file = folder.write("eye.gltf", gltf_with_cameras());
    (folder, file)
}

/// What a dry run tells of the camera.
fn told(command: &str, file: &str, options: &[&str]) -> Value {
    let told = succeed(&[&[command, file, "--dry-run"], options].concat());
    serde_json::from_str::<Value>(&told).unwrap()["camera"].take()
}

fn assert_near(found: &Value, expected: [f64; 3]) {
    let numbers = found.as_array().unwrap().iter().map(|value| value.as_f64().unwrap());
    assert!(numbers.zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found} {expected:?}");
}

#[test]
fn a_camera_of_the_file_is_taken_unless_another_is_asked_for() {
    let (_folder, file) = site();
    let own = told("render", &file, &[]);
    // Turned to have Z up; it looks as far as the middle of the triangle.
    assert_near(&own["position"], [0.0, -7.0, 1.0]);
    assert_near(&own["focal_point"], [0.0, 0.0, 1.0]);
    assert!((own["view_angle"].as_f64().unwrap() - 0.5f64.to_degrees()).abs() < 1e-4);
    let other = told("render", &file, &["--camera-azimuth-angle", "30"]);
    assert_ne!(other["position"], own["position"]);
}

#[test]
fn a_camera_of_the_file_sees_as_wide_as_is_asked_for() {
    let (folder, file) = site();
    let wide = told("render", &file, &["--camera-view-angle", "60"]);
    assert_near(&wide["position"], [0.0, -7.0, 1.0]);
    assert_eq!(wide["view_angle"], json!(60.0));
    assert_ne!(shot(&folder, &[&file, "--camera-view-angle", "60"]), shot(&folder, &[&file]));
}

#[test]
fn a_turntable_goes_about_what_the_camera_of_the_file_sees() {
    let (folder, file) = site();
    let turn = folder.path("f#.png");
    let options = ["--turntable", "4", "--fps", "1", "--light", "none", "--background", "#000"];
    succeed(&[&["animate", &file, "-o", &turn], &options[..], &SMALL].concat());
    // Half way the camera sees the back of the triangle, as far away as before.
    let n_seen = |frame: u32| {
        let (.., samples) = read_png(folder.path(&format!("f{frame}.png")));
        samples.chunks(3).filter(|pixel| pixel[0] != 0).count()
    };
    assert!(0 < n_seen(1) && n_seen(1).abs_diff(n_seen(3)) < 12, "{} {}", n_seen(1), n_seen(3));
}

#[test]
fn a_dry_run_of_a_film_keeps_the_movement_of_the_camera() {
    let (folder, file) = site();
    let name = ["--camera-name", "eye"];
    assert_eq!(told("animate", &file, &name), json!({ "name": "eye" }));
    let (made, again) = (folder.path("made#.png"), folder.path("again#.png"));
    let film = ["animate", &file, "-o", &made, "--fps", "1"];
    succeed(&[&film[..], &name, &SMALL].concat());
    let film = ["animate", &file, "-o", &again, "--fps", "1", "--dry-run"];
    let told = succeed(&[&film[..], &name, &SMALL].concat());
    succeed(&["animate", &folder.write("told.json", told)]);
    let frame = |name: &str| read_png(folder.path(name)).3;
    assert!(frame("made1.png") == frame("again1.png") && frame("made2.png") == frame("again2.png"));
    assert!(frame("made1.png") != frame("made2.png"));
}

#[test]
fn a_camera_of_any_angle_comes_back_from_a_dry_run() {
    let folder = Folder::new();
    for angle in ["0.01", "3.1"] {
        let text = gltf_with_cameras().replace("\"yfov\":0.5", &format!("\"yfov\":{angle}"));
        let file = folder.write("eye.gltf", text);
        let told = succeed(&["render", &file, "--dry-run"]);
        let told = folder.write("told.json", told);
        assert_eq!(shot(&folder, &[&told]), shot(&folder, &[&file]), "{angle}");
    }
}

#[test]
fn a_camera_is_chosen_by_its_name() {
    let (folder, file) = site();
    let eye = told("render", &file, &["--camera-name", "still"]);
    assert_near(&eye["position"], [0.0, -7.0, 1.0]);
    let scene = "camera.name = \"eye\"\n[[object]]\nfile = \"eye.gltf\"\n";
    let scene = folder.write("scene.toml", scene);
    assert_eq!(shot(&folder, &[&scene]), shot(&folder, &[&file, "--camera-name", "eye"]));
    assert_ne!(shot(&folder, &[&scene]), shot(&folder, &[&file]));
    // The command line wins.
    let near = ["--camera-position", "1,-3,1"];
    assert_eq!(
        shot(&folder, &[&[scene.as_str()], &near[..]].concat()),
        shot(&folder, &[&[file.as_str()], &near[..]].concat())
    );
    let text = fail(&["render", &file, "-o", "no.png", "--camera-name", "ey"], 2);
    assert!(text.contains("still, eye"), "{text}");
    let both = ["--camera-name", "eye", "--camera-position", "1,2,3"];
    fail(&[&["render", &file, "-o", "no.png"], &both[..]].concat(), 2);
}

#[test]
fn a_camera_that_is_held_stays_where_it_was_when_the_scene_moves_it() {
    let (folder, file) = site();
    let orbit = "camera.name = \"eye\"\n[[object]]\nfile = \"eye.gltf\"\n[[animation]]\n\
        object = \"camera\"\nkind = \"orbit\"\nseconds = 4\n";
    let orbit = folder.write("orbit.toml", orbit);
    for scene in [&["--camera-name", "eye", &file][..], &[&orbit]] {
        let at = |time, more: &[&str]| shot(&folder, &[scene, &["--time", time], more].concat());
        assert_ne!(at("1", &[]), at("0", &[]));
        assert_eq!(at("1", &["--camera-still"]), at("0", &[]));
    }
    let told = succeed(&["render", &orbit, "--camera-still", "--dry-run"]);
    let told = folder.write("told.json", told);
    let held = shot(&folder, &[&orbit, "--camera-still"]);
    assert_eq!(shot(&folder, &[&told, "--time", "1"]), held);
}

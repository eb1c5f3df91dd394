//! Cameras of glTF files: which one is used, its focal point, and its keys in a dry run; and views from within.

use super::common::{Folder, SMALL, dome, fail, gltf_with_cameras, read_png, shot, stderr};
use super::common::{succeed, surfel};
use serde_json::{Value, json};

fn site() -> (Folder, String) {
    let folder = Folder::new();
    let file = folder.write("eye.gltf", gltf_with_cameras());
    (folder, file)
}

/// Returns the camera of a dry run.
fn dry_run_camera(command: &str, file: &str, options: &[&str]) -> Value {
    let dry_run = succeed(&[&[command, file, "--dry-run"], options].concat());
    serde_json::from_str::<Value>(&dry_run).unwrap()["camera"].take()
}

fn assert_near(found: &Value, expected: [f64; 3]) {
    let numbers = found.as_array().unwrap().iter().map(|value| value.as_f64().unwrap());
    assert!(numbers.zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found} {expected:?}");
}

#[test]
fn the_camera_of_the_file_is_used_unless_options_set_another() {
    let (_folder, file) = site();
    let own = dry_run_camera("render", &file, &[]);
    // The camera is rotated to Z up; its focal point lies at the distance of the middle of the triangle.
    assert_near(&own["position"], [0.0, -7.0, 1.0]);
    assert_near(&own["focal_point"], [0.0, 0.0, 1.0]);
    assert!((own["view_angle"].as_f64().unwrap() - 0.5f64.to_degrees()).abs() < 1e-4);
    let other = dry_run_camera("render", &file, &["--camera-azimuth-angle", "30"]);
    assert_ne!(other["position"], own["position"]);
}

#[test]
fn the_view_angle_option_applies_to_the_camera_of_the_file() {
    let (folder, file) = site();
    let wide = dry_run_camera("render", &file, &["--camera-view-angle", "60"]);
    assert_near(&wide["position"], [0.0, -7.0, 1.0]);
    assert_eq!(wide["view_angle"], json!(60.0));
    assert_ne!(shot(&folder, &[&file, "--camera-view-angle", "60"]), shot(&folder, &[&file]));
}

#[test]
fn a_turntable_turns_about_the_focal_point_of_the_camera_of_the_file() {
    let (folder, file) = site();
    let turn = folder.path("f#.png");
    let options = ["--turntable", "4", "--fps", "1", "--light", "none", "--background", "#000"];
    succeed(&[&["animate", &file, "-o", &turn], &options[..], &SMALL].concat());
    // After half a turn the camera sees the back of the triangle from the same distance.
    let n_seen = |frame: u32| {
        let (.., samples) = read_png(folder.path(&format!("f{frame}.png")));
        samples.chunks(3).filter(|pixel| pixel[0] != 0).count()
    };
    assert!(0 < n_seen(1) && n_seen(1).abs_diff(n_seen(3)) < 12, "{} {}", n_seen(1), n_seen(3));
}

#[test]
fn a_picture_of_a_turntable_is_the_frame_of_its_time() {
    let (folder, file) = site();
    let scene = folder.write("turn.toml", "turntable = 4\n[[object]]\nfile = \"eye.gltf\"\n");
    let [turn, picture] = ["f#.png", "a.png"].map(|name| folder.path(name));
    succeed(&[&["animate", &scene, "-o", &turn, "--fps", "1"], &SMALL[..]].concat());
    succeed(&[&["render", &scene, "-o", &picture, "--time", "1"], &SMALL[..]].concat());
    assert_eq!(read_png(&picture), read_png(folder.path("f2.png")));
    assert_ne!(shot(&folder, &[&scene]), shot(&folder, &[&scene, "--time", "1"]));
    assert_eq!(shot(&folder, &[&scene]), shot(&folder, &[&file]));
}

/// Returns the points of a room of 6 x 4 x 2.5 m with red walls and a red ceiling, a green floor and a green table or none.
fn room(has_table: bool) -> String {
    let (red, green) = ("200 0 0", "0 200 0");
    let side = |n: i32| (0..=n).map(|i| f64::from(i) / 10.0);
    let grid = |a: i32, b: i32| side(a).flat_map(move |x| side(b).map(move |y| (x, y)));
    let mut text = String::new();
    let mut add = |x: f64, y: f64, z: f64, color: &str| {
        text += &format!("{x} {y} {z} {color}\n");
    };
    for (x, y) in grid(60, 40) {
        add(x, y, 0.0, green);
        add(x, y, 2.5, red);
    }
    for (x, y) in grid(20, 10).filter(|_| has_table) {
        add(2.0 + x, 1.5 + y, 0.8, green);
    }
    for y in [0.0, 4.0] {
        grid(60, 25).for_each(|(x, z)| add(x, y, z, red));
    }
    for x in [0.0, 6.0] {
        grid(40, 25).for_each(|(y, z)| add(x, y, z, red));
    }
    text
}

#[test]
fn a_turntable_opens_a_room_toward_the_camera_of_each_frame() {
    let folder = Folder::new();
    let file = folder.write("room.xyz", room(true));
    let turn = folder.path("f#.png");
    let options = ["--turntable", "4", "--fps", "1", "--light", "none", "--background", "#000"];
    succeed(&[&["animate", &file, "-o", &turn], &options[..], &SMALL].concat());
    for frame in 1..=4 {
        // The floor fills the middle fifth of each frame.
        let (n_green, n_red) = n_green_and_red(&folder.path(&format!("f{frame}.png")));
        assert!(10 * n_red < n_green, "{frame}: {n_green} green pixels, {n_red} red ones");
    }
}

/// Returns the number of green and of red pixels in the middle fifth of a picture.
fn n_green_and_red(picture: &str) -> (u32, u32) {
    let (width, height, channels, samples) = read_png(picture);
    let middle = (2 * height / 5..3 * height / 5)
        .flat_map(|y| (2 * width / 5..3 * width / 5).map(move |x| (y * width + x) as usize));
    middle.fold((0, 0), |(n_green, n_red), pixel| {
        let [red, green] = [0, 1].map(|channel| samples[channels * pixel + channel]);
        (n_green + u32::from(red < green), n_red + u32::from(green < red))
    })
}

#[test]
fn an_empty_room_is_opened_only_if_asked_for_and_a_furnished_one_unless_forbidden() {
    let folder = Folder::new();
    let picture = folder.path("room.png");
    let empty = folder.write("empty.xyz", room(false));
    let furnished = folder.write("furnished.xyz", room(true));
    let plain = ["--light", "none", "--background", "#000", "--camera-elevation-angle", "60"];
    let shows_floor = |room: &str, options: &[&str]| {
        let arguments = [&["render", room, "-o", &picture][..], &plain, &SMALL, options];
        let output = surfel(&arguments.concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let (n_green, n_red) = n_green_and_red(&picture);
        assert!(0 < n_green + n_red && n_green.min(n_red) * 5 < n_green.max(n_red));
        assert_eq!(stderr(&output).contains("hidden [--camera-interior]"), n_red < n_green);
        n_red < n_green
    };
    let interior = |when| ["--camera-interior", when];
    assert!(!shows_floor(&empty, &[]) && !shows_floor(&empty, &interior("auto")));
    assert!(shows_floor(&empty, &interior("on")) && !shows_floor(&empty, &interior("off")));
    assert!(shows_floor(&furnished, &[]) && !shows_floor(&furnished, &interior("off")));
    // Where there is no room, it is said that nothing is hidden.
    let open = folder.write("dome.ply", dome(30));
    let render = ["render", &open, "-o", &picture, "--camera-interior", "on"];
    let message = stderr(&surfel(&[&render[..], &SMALL].concat()));
    assert!(message.contains("no room was found: nothing is hidden"), "{message}");
}

#[test]
fn the_dry_run_of_a_movie_keeps_the_camera_animation() {
    let (folder, file) = site();
    let name = ["--camera-name", "eye"];
    assert_eq!(dry_run_camera("animate", &file, &name), json!({ "name": "eye" }));
    let (made, again) = (folder.path("made#.png"), folder.path("again#.png"));
    let movie = ["animate", &file, "-o", &made, "--fps", "1"];
    succeed(&[&movie[..], &name, &SMALL].concat());
    let movie = ["animate", &file, "-o", &again, "--fps", "1", "--dry-run"];
    let dry_run = succeed(&[&movie[..], &name, &SMALL].concat());
    succeed(&["animate", &folder.write("dry_run.json", dry_run)]);
    let frame = |name: &str| read_png(folder.path(name)).3;
    assert!(frame("made1.png") == frame("again1.png") && frame("made2.png") == frame("again2.png"));
    assert!(frame("made1.png") != frame("made2.png"));
}

#[test]
fn a_dry_run_keeps_extreme_view_angles() {
    let folder = Folder::new();
    for angle in ["0.01", "3.1"] {
        let text = gltf_with_cameras().replace("\"yfov\":0.5", &format!("\"yfov\":{angle}"));
        let file = folder.write("eye.gltf", text);
        let dry_run = succeed(&["render", &file, "--dry-run"]);
        let dry_run = folder.write("dry_run.json", dry_run);
        assert_eq!(shot(&folder, &[&dry_run]), shot(&folder, &[&file]), "{angle}");
    }
}

#[test]
fn camera_name_selects_a_camera() {
    let (folder, file) = site();
    let eye = dry_run_camera("render", &file, &["--camera-name", "still"]);
    assert_near(&eye["position"], [0.0, -7.0, 1.0]);
    let scene = "camera.name = \"eye\"\n[[object]]\nfile = \"eye.gltf\"\n";
    let scene = folder.write("scene.toml", scene);
    assert_eq!(shot(&folder, &[&scene]), shot(&folder, &[&file, "--camera-name", "eye"]));
    assert_ne!(shot(&folder, &[&scene]), shot(&folder, &[&file]));
    // The command line overrides the name.
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
fn camera_lock_stops_the_camera_animation() {
    let (folder, file) = site();
    let orbit = "camera.name = \"eye\"\n[[object]]\nfile = \"eye.gltf\"\n[[animation]]\n\
        object = \"camera\"\nkind = \"orbit\"\nseconds = 4\n";
    let orbit = folder.write("orbit.toml", orbit);
    for scene in [&["--camera-name", "eye", &file][..], &[&orbit]] {
        let at = |time, more: &[&str]| shot(&folder, &[scene, &["--time", time], more].concat());
        assert_ne!(at("1", &[]), at("0", &[]));
        assert_eq!(at("1", &["--camera-lock"]), at("0", &[]));
    }
    let dry_run = succeed(&["render", &orbit, "--camera-lock", "--dry-run"]);
    let dry_run = folder.write("dry_run.json", dry_run);
    let held = shot(&folder, &[&orbit, "--camera-lock"]);
    assert_eq!(shot(&folder, &[&dry_run, "--time", "1"]), held);
}

#[test]
fn the_camera_stands_at_a_named_station() {
    let folder = Folder::new();
    let scan = |x: f64, cells: &str| {
        format!("4\n1\n{x} 0 1\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n{x} 0 1 1\n{cells}")
    };
    // From the first station most far points lie in the west, from the second in the east.
    let text = scan(0.0, "-9 -1 0 1\n-9 1 0 1\n1 1 0 1\n0 0 0 0.5\n")
        + &scan(50.0, "9 1 0 1\n9 -1 0 1\n9 0 0 1\n-1 0 0 1\n");
    let file = folder.write("site.ptx", text);
    let camera = dry_run_camera("render", &file, &["--camera-station", "SCAN 1"]);
    assert_near(&camera["position"], [0.0, 0.0, 1.0]);
    assert_eq!(camera["view_angle"], json!(60.0));
    let looks_east = |camera: &Value| 0.0 < camera["focal_point"][0].as_f64().unwrap() - 50.0;
    let second = ["--camera-station", "scan 2"];
    assert!(looks_east(&dry_run_camera("render", &file, &second)));
    let turned = [&second[..], &["--camera-azimuth-angle", "180"]].concat();
    assert!(!looks_east(&dry_run_camera("render", &file, &turned)));
    let around = dry_run_camera("render", &file, &[&second[..], &["--camera-panorama"]].concat());
    assert_near(&around["position"], [50.0, 0.0, 1.0]);

    let message = fail(&["render", &file, "-o", "no.png", "--camera-station", "tower"], 2);
    assert!(message.contains("no station `tower`; there is scan 1, scan 2"), "{message}");
    let both = fail(
        &[
            "render",
            &file,
            "-o",
            "no.png",
            "--camera-station",
            "scan 1",
            "--camera-position",
            "0,0,0",
        ],
        2,
    );
    assert!(both.contains("camera-position") || both.contains("camera.position"), "{both}");
    let info = succeed(&["info", &file]);
    assert!(info.contains("scan 2") && info.contains("4 points, scanner at 50, 0, 1"), "{info}");
}

#[test]
fn a_tunnel_is_shown_from_within_unless_an_option_says_otherwise() {
    let folder = Folder::new();
    // A pipe of 60 units, 4 wide, with two rails.
    let pipe = |i: usize| {
        let (x, angle) = ((i % 600) as f64 * 0.1, (i / 600) as f64 * 0.1);
        format!("{x} {} {}\n", 2.0 * angle.sin(), 2.0 * angle.cos())
    };
    let rail = |i: usize| format!("{} {} -1\n", (i / 2) as f64 * 0.1, (i % 2) as f64 - 0.5);
    let text: String = (0..600 * 63).map(pipe).chain((0..1200).map(rail)).collect();
    let file = folder.write("tunnel.xyz", text);
    let position = |options: &[&str]| {
        let camera = dry_run_camera("render", &file, options);
        let position: Vec<f64> = serde_json::from_value(camera["position"].clone()).unwrap();
        position
    };
    let within = position(&[]);
    assert!((0.0..60.0).contains(&within[0]) && within[1].hypot(within[2]) < 0.5, "{within:?}");
    for options in [["--camera-interior", "off"], ["--camera-elevation-angle", "30"]] {
        let outside = position(&options);
        assert!(2.5 < outside[1].hypot(outside[2]), "{outside:?}");
    }
}

#[test]
fn an_empty_closed_room_is_lit_from_the_camera_within() {
    let folder = Folder::new();
    let steps = |length: f64| (0..=(length * 10.0) as i32).map(|i| f64::from(i) / 10.0);
    let [width, depth, height] = [6.0, 4.0, 2.5];
    let points: String = steps(width)
        .flat_map(|x| steps(depth).map(move |y| (x, y)))
        .flat_map(|(x, y)| steps(height).map(move |z| [x, y, z]))
        .filter(|p| (0..3).any(|axis| [0.0, [width, depth, height][axis]].contains(&p[axis])))
        .map(|[x, y, z]| format!("{x} {y} {z}\n"))
        .collect();
    let room = folder.write("room.xyz", points);
    let lights = |position: &str, options: &[&str]| -> Value {
        let focal_point = "--camera-focal-point=5,3,1.2";
        let arguments = ["render", &room, "--dry-run", "--camera-position", position, focal_point];
        let arguments = [&arguments[..], options].concat();
        let description: Value = serde_json::from_str(&succeed(&arguments)).unwrap();
        description["light"].clone()
    };
    assert_eq!(lights("1,1,1.6", &[]), json!(["headlight"]));
    assert_eq!(lights("-9,-9,6", &[]), json!(["sun", "sky"]));
    // A sun that is asked for shines.
    assert_eq!(lights("1,1,1.6", &["--sun-azimuth", "90"]), json!(["sun", "sky"]));
}

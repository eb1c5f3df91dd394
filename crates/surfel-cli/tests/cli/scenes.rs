//! Scene files, several inputs, and how their keys combine with options.

use super::common::{Folder, SMALL, command, dome, gltf, light_picture, shot, tile};
use super::common::{fail, square, stderr, succeed};
use serde_json::{Value, json};
use std::fs;

/// A scene with objects, lamps, instances, materials and animations.
const SCENE: &str = r##"
spp = 1
resolution = [32, 24]
light_samples = 1
light = ["sun"]

[camera]
position = [4, -7, 5]
focal_point = [0.5, 0, 0]

[[object]]
name = "dome"
file = "dome.ply"
material = { kind = "plastic", roughness = 0.4 }
instances = [{ translate = [2.5, 0, 0] }, { translate = [0, 2.5, 0], rotate = [0, 0, 45], scale = 0.5 }]

[[object]]
name = "roof"
file = "tile.ply"
parent = "dome"
translate = [0, 0, 1]
rotate = { axis = [1, 0, 0], angle = 20 }

[[lamp]]
name = "bulb"
position = [0, -2, 3]
strength = 4

[[animation]]
object = "dome"
times = [0, 2]
translate = [[0, 0, 0], [1, 1, 0]]

[[animation]]
object = "bulb"
kind = "orbit"
center = [0, 0, 3]
seconds = 4
"##;

/// Returns the same scene as JSON, with other spellings of its keys.
fn scene_json() -> String {
    let scene = json!({
        "spp": 1, "light_samples": 1, "resolution": "32x24", "light": "sun",
        "camera-position": [4, -7, 5],
        "camera": { "focal-point": "0.5,0,0" },
        "object": [
            {
                "name": "dome", "file": "dome.ply",
                "material": { "kind": "plastic", "roughness": 0.4 },
                "instances": [
                    { "translate": [2.5, 0, 0] },
                    { "translate": [0, 2.5, 0], "rotate": [0, 0, 45], "scale": 0.5 },
                ],
            },
            {
                "name": "roof", "file": "tile.ply", "parent": "dome", "translate": [0, 0, 1],
                "rotate": { "axis": [1, 0, 0], "angle": 20 },
            },
        ],
        "lamp": { "name": "bulb", "position": [0, -2, 3], "strength": 4 },
        "animation": [
            { "object": "dome", "times": [0, 2], "translate": [[0, 0, 0], [1, 1, 0]] },
            { "object": "bulb", "kind": "orbit", "center": [0, 0, 3], "seconds": 4 },
        ],
    });
    scene.to_string()
}

pub fn site() -> Folder {
    let folder = Folder::new();
    folder.write("dome.ply", dome(20));
    folder.write("tile.ply", tile(1.5, -0.4, [200, 60, 60]));
    folder
}

#[test]
fn toml_and_json_describe_the_same_picture() {
    let folder = site();
    let toml = folder.write("scene.toml", SCENE);
    let json = folder.write("scene.json", scene_json());
    assert_eq!(shot(&folder, &[&toml]), shot(&folder, &[&json]));
    let spelled = folder.write("spelled.toml", SCENE.replace("focal_point", "focal-point"));
    assert_eq!(shot(&folder, &[&toml]), shot(&folder, &[&spelled]));
    assert_ne!(shot(&folder, &[&toml]), shot(&folder, &[&toml, "--time", "1"]));
}

#[test]
fn the_command_line_overrides_the_scene_file() {
    let folder = site();
    let scene = |name: &str, options: &str| {
        folder.write(name, format!("{options}\n[[object]]\nfile = \"dome.ply\"\n"))
    };
    let red = scene("red.toml", "color = \"#ff0000\"\nlight = \"none\"\nspp = 3\nseed = 9");
    let green = scene("green.toml", "color = \"#00ff00\"\nlight = \"none\"\nseed = 9");
    let green = shot(&folder, &[&green]);
    assert_ne!(shot(&folder, &[&red]), green);
    assert_eq!(shot(&folder, &[&red, "--color", "#00ff00"]), green);
    assert_eq!(shot(&folder, &["--color", "#00ff00", &red]), green);
}

#[test]
fn keys_that_options_exclude_are_ignored() {
    let folder = site();
    let object = "[[object]]\nfile = \"dome.ply\"\n";
    let plain = folder.write("plain.toml", object);
    for (options, line) in [
        ("camera-azimuth-angle = 30", &["--camera-direction", "0,0,-1"][..]),
        ("camera-direction = [0, 0, -1]", &["--camera-azimuth-angle", "30"]),
        ("camera = { zoom-factor = 2 }", &["--camera-position", "3,3,3"]),
        ("camera.position = [3, 3, 3]", &["--camera-zoom-factor", "2"]),
        (
            "camera = { position = [3, 3, 3], focal-point = [0, 0, 0], view-up = [0, 1, 0] }",
            &["--camera-direction", "0,0,-1", "--camera-orthographic"],
        ),
        (
            "camera-azimuth-angle = 30",
            &["--camera-position", "3,3,3", "--camera-focal-point", "0,0,0"],
        ),
        ("camera.view_angle = 60", &["--camera-panorama"]),
        ("camera.panorama = true", &["--camera-orthographic"]),
        ("camera.orthographic = true", &["--camera-orthographic=false"]),
        ("background = \"transparent\"", &["--background", "#123456"]),
        ("background = \"#123456\"", &["--no-background"]),
        ("normals_k = 8", &["--normals-radius", "0.4"]),
        ("normals_radius = 0.4", &["--normals-k", "8"]),
    ] {
        let scene = folder.write("scene.toml", format!("{options}\n{object}"));
        let with = |file: &str| shot(&folder, &[&[file], line].concat());
        assert_eq!(with(&scene), with(&plain), "{options}");
    }
}

#[test]
fn a_flag_does_not_consume_the_file_after_it() {
    let folder = site();
    let scene = |name: &str, options: &str| {
        folder.write(name, format!("{options}\n[[object]]\nfile = \"dome.ply\"\n"))
    };
    let plain = shot(&folder, &[&scene("plain.toml", ""), "--camera-orthographic"]);
    let flag = scene("flag.toml", "camera.orthographic = true");
    assert_eq!(shot(&folder, &[&flag]), plain);
    let output = folder.path("a.png");
    for words in [
        &[flag.as_str(), "-o", &output][..],
        &["-o", &output, "--", &flag],
        &["--camera-orthographic", &flag, "-o", &output],
    ] {
        succeed(&[&["-q", "render"], &SMALL[..], words].concat());
    }
    let off = scene("off.toml", "camera.orthographic = false");
    assert_ne!(shot(&folder, &[&off]), plain);
}

#[test]
fn inputs_are_relative_to_the_scene_file_and_outputs_to_the_working_directory() {
    let folder = site();
    fs::create_dir_all(folder.0.join("data")).unwrap();
    fs::create_dir_all(folder.0.join("work")).unwrap();
    fs::rename(folder.path("dome.ply"), folder.path("data/dome.ply")).unwrap();
    folder.write("data/light.hdr", light_picture());
    let scene = "output = \"picture.png\"\nresolution = [32, 24]\nspp = 1\nlight_samples = 1\n\
        [environment]\nrotation = 90\n[[object]]\nfile = \"dome.ply\"\n";
    let scene = scene.replace("[environment]", "environment = \"light.hdr\"\n[environment]");
    // TOML does not allow a key to be a value and a table, hence `environment-rotation`.
    let scene = scene.replace("[environment]\nrotation", "environment-rotation");
    folder.write("data/scene.toml", scene);
    let status = command(&["render", "../data/scene.toml"])
        .current_dir(folder.0.join("work"))
        .output()
        .unwrap();
    assert!(status.status.success(), "{}", stderr(&status));
    let there = fs::read(folder.path("work/picture.png")).unwrap();
    assert_eq!(shot(&folder, &[&folder.path("data/scene.toml")]), there);
    assert_eq!(fs::read_dir(folder.0.join("data")).unwrap().count(), 3);
}

/// Returns the picture of a run, and the picture of the scene file that its dry run prints.
pub fn picture_and_replay(folder: &Folder, arguments: &[&str]) -> (Vec<u8>, Vec<u8>) {
    let picture = shot(folder, arguments);
    let output = folder.path("again.png");
    let dry_run =
        succeed(&[&["render"], arguments, &SMALL, &["-o", &output, "--dry-run"]].concat());
    // The folder differs, as all paths are absolute.
    fs::create_dir_all(folder.0.join("elsewhere")).unwrap();
    let dry_run = folder.write("elsewhere/dry_run.json", dry_run);
    succeed(&["render", &dry_run]);
    let again = fs::read(&output).unwrap();
    (picture, again)
}

#[test]
fn a_dry_run_renders_to_the_same_picture() {
    let folder = site();
    let scene = folder.write("scene.toml", SCENE);
    let (cloud, mesh) = (folder.path("dome.ply"), folder.path("tile.ply"));
    let light = folder.write("light.hdr", light_picture());
    let far = folder.write("far.xyz", square(9, 200));
    for arguments in [
        &[scene.as_str(), "--time", "0.7"][..],
        &[&scene, &far, "--light", "sky,headlight"],
        &[&cloud, &mesh, "--material", "dome=glass:ior=1.3"],
        &[&cloud, "--subsample", "random:150", "--radius", "0.3", "--seed", "7"],
        &[&cloud, "--color", "rain", "--cmap", "turbo_r", "--range", "5,200"],
        &[&cloud, "--normals-radius", "0.4", "--orient", "up", "--neighbors", "grid"],
        &[&cloud, "--surface", "sphere", "--edge-test", "off", "--exposure", "-1"],
        &[&cloud, "--radius-scale", "1.5", "--clip-box", "([-0.5, 1],[-1,1])"],
        &[&cloud, "--clip-plane", "0,0,0.5,0,0,1"],
        &[&cloud, "--up", "1,2,3", "--sun-elevation", "33.3", "--sun-angle", "5"],
        &[&cloud, "--camera-azimuth-angle", "17", "--camera-zoom-factor", "1.7"],
        &[&cloud, "--camera-panorama", "--camera-azimuth-angle", "30"],
        &[&cloud, "--camera-orthographic", "--camera-direction", "0.1,0.2,-1"],
        &[&cloud, "--environment", &light, "--environment-rotation", "40"],
        &[&cloud, "--environment", &light, "--background", "environment", "--light", "sun"],
        &[&mesh, "--light", "none"],
        &[&mesh, "--light", "none", "--environment", &light],
        &[&mesh, &cloud, "--vertices", "--surface", "points", "--no-background"],
        &[&mesh, "--vertices", "--radius", "1", "--background", "#102030,#fedcba"],
        &[&mesh, "--material", "emissive:emissive-strength=2,color=#ffcc00", "--max-depth", "1"],
        &[
            &far,
            "--columns",
            "x,y,z,intensity,-,-",
            "--sky-ao-distance",
            "0.123",
            "--bit-depth",
            "16",
        ],
    ] {
        let (made, again) = picture_and_replay(&folder, arguments);
        assert!(made == again, "{arguments:?}");
    }
}

#[test]
fn a_dry_run_keeps_clouds_merged() {
    let folder = site();
    let near = folder.write("near.xyz", square(5, 90));
    let far = folder.write("far.xyz", square(9, 200));
    let mesh = folder.path("tile.ply");
    let (made, again) =
        picture_and_replay(&folder, &[&near, &mesh, &far, "--radius", "adaptive:3"]);
    assert!(made == again);
    let (made, again) = picture_and_replay(&folder, &[&near, &far, "--material", "far=mirror"]);
    assert!(made == again);
}

#[test]
fn a_dry_run_of_clouds_with_other_columns_can_be_rendered() {
    let folder = site();
    let bare = folder.write("bare.xyz", "0 0 3\n1 0 3\n0 1 3\n1 1 3.5\n");
    let scene = "[[object]]\nfile = \"dome.ply\"\n[[object]]\nfile = \"bare.xyz\"\n";
    let scene = folder.write("scene.toml", scene);
    let (made, again) = picture_and_replay(&folder, &[&scene, "--radius", "0.5"]);
    assert!(made == again);
    let own =
        "[[object]]\nfile = \"dome.ply\"\ncolor = \"rain\"\n[[object]]\nfile = \"bare.xyz\"\n";
    let (made, again) = picture_and_replay(&folder, &[&folder.write("own.toml", own), &bare]);
    assert!(made == again);
}

fn dry(arguments: &[&str]) -> Value {
    let dry_run = succeed(&[&["render"], arguments, &["--dry-run"]].concat());
    serde_json::from_str(&dry_run).unwrap()
}

#[test]
fn clouds_meshes_and_gltf_files_form_one_scene() {
    let folder = site();
    let scene = folder.write("triangle.gltf", gltf());
    let (cloud, mesh) = (folder.path("dome.ply"), folder.path("tile.ply"));
    let info = dry(&[&cloud, &mesh, &scene])["info"].take();
    assert_eq!((&info["points"], &info["triangles"]), (&json!(400), &json!(3)));
    let all = shot(&folder, &[&cloud, &mesh, &scene]);
    for less in [[&cloud, &mesh], [&cloud, &scene], [&mesh, &scene]] {
        assert_ne!(shot(&folder, &less.map(String::as_str)), all, "{less:?}");
    }
    let vertices = dry(&[&cloud, &mesh, "--vertices"])["info"].take();
    assert_eq!((&vertices["points"], &vertices["triangles"]), (&json!(404), &json!(0)));
}

#[test]
fn objects_named_like_files_do_not_clash() {
    let folder = site();
    folder.write("triangle.gltf", gltf());
    // Content that is shown twice is stored once, also if an object is named like its file.
    let twice = "[[object]]\nname = \"tile.ply\"\nfile = \"tile.ply\"\n\
        [[object]]\nname = \"b\"\nfile = \"tile.ply\"\ntranslate = [9, 0, 0]\n";
    let apart = twice.replace("name = \"tile.ply\"", "name = \"a\"");
    let picture = |text: &str| shot(&folder, &[&folder.write("scene.toml", text)]);
    assert_eq!(picture(twice), picture(&apart));
    let stats = succeed(&[
        "render",
        &folder.write("twice.toml", twice),
        "-o",
        &folder.path("a.png"),
        "--resolution",
        "8x6",
        "--stats",
        "-",
    ]);
    let stats: Value = serde_json::from_str(&stats).unwrap();
    assert_eq!((&stats["instances"], &stats["triangles"]), (&json!(2), &json!(2)));
}

#[test]
fn a_parent_is_an_object_and_not_a_node_of_a_file() {
    let folder = site();
    folder.write("triangle.gltf", gltf().replace("{\"mesh\":0}", "{\"mesh\":0,\"name\":\"b\"}"));
    let scene = |name: &str| {
        let text = format!(
            "[[object]]\nname = \"t\"\nfile = \"triangle.gltf\"\ntranslate = [9, 0, 0]\n\
             [[object]]\nname = \"{name}\"\nfile = \"tile.ply\"\n\
             [[object]]\nname = \"c\"\nfile = \"dome.ply\"\nparent = \"{name}\"\n"
        );
        shot(&folder, &[&folder.write("scene.toml", text)])
    };
    assert_eq!(scene("b"), scene("other"));
}

#[test]
fn settings_of_an_object_override_those_of_the_scene() {
    let folder = site();
    let scene = |options: &str, own: &str| {
        let text = format!("{options}\n[[object]]\nfile = \"dome.ply\"\n{own}\n");
        folder.write("scene.toml", text)
    };
    let own = shot(&folder, &[&scene("", "normals_radius = 0.4")]);
    let plain = shot(&folder, &[&scene("", "")]);
    assert_ne!(own, plain);
    // The keys may exclude each other, and files may follow `--`.
    assert_eq!(shot(&folder, &[&scene("normals_k = 8", "normals_radius = 0.4")]), own);
    let nearest = shot(&folder, &[&scene("", "normals_k = 8")]);
    assert_eq!(shot(&folder, &[&scene("normals_radius = 0.4", "normals_k = 8")]), nearest);
    let output = folder.path("own.png");
    let behind = scene("", "normals_radius = 0.4");
    succeed(&[&["render", "-o", &output], &SMALL[..], &["--", &behind]].concat());
    assert_eq!(fs::read(&output).unwrap(), own);
    let text =
        fail(&["render", &scene("", "normals_radius = 0.4\nnormals_k = 8"), "-o", "no.png"], 2);
    assert!(
        text.contains("object[0].normals_k: excludes normals_radius; leave out one of them"),
        "{text}"
    );
}

#[test]
fn an_object_can_unset_a_flag_of_the_scene() {
    let folder = site();
    let scene = |options: &str, own: &str| {
        let text = format!("{options}\nradius = 1\n[[object]]\nfile = \"tile.ply\"\n{own}\n");
        let dry_run = dry(&[&folder.write("scene.toml", text)])["info"].take();
        (dry_run["points"].as_u64().unwrap(), dry_run["triangles"].as_u64().unwrap())
    };
    assert_eq!(scene("vertices = true", ""), (4, 0));
    assert_eq!(scene("vertices = true", "vertices = false"), (0, 2));
    assert_eq!(scene("vertices = false", "vertices = true"), (4, 0));
}

#[test]
fn a_name_must_be_unique_only_if_it_is_referenced() {
    let folder = site();
    let twice =
        "[[object]]\nfile = \"tile.ply\"\n[[object]]\nfile = \"tile.ply\"\ntranslate = [9, 0, 0]\n";
    shot(&folder, &[&folder.write("twice.toml", twice)]);
    for more in [
        "[[object]]\nfile = \"dome.ply\"\nparent = \"tile\"",
        "[[animation]]\nobject = \"tile\"\nkind = \"orbit\"\nseconds = 1",
    ] {
        let scene = folder.write("scene.toml", format!("{twice}{more}\n"));
        let text = fail(&["render", &scene, "-o", "no.png"], 2);
        assert!(text.contains("`tile`") && text.contains("object[0] and object[1]"), "{text}");
    }
    // A second scene file that adds an object of that name is an error too.
    let orbit = "[[object]]\nfile = \"tile.ply\"\n[[animation]]\nobject = \"tile\"\nkind = \"orbit\"\nseconds = 1\n";
    let (a, b) = (folder.write("a.toml", orbit), "[[object]]\nfile = \"tile.ply\"\n");
    let b = folder.write("b.toml", b);
    let text = fail(&["render", &a, &b, "-o", "no.png"], 2);
    assert!(text.contains("object[0] and object[1]"), "{text}");
}

#[test]
fn up_does_not_depend_on_the_order_of_files() {
    let folder = Folder::new();
    let scene = folder.write("triangle.gltf", gltf());
    let cloud = folder.path("stick.laz");
    let tall: String = (0..200).map(|i| format!("{} {} {}\n", i % 3, i, i % 5)).collect();
    succeed(&["prepare", &folder.write("stick.xyz", tall), "-o", &cloud]);
    let up = |files: [&str; 2]| dry(&files)["up"].take();
    assert_eq!(up([&scene, &cloud]), up([&cloud, &scene]));
    assert_eq!(up([&cloud, &scene]), json!([0.0, 0.0, 1.0]));
    let flat = folder.write("wall.xyz", "0 0 0\n1 0 0\n0 9 0\n1 9 0\n0 5 0.1\n");
    assert_eq!(up([&scene, &flat]), up([&flat, &scene]));
}

#[test]
fn sequences_of_different_rates_keep_them() {
    let folder = site();
    let text = |rate: &str, node: &str| {
        format!("[[object]]\nfiles = [\"dome.ply\", \"tile.ply\"]\nfps = {rate}\n{node}\n")
    };
    let node = "name = \"second\"\ntranslate = [4, 0, 0]";
    let both = folder.write("both.toml", text("10", "") + &text("1", node));
    let slow = folder.write("slow.toml", text("1", "") + &text("1", node));
    // After half a second the fast sequence shows its last file, the slow one its first.
    assert_ne!(shot(&folder, &[&both, "--time", "0.5"]), shot(&folder, &[&slow, "--time", "0.5"]));
    assert_eq!(
        shot(&folder, &[&both, "--time", "0.05"]),
        shot(&folder, &[&slow, "--time", "0.05"])
    );
}

#[test]
fn keys_of_other_commands_are_accepted() {
    let folder = site();
    let options = "time = 0.5\nframes = 2\nfps = 10\nturntable = 3\n";
    let scene = format!("{options}[[object]]\nfile = \"dome.ply\"\n");
    let scene = folder.write("scene.toml", scene);
    shot(&folder, &[&scene]);
    let movie = folder.path("movie.png");
    succeed(&[&["animate", &scene, "-o", &movie], &SMALL[..]].concat());
    let text = fail(&["render", &scene, "-o", "no.png", "--frames", "2"], 2);
    assert!(text.contains("--frames"), "{text}");
}

#[test]
fn two_scene_files_form_one_scene() {
    let folder = site();
    let a = folder.write("a.toml", "spp = 2\nseed = 4\n[[object]]\nfile = \"dome.ply\"\n");
    let b = folder.write("b.json", r#"{"seed": 5, "object": {"file": "tile.ply"}}"#);
    let dry_run = dry(&[&a, &b]);
    assert_eq!(dry_run["object"].as_array().unwrap().len(), 2);
    // The last file overrides the keys that both have.
    assert_eq!((&dry_run["spp"], &dry_run["seed"]), (&json!(2), &json!(5)));
    assert_eq!(dry(&[&b, &a])["seed"], 4);
}

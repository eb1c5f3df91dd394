//! Scene files, and several files at once: what they show, and how options go together.

use super::common::{Folder, SMALL, command, dome, gltf, light_picture, shot, tile};
use super::common::{fail, square, stderr, succeed};
use serde_json::{Value, json};
use std::fs;

/// Objects, lamps, copies, materials and movement.
const SCENE: &str = r##"
spp = 1
resolution = [32, 24]
samples = 1
light = ["sun"]

[camera]
position = [4, -7, 5]
focal_point = [0.5, 0, 0]

[[object]]
name = "dome"
file = "dome.ply"
material = { kind = "plastic", roughness = 0.4 }
copies = [{ translate = [2.5, 0, 0] }, { translate = [0, 2.5, 0], rotate = [0, 0, 45], scale = 0.5 }]

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

/// The same, with the other spelling of keys.
fn scene_json() -> String {
    let scene = json!({
        "spp": 1, "samples": 1, "resolution": "32x24", "light": "sun",
        "camera-position": [4, -7, 5],
        "camera": { "focal-point": "0.5,0,0" },
        "object": [
            {
                "name": "dome", "file": "dome.ply",
                "material": { "kind": "plastic", "roughness": 0.4 },
                "copies": [
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
fn toml_and_json_make_the_same_picture() {
    let folder = site();
    let toml = folder.write("scene.toml", SCENE);
    let json = folder.write("scene.json", scene_json());
    assert_eq!(shot(&folder, &[&toml]), shot(&folder, &[&json]));
    let spelled = folder.write("spelled.toml", SCENE.replace("focal_point", "focal-point"));
    assert_eq!(shot(&folder, &[&toml]), shot(&folder, &[&spelled]));
    assert_ne!(shot(&folder, &[&toml]), shot(&folder, &[&toml, "--time", "1"]));
}

#[test]
fn the_command_line_wins_over_the_scene_file() {
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
fn what_does_not_go_with_the_command_line_is_left_out() {
    let folder = site();
    let object = "[[object]]\nfile = \"dome.ply\"\n";
    let plain = folder.write("plain.toml", object);
    for (options, line) in [
        ("camera-azimuth-angle = 30", &["--camera-direction", "0,0,-1"][..]),
        ("camera-direction = [0, 0, -1]", &["--camera-azimuth-angle", "30"]),
        ("camera = { zoom-factor = 2 }", &["--camera-position", "3,3,3"]),
        ("camera.position = [3, 3, 3]", &["--camera-zoom-factor", "2"]),
        ("camera.view_angle = 60", &["--camera-panorama"]),
        ("camera.panorama = true", &["--camera-orthographic"]),
        ("no_background = true", &["--background", "#123456"]),
        ("background = \"#123456\"", &["--no-background"]),
        ("normals_k = 8", &["--normals-radius", "0.4"]),
        ("normals_radius = 0.4", &["--normals-k", "8"]),
        ("quiet = true", &["--verbose"]),
        ("verbose = true", &["--quiet"]),
    ] {
        let scene = folder.write("scene.toml", format!("{options}\n{object}"));
        let with = |file: &str| shot(&folder, &[&[file], line].concat());
        assert_eq!(with(&scene), with(&plain), "{options}");
    }
}

#[test]
fn a_flag_of_a_scene_file_does_not_take_the_file_for_its_value() {
    let folder = site();
    let scene = |name: &str, options: &str| {
        folder.write(name, format!("{options}\n[[object]]\nfile = \"dome.ply\"\n"))
    };
    let plain = shot(&folder, &[&scene("plain.toml", ""), "--camera-orthographic"]);
    let flag = scene("flag.toml", "camera.orthographic = true");
    assert_eq!(shot(&folder, &[&flag]), plain);
    let output = folder.path("a.png");
    for words in [&["render", &flag, "-o", &output][..], &["render", "-o", &output, "--", &flag]] {
        succeed(&[&["-q"], words].concat());
    }
    let off = scene("off.toml", "camera.orthographic = false\nno_background = false");
    assert_ne!(shot(&folder, &[&off]), plain);
}

#[test]
fn files_are_found_from_where_the_scene_lies_and_the_output_from_where_one_is() {
    let folder = site();
    fs::create_dir_all(folder.0.join("data")).unwrap();
    fs::create_dir_all(folder.0.join("work")).unwrap();
    fs::rename(folder.path("dome.ply"), folder.path("data/dome.ply")).unwrap();
    folder.write("data/light.hdr", light_picture());
    let scene = "output = \"picture.png\"\nresolution = [32, 24]\nspp = 1\nsamples = 1\n\
        [environment]\nrotation = 90\n[[object]]\nfile = \"dome.ply\"\n";
    let scene = scene.replace("[environment]", "environment = \"light.hdr\"\n[environment]");
    // A key cannot be both a value and a table in TOML; the long name says it.
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

/// The picture of a run, and that of what its dry run tells.
pub fn told_and_made(folder: &Folder, arguments: &[&str]) -> (Vec<u8>, Vec<u8>) {
    let made = shot(folder, arguments);
    let output = folder.path("again.png");
    let told = succeed(&[&["render"], arguments, &SMALL, &["-o", &output, "--dry-run"]].concat());
    // Elsewhere, as all that it names is named in full.
    fs::create_dir_all(folder.0.join("elsewhere")).unwrap();
    let told = folder.write("elsewhere/told.json", told);
    succeed(&["render", &told]);
    let again = fs::read(&output).unwrap();
    (made, again)
}

#[test]
fn a_dry_run_tells_a_scene_that_makes_the_same_picture() {
    let folder = site();
    let scene = folder.write("scene.toml", SCENE);
    let (cloud, mesh) = (folder.path("dome.ply"), folder.path("tile.ply"));
    let light = folder.write("light.hdr", light_picture());
    let far = folder.write("far.xyz", square(9, 200));
    for arguments in [
        &[scene.as_str(), "--time", "0.7"][..],
        &[&scene, &far, "--light", "sky,headlight"],
        &[&cloud, &mesh, "--material", "dome=glass:ior=1.3"],
        &[&cloud, "--select", "random:150", "--radius", "0.3", "--seed", "7"],
        &[&cloud, "--color", "rain", "--cmap", "turbo_r", "--range", "5,200"],
        &[&cloud, "--normals-radius", "0.4", "--orient", "up", "--neighbors", "grid"],
        &[&cloud, "--surface", "sphere", "--boundary", "off", "--exposure", "-1"],
        &[&cloud, "--radius-scale", "1.5", "--clip-box", "([-0.5, 1],[-1,1])"],
        &[&cloud, "--clip-plane", "0,0,0.5,0,0,1"],
        &[&cloud, "--up", "1,2,3", "--sun-elevation", "33.3", "--sun-angle", "5"],
        &[&cloud, "--camera-azimuth-angle", "17", "--camera-zoom-factor", "1.7"],
        &[&cloud, "--camera-panorama", "--camera-azimuth-angle", "30"],
        &[&cloud, "--camera-orthographic", "--camera-direction", "0.1,0.2,-1"],
        &[&cloud, "--environment", &light, "--environment-rotation", "40"],
        &[&cloud, "--environment", &light, "--background", "surroundings", "--light", "sun"],
        &[&mesh, "--light", "none"],
        &[&mesh, "--light", "none", "--environment", &light],
        &[&mesh, &cloud, "--vertices", "--surface", "points", "--no-background"],
        &[&mesh, "--vertices", "--radius", "1", "--background", "#102030,#fedcba"],
        &[&mesh, "--material", "emissive:glow=2,color=#ffcc00", "--max-depth", "1"],
        &[&far, "--columns", "x,y,z,intensity,-,-", "--sky-reach", "0.123", "--bit-depth", "16"],
    ] {
        let (made, again) = told_and_made(&folder, arguments);
        assert!(made == again, "{arguments:?}");
    }
}

#[test]
fn a_dry_run_keeps_clouds_together_that_were_one() {
    let folder = site();
    let near = folder.write("near.xyz", square(5, 90));
    let far = folder.write("far.xyz", square(9, 200));
    let mesh = folder.path("tile.ply");
    let (made, again) = told_and_made(&folder, &[&near, &mesh, &far, "--radius", "adaptive:3"]);
    assert!(made == again);
    let (made, again) = told_and_made(&folder, &[&near, &far, "--material", "far=mirror"]);
    assert!(made == again);
}

#[test]
fn a_dry_run_of_clouds_with_other_columns_can_be_rendered() {
    let folder = site();
    let bare = folder.write("bare.xyz", "0 0 3\n1 0 3\n0 1 3\n1 1 3.5\n");
    let scene = "[[object]]\nfile = \"dome.ply\"\n[[object]]\nfile = \"bare.xyz\"\n";
    let scene = folder.write("scene.toml", scene);
    let (made, again) = told_and_made(&folder, &[&scene, "--radius", "0.5"]);
    assert!(made == again);
    let own =
        "[[object]]\nfile = \"dome.ply\"\ncolor = \"rain\"\n[[object]]\nfile = \"bare.xyz\"\n";
    let (made, again) = told_and_made(&folder, &[&folder.write("own.toml", own), &bare]);
    assert!(made == again);
}

fn dry(arguments: &[&str]) -> Value {
    let told = succeed(&[&["render"], arguments, &["--dry-run"]].concat());
    serde_json::from_str(&told).unwrap()
}

#[test]
fn cloud_mesh_and_gltf_are_one_scene() {
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
fn objects_of_the_same_name_as_their_file_or_as_others_keep_apart() {
    let folder = site();
    folder.write("triangle.gltf", gltf());
    // What is shown twice is held once, also where an object is named as its file is.
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
fn a_parent_is_an_object_and_not_a_node_in_a_file() {
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
fn options_of_an_object_win_over_those_of_the_scene() {
    let folder = site();
    let scene = |options: &str, own: &str| {
        let text = format!("{options}\n[[object]]\nfile = \"dome.ply\"\n{own}\n");
        folder.write("scene.toml", text)
    };
    let own = shot(&folder, &[&scene("", "normals_radius = 0.4")]);
    let plain = shot(&folder, &[&scene("", "")]);
    assert_ne!(own, plain);
    // Also where the two do not go together, and where what follows `--` is files.
    assert_eq!(shot(&folder, &[&scene("normals_k = 8", "normals_radius = 0.4")]), own);
    let nearest = shot(&folder, &[&scene("", "normals_k = 8")]);
    assert_eq!(shot(&folder, &[&scene("normals_radius = 0.4", "normals_k = 8")]), nearest);
    let output = folder.path("own.png");
    let behind = scene("", "normals_radius = 0.4");
    succeed(&[&["render", "-o", &output], &SMALL[..], &["--", &behind]].concat());
    assert_eq!(fs::read(&output).unwrap(), own);
    let text =
        fail(&["render", &scene("", "normals_radius = 0.4\nnormals_k = 8"), "-o", "no.png"], 2);
    assert!(text.contains("`dome`") && text.contains("--normals-k"), "{text}");
}

#[test]
fn an_object_switches_a_flag_of_the_scene_off() {
    let folder = site();
    let scene = |options: &str, own: &str| {
        let text = format!("{options}\nradius = 1\n[[object]]\nfile = \"tile.ply\"\n{own}\n");
        let told = dry(&[&folder.write("scene.toml", text)])["info"].take();
        (told["points"].as_u64().unwrap(), told["triangles"].as_u64().unwrap())
    };
    assert_eq!(scene("vertices = true", ""), (4, 0));
    assert_eq!(scene("vertices = true", "vertices = false"), (0, 2));
    assert_eq!(scene("vertices = false", "vertices = true"), (4, 0));
}

#[test]
fn objects_may_share_a_name_that_nothing_refers_to() {
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
        assert!(text.contains("`tile`") && text.contains("object 1 and object 2"), "{text}");
    }
    // Nor may a second file add one of that name.
    let orbit = "[[object]]\nfile = \"tile.ply\"\n[[animation]]\nobject = \"tile\"\nkind = \"orbit\"\nseconds = 1\n";
    let (a, b) = (folder.write("a.toml", orbit), "[[object]]\nfile = \"tile.ply\"\n");
    let b = folder.write("b.toml", b);
    let text = fail(&["render", &a, &b, "-o", "no.png"], 2);
    assert!(text.contains("object 1 and object 2"), "{text}");
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
fn sequences_at_other_rates_keep_them() {
    let folder = site();
    let text = |rate: &str, place: &str| {
        format!("[[object]]\nfiles = [\"dome.ply\", \"tile.ply\"]\nfps = {rate}\n{place}\n")
    };
    let place = "name = \"second\"\ntranslate = [4, 0, 0]";
    let both = folder.write("both.toml", text("10", "") + &text("1", place));
    let slow = folder.write("slow.toml", text("1", "") + &text("1", place));
    // At half a second the first shows its last file, the slow one its first.
    assert_ne!(shot(&folder, &[&both, "--time", "0.5"]), shot(&folder, &[&slow, "--time", "0.5"]));
    assert_eq!(
        shot(&folder, &[&both, "--time", "0.05"]),
        shot(&folder, &[&slow, "--time", "0.05"])
    );
}

#[test]
fn keys_for_another_command_are_no_mistake() {
    let folder = site();
    let options = "time = 0.5\nframes = 2\nfps = 10\nturntable = 3\n";
    let scene = format!("{options}[[object]]\nfile = \"dome.ply\"\n");
    let scene = folder.write("scene.toml", scene);
    shot(&folder, &[&scene]);
    let film = folder.path("film.png");
    succeed(&[&["animate", &scene, "-o", &film], &SMALL[..]].concat());
    let text = fail(&["render", &scene, "-o", "no.png", "--frames", "2"], 2);
    assert!(text.contains("--frames"), "{text}");
}

#[test]
fn two_scene_files_are_one_scene() {
    let folder = site();
    let a = folder.write("a.toml", "spp = 2\nseed = 4\n[[object]]\nfile = \"dome.ply\"\n");
    let b = folder.write("b.json", r#"{"seed": 5, "object": {"file": "tile.ply"}}"#);
    let told = dry(&[&a, &b]);
    assert_eq!(told["object"].as_array().unwrap().len(), 2);
    // Of options that both have, the last file's count.
    assert_eq!((&told["spp"], &told["seed"]), (&json!(2), &json!(5)));
    assert_eq!(dry(&[&b, &a])["seed"], 4);
}

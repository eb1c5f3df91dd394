//! Each command, end to end.

use super::common::{Folder, dome, fail, read_png, stderr, succeed, surfel, tile};
use serde_json::{Value, json};
use std::fs;
use surfel_core::surface::SurfaceKind;

#[test]
fn stats_do_not_replace_other_files() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let bytes = fs::read(&cloud).unwrap();
    let picture = folder.path("dome.png");
    let by_another_name = format!("{}/./dome.png", folder.path(""));
    for stats in [&cloud, &picture, &by_another_name] {
        let error = fail(&["render", &cloud, "-o", &picture, "--stats", stats], 2);
        assert!(error.contains("would replace that file"), "{error}");
    }
    let nowhere = folder.path("nowhere/stats.json");
    fail(&["render", &cloud, "-o", &picture, "--stats", &nowhere], 1);
    assert!(fs::read(&cloud).unwrap() == bytes && !std::path::Path::new(&picture).exists());
}

#[test]
fn render_makes_a_picture_and_stats() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let picture = folder.path("dome.png");
    let stats =
        succeed(&["render", &cloud, "-o", &picture, "--resolution", "96x54", "--stats", "-"]);
    let stats: Value = serde_json::from_str(&stats).unwrap();
    assert_eq!(stats["points"], 1600);
    assert_eq!(stats["rays"]["primary"], 96 * 54 * 4);
    let number = |group: &str, key: &str| stats[group][key].as_f64().unwrap();
    // More than the 24 of a large cloud: blocks and nodes of a small one are not full.
    let [tree, points, total] =
        ["tree", "points", "total"].map(|key| number("bytes_per_point", key));
    assert!(total == tree + points && (20.0..40.0).contains(&total), "{tree} {points}");
    let secs = |key| number("seconds", key);
    let steps = ["load", "prepare", "build", "frame"].map(secs);
    assert!(steps.iter().all(|step| 0.0 < *step), "{steps:?}");
    assert!(steps.iter().sum::<f64>() <= secs("total"), "{stats}");
    assert!(0.0 < secs("trace") && secs("trace") <= secs("frame"), "{stats}");
    for (kind, least) in [("shadow", 1000), ("sky", 1000), ("secondary", 0)] {
        assert!(least <= stats["rays"][kind].as_u64().unwrap(), "{kind}: {stats}");
    }
    let rate = number("rays", "primary") / secs("trace") / 1e6;
    assert!((number("mrays_per_s", "primary") / rate - 1.0).abs() < 1e-9, "{stats}");
    assert_eq!(stats["resolution"], json!([96, 54]));
    let (width, height, channels, samples) = read_png(&picture);
    assert_eq!((width, height, channels), (96, 54, 3));
    assert!(samples.iter().max() > samples.iter().min());
    assert_eq!(folder.names(), ["dome.ply", "dome.png"]);
}

#[test]
fn every_surface_colour_and_camera_gives_another_picture() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let picture = folder.path("dome.png");
    // Each run makes a picture of its own, in which points are seen.
    let render = |options: &[&str]| {
        let size = ["--resolution", "32x24", "--spp", "1", "--no-background"];
        let printed = succeed(&[&["render", &cloud, "-o", &picture], &size[..], options].concat());
        assert_eq!(printed, "", "{options:?}");
        let (width, height, channels, samples) = read_png(&picture);
        assert_eq!((width, height, channels), (32, 24, 4), "{options:?}");
        assert!(samples.iter().skip(3).step_by(4).any(|alpha| *alpha == 255), "{options:?}");
        fs::remove_file(&picture).unwrap();
        samples
    };
    let all_differ = |pictures: &[Vec<u8>]| {
        let is_new = |(i, picture)| !pictures[..i].contains(picture);
        pictures.iter().enumerate().all(is_new)
    };
    let plain = render(&[]);
    let kinds = SurfaceKind::ALL.into_iter().filter(|(_, kind)| *kind != SurfaceKind::Gaussian);
    let surfaces: Vec<Vec<u8>> = kinds.map(|(name, _)| render(&["--surface", name])).collect();
    assert!(all_differ(&surfaces) && surfaces.contains(&plain));
    for (surface, options) in [
        ("octree", &[&["--octree-depth", "4"][..]][..]),
        ("cylinder", &[&["--reach", "1.5"], &["--density", "4"]]),
        ("mls", &[&["--reach", "2"], &["--degree", "3"]]),
        ("splat", &[&["--align", "each"], &["--gather-limit", "nearest"]]),
    ] {
        let pictures =
            options.iter().map(|option| render(&[&["--surface", surface][..], option].concat()));
        let pictures = pictures.chain([render(&["--surface", surface])]);
        assert!(all_differ(&pictures.collect::<Vec<_>>()), "{surface}");
    }
    let colored = |color: &str| render(&["--color", color, "--cmap", "turbo_r"]);
    let by_rain = colored("rain");
    assert!(colored("RAIN") == by_rain);
    let colors = ["rgb", "elevation", "class", "normal", "#ff8000", "surface_variation"];
    assert!(all_differ(&[colors.map(colored).to_vec(), vec![by_rain]].concat()));
    let lights = ["sun", "sky", "headlight", "sun,sky,headlight", "none"];
    assert!(all_differ(&lights.map(|light| render(&["--light", light, "--sun-angle", "0"]))));
    let others = [
        &["--camera-orthographic", "--camera-direction", "0,0,-1"][..],
        &["--camera-orthographic"],
        &["--camera-orthographic=3"],
        &["--camera-orthographic=3", "--up", "-Y"],
        &["--exposure", "-1"],
        &["--camera-panorama"],
        &["--camera-panorama", "--camera-position", "0,0,0.2"],
        &["--camera-panorama", "--camera-position", "0,0,0.2", "--camera-azimuth-angle", "30"],
        &["--camera-position", "-3,-3,2", "--camera-focal-point", "0,0,0"],
        &["--subsample", "random:200"],
        &["--radius", "0.1"],
        &["--radius", "median:6"],
        &["--normals-k", "8"],
        &["--normals-radius", "0.2"],
        &["--color", "normal"],
        &["--color", "normal", "--orient", "viewpoint:0,0,-9"],
    ];
    let pictures = others.into_iter().map(render).chain([plain]);
    assert!(all_differ(&pictures.collect::<Vec<_>>()));
    // Another search finds the same neighbours.
    render(&["--neighbors", "grid", "--normals-radius", "0.2"]);
    assert_eq!(folder.names(), ["dome.ply"]);
}

#[test]
fn a_dry_run_prints_the_choices_and_renders_nothing() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let choices = succeed(&["render", &cloud, "-o", &folder.path("no.png"), "--dry-run"]);
    let choices: Value = serde_json::from_str(&choices).unwrap();
    assert_eq!((&choices["surface"], &choices["color"]), (&"smooth".into(), &"rgb".into()));
    assert_eq!(folder.names(), ["dome.ply"]);
}

#[test]
fn a_panorama_looks_north_from_its_position() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let common = ["render", &cloud, "-o", &folder.path("no.png"), "--dry-run", "--camera-panorama"];
    let camera = |options: &[&str]| {
        let choices = succeed(&[&common, options].concat());
        serde_json::from_str::<Value>(&choices).unwrap()["camera"].take()
    };
    let north = camera(&["--camera-position", "1,2,3", "--up", "+Z"]);
    assert_eq!(north["panorama"], true);
    assert_eq!(north["focal_point"], serde_json::json!([1.0, 3.0, 3.0]));
    let camera_there = camera(&["--camera-position", "1,2,3", "--camera-focal-point", "4,5,6"]);
    assert_eq!(camera_there["focal_point"], serde_json::json!([4.0, 5.0, 6.0]));
}

#[test]
fn a_camera_looks_from_its_position_in_its_direction() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let common = ["render", &cloud, "-o", &folder.path("no.png"), "--dry-run", "--up", "+Z"];
    let direction = |options: &[&str]| {
        let position = ["--camera-position", "10,20,30"];
        let choices = succeed(&[&common[..], &position, options].concat());
        let camera = serde_json::from_str::<Value>(&choices).unwrap()["camera"].take();
        let ahead = |axis: usize| camera["focal_point"][axis].as_f64().unwrap();
        let offset = [0, 1, 2].map(|axis| ahead(axis) - [10.0, 20.0, 30.0][axis]);
        let length = offset.iter().map(|x| x * x).sum::<f64>().sqrt();
        offset.map(|x| (1e4 * x / length).round() / 1e4)
    };
    assert_eq!(direction(&["--camera-direction", "0,3,4"]), [0.0, 0.6, 0.8]);
    assert_eq!(direction(&["--camera-elevation-angle", "90"])[2], -1.0);
    let [x, y, z] = direction(&["--camera-azimuth-angle", "90"]);
    assert!(z == 0.0 && (x.hypot(y) - 1.0).abs() < 1e-3, "{x} {y} {z}");
}

#[test]
fn a_picture_can_be_written_to_stdout() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let output = surfel(&["render", &cloud, "-o", "-", "--resolution", "16x9"]);
    assert!(output.status.success() && output.stdout.starts_with(b"\x89PNG"));
}

#[test]
fn quiet_prints_nothing_and_choices_name_their_options() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let picture = folder.path("dome.png");
    let arguments = ["render", &cloud, "-o", &picture, "--resolution", "16x9"];
    let message = String::from_utf8(surfel(&arguments).stderr).unwrap();
    let flags = ["--up", "--camera-position", "--sun-azimuth", "--sky-ao-distance", "--normals-k"];
    for flag in flags.iter().chain(&["--radius", "--color", "--exposure", "--threads"]) {
        assert!(message.contains(&format!("[{flag}")), "{flag}: {message}");
    }
    for what in
        ["normals of 400 points from planes through 16 neighbours,", "radii 0.", "color rgb"]
    {
        assert_eq!(message.matches(what).count(), 1, "{what}: {message}");
    }
    assert_eq!(message.matches("normals").count(), 2, "once in words, once as a flag: {message}");
    let quiet = surfel(&[&arguments[..], &["--quiet"]].concat());
    assert!(quiet.stderr.is_empty() && quiet.stdout.is_empty());
}

/// Returns a scan of a wall at x = 4 as PTX, whose rays pass through two columns of the grid.
fn wall_with_a_gap() -> String {
    const SIDE: usize = 60;
    let axes = "1 0 0\n0 1 0\n0 0 1\n";
    let pose = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    let mut text = format!("{SIDE}\n{SIDE}\n0 0 0\n{axes}{pose}");
    for column in 0..SIDE {
        for row in 0..SIDE {
            let [azimuth, elevation] = [column, row].map(|index| 0.01 * (index as f64 - 30.0));
            let (y, z) = (4.0 * azimuth.tan(), 4.0 * elevation.tan() / azimuth.cos());
            let is_open = (30..32).contains(&column);
            text += &if is_open { "0 0 0 0.5\n".to_owned() } else { format!("4 {y} {z} 0.5\n") };
        }
    }
    text
}

#[test]
fn discs_end_where_a_scanner_saw_through_unless_turned_off() {
    let folder = Folder::new();
    let scan = folder.write("wall.ptx", wall_with_a_gap());
    let picture = folder.path("wall.png");
    let arguments = ["render", &scan, "-o", &picture, "--resolution", "16x9"];
    let message = stderr(&surfel(&arguments));
    assert!(message.contains("scanners saw past"), "{message}");
    assert!(message.contains("[--free-space]"), "{message}");
    let message = stderr(&surfel(&[&arguments[..], &["--free-space=false"]].concat()));
    assert!(message.contains("normals of ") && !message.contains("scanners saw"), "{message}");
}

#[test]
fn info_prints_a_table_or_json() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let table = succeed(&["info", &cloud]);
    assert!(table.contains("PLY") && table.contains("rain") && table.contains("400"), "{table}");
    let both: Value = serde_json::from_str(&succeed(&["info", "--json", &cloud, &cloud])).unwrap();
    assert_eq!(both.as_array().unwrap().len(), 2);
    assert_eq!(both[0]["bounds"]["min"][0], -1.0);
}

#[test]
fn info_counts_triangles_and_points_without_position() {
    let folder = Folder::new();
    let mesh =
        folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 # a quad\nf 1 2 3\n");
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &mesh])).unwrap();
    assert_eq!((&info["points"], &info["triangles"]), (&json!(4), &json!(3)));
    let cloud = folder.write("a.xyz", "1 2 3\nnan 5 6\n7 8 9\n");
    let table = succeed(&["info", &cloud]);
    assert!(table.contains("1 of them without a position"), "{table}");
    let nowhere = folder.write("b.xyz", "nan 5 6\nnan 5 7\n");
    let table = succeed(&["info", &nowhere]);
    assert!(table.contains("bounds        none: no point has a position"), "{table}");
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &nowhere])).unwrap();
    assert_eq!(info["bounds"], Value::Null);
}

#[test]
fn info_counts_classes_and_returns_and_sums_up_headers() {
    let folder = Folder::new();
    let lines: String = (0..100)
        .map(|i| format!("{},{},0,{},{}\n", i % 10, i / 10, 2 + i % 2 * 3, 1 + i / 90))
        .collect();
    let cloud = folder.write("a.csv", ["x,y,z,classification,return_number\n", &lines].concat());
    let las = folder.path("a.las");
    succeed(&["prepare", &cloud, "-o", &las]);
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &las])).unwrap();
    assert_eq!(info["classes"], json!({ "2 ground": 50, "5 high vegetation": 50 }));
    assert_eq!(info["returns"], json!({ "1": 90, "2": 10 }));
    let density = info["points_per_square_unit"].as_f64().unwrap();
    assert!((0.3..1.2).contains(&density), "{density}");
    let table = succeed(&["info", &las]);
    assert!(table.contains("5 high vegetation") && table.contains("50.0 %"), "{table}");
    assert!(
        table.contains("unit          unknown") && table.contains(" points a square unit seen")
    );
    assert_eq!(info["unit"], "unknown");

    // The greatest number stands for a missing value.
    let heights = format!("x,y,z,height\n0,0,0,3\n1,0,0,{}\n0,1,0,5\n", f64::MAX);
    let gaps = folder.write("gaps.csv", heights);
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &gaps])).unwrap();
    assert_eq!(info["columns"]["height"], json!([3.0, 5.0]));

    let of_header: Value =
        serde_json::from_str(&succeed(&["info", "--summary", "--json", &las])).unwrap();
    assert_eq!(of_header["points"], 100);
    assert_eq!(of_header["bounds"], json!({ "min": [0.0, 0.0, 0.0], "max": [9.0, 9.0, 0.0] }));
    let columns = of_header["columns_in_file"].as_array().unwrap();
    assert!(columns.iter().any(|name| name == "return_number"), "{columns:?}");
    let summary = succeed(&["info", "--summary", &las, &cloud]);
    assert!(summary.contains("bounds        not stated"), "{summary}");
}

#[test]
fn info_states_units_and_the_grids_of_stations() {
    let folder = Folder::new();
    // A quarter turn about z.
    let header = "2\n3\n5 6 7\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n";
    let cells: String = (0..6).map(|i| format!("{} {} 1 0.5\n", 1 + i % 3, i / 3)).collect();
    let scan = folder.write("scan.ptx", [header, &cells].concat());
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &scan])).unwrap();
    assert_eq!(info["unit"], "metre");
    let station = &info["stations"][0];
    assert_eq!((&station["rows"], &station["columns"]), (&json!(3), &json!(2)));
    let half = 0.5_f64.sqrt();
    for (i, expected) in [0.0, 0.0, half, half].into_iter().enumerate() {
        assert!((station["rotation"][i].as_f64().unwrap() - expected).abs() < 1e-9, "{station}");
    }
    let table = succeed(&["info", &scan]);
    assert!(
        table.contains(", 3 rows and 2 columns") && table.contains("rotation x y z w 0, 0, 0.7")
    );
    assert!(table.contains(" points a square metre seen from above"), "{table}");
    // PLY keeps the station, LAS says that it does not.
    let [ply, las] = ["scan.ply", "scan.las"].map(|name| folder.path(name));
    let kept = stderr(&surfel(&["prepare", &scan, "-o", &ply]));
    assert!(!kept.contains("are lost"), "{kept}");
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &ply])).unwrap();
    assert_eq!(info["stations"][0], *station);
    let lost = stderr(&surfel(&["prepare", &scan, "-o", &las]));
    assert!(lost.contains("name and pose of 1 station are lost"), "{lost}");
}

#[test]
fn info_and_prepare_accept_meshes() {
    let folder = Folder::new();
    let mesh = folder.write("tile.ply", tile(2.0, 1.0, [10, 20, 30]));
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &mesh])).unwrap();
    assert_eq!((&info["points"], &info["triangles"]), (&4.into(), &2.into()));
    assert!(succeed(&["info", &mesh]).contains("triangles"));
    let prepared = folder.path("out.ply");
    succeed(&["prepare", &mesh, "-o", &prepared]);
    let info: Value = serde_json::from_str(&succeed(&["info", "--json", &prepared])).unwrap();
    assert_eq!((&info["points"], &info["triangles"]), (&4.into(), &Value::Null));
    // The names are those that filters take.
    let columns = info["columns"].as_object().unwrap().keys();
    let filter: Vec<String> = columns.map(|name| format!("{name} < 1e9")).collect();
    assert!(filter.contains(&"nz < 1e9".into()) && filter.contains(&"blue < 1e9".into()));
    let kept = folder.path("kept.ply");
    succeed(&["prepare", &prepared, "-o", &kept, "--filter", &filter.join(" && ")]);
}

#[test]
fn demo_scans_and_renders() {
    let folder = Folder::new();
    let output = folder.path("demo");
    let summary = succeed(&["demo", "-o", &output, "--points", "3000"]);
    assert!(summary.contains("surfel render") && summary.contains("demo.laz"), "{summary}");
    // The printed command is quoted for a shell.
    assert!(summary.contains("'--background=#4f7fb8,#d5e2ee'"), "{summary}");
    let (width, height, ..) = read_png(folder.0.join("demo/demo.png"));
    assert_eq!((width, height), (1280, 720));
    assert!(fs::metadata(folder.0.join("demo/demo.laz")).unwrap().len() > 10_000);
}

#[test]
fn a_dry_run_refuses_pixels_beside_a_mesh_as_rendering_does() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let mesh = folder.write("tile.ply", tile(1.0, 0.0, [255; 3]));
    let picture = folder.path("out.png");
    let scene = [cloud.as_str(), &mesh, "--surface", "points", "--quiet"];
    let refusal = fail(&[&["render", "-o", &picture][..], &scene].concat(), 1);
    assert!(refusal.contains("points for all of the scene"), "{refusal}");
    for command in [&["render", "--dry-run"][..], &["animate", "--dry-run", "--frames", "2"]] {
        assert_eq!(fail(&[command, &scene].concat(), 1), refusal);
        succeed(&[command, &scene, &["--vertices"]].concat());
    }
    let object = |file: &str, rest: &str| format!("[[object]]\nfile = {file:?}\n{rest}\n");
    let text = object(&cloud, "surface = \"points\"") + &object(&mesh, "visible = false");
    succeed(&["render", "--dry-run", &folder.write("scene.toml", text)]);
}

//! `surfel prepare`: which points it keeps, which columns it adds, and what its steps do to them.

use super::common::{Folder, dome, fail, square, stderr, succeed, surfel};
use serde_json::Value;
use std::fs;

/// Prepares a cloud and returns the lines of the text that it becomes, as numbers, and the names of their columns.
fn prepared(folder: &Folder, cloud: &str, options: &[&str]) -> (Vec<Vec<f64>>, Vec<String>) {
    let output = folder.path("prepared.xyz");
    succeed(&[&["prepare", cloud, "-o", &output], options].concat());
    let text = fs::read_to_string(output).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().trim_start_matches("//").split(' ').map(str::to_lowercase);
    let numbers = |line: &str| line.split(' ').map(|word| word.parse().unwrap()).collect();
    (lines.map(numbers).collect(), names.collect())
}

#[test]
fn prepare_adds_the_requested_columns_or_all() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let prepared = folder.path("out.ply");
    let columns = |options: &[&str]| {
        succeed(&[&["prepare", &cloud, "-o", &prepared], options].concat());
        let info: Value = serde_json::from_str(&succeed(&["info", "--json", &prepared])).unwrap();
        let has = |name: &str| info["columns"].get(name).is_some();
        assert!(has("red") && has("classification") && has("rain"));
        let columns = [has("nx"), has("radius"), has("surface_variation")];
        (info["points"].as_u64().unwrap(), columns)
    };
    assert_eq!(columns(&[]), (900, [true, true, false]));
    assert_eq!(columns(&["--normals"]), (900, [true, false, false]));
    assert_eq!(columns(&["--radius", "0.1"]), (900, [false, true, false]));
    assert_eq!(columns(&["--orient", "mst"]), (900, [true, false, false]));
    assert_eq!(columns(&["--keep-variation"]), (900, [false, false, true]));
    assert_eq!(columns(&["--subsample", "first:10"]), (10, [false, false, false]));
    assert_eq!(columns(&["--filter", "rain >= 0 && x > -1e9"]), (900, [false, false, false]));
    assert_eq!(columns(&["--mixed-pixels", "drop"]), (900, [false, false, false]));
}

#[test]
fn prepare_moves_degrees_if_asked_and_warns_otherwise() {
    let folder = Folder::new();
    let degrees = |first: f64, i: i32| first + 1e-4 * f64::from(i);
    let line = |i: i32| {
        format!("{:.4} {:.4} {}\n", degrees(11.57, i % 30), degrees(48.13, i / 30), i % 17)
    };
    let cloud = folder.write("degrees.xyz", (0..900).map(line).collect::<String>());
    let prepared = folder.path("out.xyz");
    let message = |options: &[&str]| {
        let arguments = [&["prepare", &cloud, "-o", &prepared, "--normals"], options].concat();
        stderr(&surfel(&arguments))
    };
    let warning = "look like degrees of longitude and latitude";
    let kept = message(&[]);
    assert!(kept.contains(warning) && kept.contains("[--reproject]"), "{kept}");
    let moved = message(&["--reproject"]);
    assert!(moved.contains("moved to metres of EPSG:32632 [--reproject]"), "{moved}");
    assert!(!moved.contains(warning) && !message(&["--reproject=false"]).contains(warning));
}

#[test]
fn prepare_keeps_duplicates_unless_asked() {
    let folder = Folder::new();
    let cloud = folder.write("twice.xyz", square(20, 9).repeat(2));
    let prepared = folder.path("out.xyz");
    let n_points = |options: &[&str]| {
        let output = surfel(&[&["prepare", &cloud, "-o", &prepared], options].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        (fs::read_to_string(&prepared).unwrap().lines().count() - 1, stderr(&output))
    };
    for options in [&[][..], &["--duplicates", "keep"]] {
        let (n, message) = n_points(options);
        assert_eq!(n, 800);
        assert!(
            message.contains("400 points kept at exactly the position of another"),
            "{message}"
        );
        assert!(message.contains("[--duplicates]"), "{message}");
    }
    let (n, message) = n_points(&["--duplicates", "drop"]);
    assert_eq!(n, 400);
    assert!(
        message.contains("400 points dropped: at exactly the position of another"),
        "{message}"
    );
    // Nothing else was asked for, so there are no normals and radii.
    let text = fs::read_to_string(&prepared).unwrap();
    assert!(text.starts_with("//X Y Z R G B\n0 0 0 9 9 9\n"), "{text}");
}

#[test]
fn prepare_does_not_replace_a_file_that_it_reads() {
    let folder = Folder::new();
    let file = folder.write("scan.xyz", "0 0 0\n1 0 0\n0 1 0\n0 1 0\n");
    let message = fail(&["prepare", &file, "-o", &file, "--duplicates", "drop"], 2);
    assert!(message.contains("name another output"), "{message}");
    assert!(fs::read_to_string(&file).unwrap().ends_with("0 1 0\n0 1 0\n"));
}

#[test]
fn points_are_chosen_by_an_area() {
    let folder = Folder::new();
    let lines: String = (0..100).map(|i| format!("{} {} {i}\n", i % 10, i / 10)).collect();
    let cloud = folder.write("grid.xyz", lines);
    let kept = folder.path("kept.ply");
    let n_kept = |area: &str| {
        succeed(&["prepare", &cloud, "-o", &kept, "--crop", area]);
        let info: Value = serde_json::from_str(&succeed(&["info", "--json", &kept])).unwrap();
        info["points"].as_u64().unwrap()
    };
    assert_eq!(n_kept("([1,3],[2,8.5])"), 21);
    assert_eq!(n_kept("1,2,3,8.5"), 21);
    assert_eq!(n_kept("([1,3],[2,8],[0,50])"), 9);
    let square = "[[[-0.5,-0.5],[4.5,-0.5],[4.5,4.5],[-0.5,4.5],[-0.5,-0.5]],\
                  [[0.5,0.5],[3.5,0.5],[3.5,3.5],[0.5,3.5],[0.5,0.5]]]";
    let geometry = format!(r#"{{"type":"Polygon","coordinates":{square}}}"#);
    let feature = format!(r#"{{"type":"Feature","properties":{{}},"geometry":{geometry}}}"#);
    assert_eq!(n_kept(&folder.write("ring.geojson", feature)), 16);
    let wkt = "multipolygon (((-1 -1, 1.5 -1, 1.5 1.5, -1 1.5, -1 -1)), ((8.5 8.5, 11 8.5, 8.5 11, 8.5 8.5)))";
    assert_eq!(n_kept(wkt), 5);
    assert_eq!(n_kept(&folder.write("area.wkt", wkt)), 5);

    let refused = |area: &str, code| fail(&["prepare", &cloud, "-o", &kept, "--crop", area], code);
    assert!(refused("1,2,3", 2).contains("expected bounds"));
    assert!(refused("POLYGON ((0 0, 1 1))", 2).contains("a ring of 2 corners"));
    assert!(refused("absent.geojson", 2).contains("absent.geojson: cannot be read"));
    let no_area = folder.write("point.geojson", r#"{"type":"Point","coordinates":[1,2]}"#);
    assert!(refused(&no_area, 2).contains("point.geojson"));
    let broken =
        folder.write("broken.geojson", r#"{"type":"Polygon","coordinates":[[[0,0],[1]]]}"#);
    assert!(refused(&broken, 2).contains("broken.geojson"));
}

#[test]
fn points_are_chosen_by_their_columns() {
    let folder = Folder::new();
    let lines: String =
        (0..100).map(|i| format!("{i},{},0,{},{},{}\n", i % 10, 2 + i % 5, 1 + i % 2, 2)).collect();
    let lines = lines + "100,0,0,7,1,1\n101,0,0,7,1,1\n102,0,0,7,1,3\n";
    let header = "x,y,z,classification,return_number,number_of_returns\n";
    let cloud = folder.write("returns.csv", [header, &lines].concat());
    let kept = folder.path("kept.las");
    let n_kept = |options: &[&str]| {
        let arguments = [&["prepare", &cloud, "-o", &kept], options].concat();
        let output = surfel(&arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{message}");
        let info: Value = serde_json::from_str(&succeed(&["info", "--json", &kept])).unwrap();
        let n_points = info["points"].as_u64().unwrap();
        assert!(message.contains(&format!("{n_points} of 103 points meet")), "{message}");
        n_points
    };
    assert_eq!(n_kept(&["--filter", "x < 30 && y != 0"]), 27);
    // Two pulses have a single return; of the others the first is not the only one.
    assert_eq!(n_kept(&["--returns", "only"]), 2);
    assert_eq!(n_kept(&["--returns", "only", "--filter", "x == 101"]), 1);
    assert_eq!(n_kept(&["--class", "ground,6"]), 40);
    assert_eq!(n_kept(&["--class", "2", "--returns", "last"]), 10);
    assert_eq!(n_kept(&["--returns", "first", "--filter", "x[:9]"]), 5);

    let none = fail(&["render", &cloud, "-o", &folder.path("no.png"), "--filter", "x > 1000"], 1);
    assert!(none.contains("0 of 103 points meet x > 1000"), "{none}");
    assert!(none.contains("returns.csv: no point meets x > 1000"), "{none}");
    let before = fs::read(&kept).unwrap();
    for steps in [&[][..], &["--normals"]] {
        let options = ["prepare", &cloud, "-o", &kept, "--filter", "x > 1000", "--class", "2"];
        let none = fail(&[&options, steps].concat(), 1);
        let filter = "no point meets x > 1000 && classification == 2";
        assert!(none.contains(filter), "{none}");
        assert!(fs::read(&kept).unwrap() == before);
    }
    let unknown = fail(&["prepare", &cloud, "-o", &kept, "--filter", "clas == 2"], 1);
    assert!(unknown.contains("'clas'") && unknown.contains("classification"), "{unknown}");
    let plain = folder.write("plain.xyz", square(10, 200));
    for (option, value, column) in
        [("--class", "2", "classification"), ("--returns", "last", "return_number")]
    {
        let lacks = fail(&["prepare", &plain, "-o", &kept, option, value], 1);
        assert!(lacks.contains(&format!("'{column}'")), "{lacks}");
        assert!(lacks.trim_end().ends_with(&format!("[{option}]")), "{lacks}");
    }
    let broken = fail(&["prepare", &cloud, "-o", &kept, "--filter", "x = 2"], 2);
    assert!(broken.contains("character 3: found `=`"), "{broken}");
    let class = fail(&["prepare", &cloud, "-o", &kept, "--class", "gras"], 2);
    assert!(class.contains("as in 2,6 or ground,building"), "{class}");
}

#[test]
fn the_range_of_filtered_colours_is_told() {
    let folder = Folder::new();
    let cloud = folder.write("grey.xyz", square(10, 200));
    let output = folder.path("kept.ply");
    let filtered =
        |filter: &str| stderr(&surfel(&["prepare", &cloud, "-o", &output, "--filter", filter]));
    let text = filtered("red > 300");
    assert!(
        text.contains("100 of 100 points meet red > 300, with colours from 0 to 65535"),
        "{text}"
    );
    let text = filtered("red > 100");
    assert!(text.contains("meet red > 100, with colours from 0 to 255"), "{text}");
    assert!(filtered("z < 300").contains("meet z < 300\n"));
}

#[test]
fn no_more_neighbours_are_told_than_there_are() {
    let folder = Folder::new();
    let cloud = folder.write("few.xyz", square(3, 200));
    let text = stderr(&surfel(&["prepare", &cloud, "-o", &folder.path("few.ply")]));
    assert!(text.contains("through 8 neighbours") && text.contains("the 8th neighbour"), "{text}");
}

#[test]
fn removed_outliers_are_the_points_that_stand_alone() {
    let folder = Folder::new();
    let level = square(20, 9);
    let cloud = folder.write("stray.xyz", format!("{level}60 60 60 1 1 1\n"));
    let kept = |options: &[&str]| prepared(&folder, &cloud, options).0;
    assert_eq!(kept(&["--normals"]).len(), 401);
    for choice in ["radius:1.5,1", "radius:3,6", "statistical", "statistical:8,3"] {
        let points = kept(&["--remove-outliers", choice]);
        assert_eq!(points.len(), 400, "{choice}");
        assert!(points.iter().all(|point| point[2] == 0.0), "{choice}");
    }
    // The corners of the square have five others within this distance, its inner points more.
    let inner = kept(&["--remove-outliers", "radius:2,7"]);
    assert_eq!(inner.len(), 400 - 4);
}

#[test]
fn denoising_moves_points_of_a_plane_closer_to_it() {
    let folder = Folder::new();
    let noise = |i: usize| ((i * 7919) % 1000) as f64 / 1000.0 - 0.5;
    let point = |i: usize| format!("{} {} {}\n", i % 40, i / 40, noise(i));
    let cloud = folder.write("noisy.xyz", (0..1600).map(point).collect::<String>());
    let variance = |options: &[&str]| {
        let points = prepared(&folder, &cloud, options).0;
        assert_eq!(points.len(), 1600);
        points.iter().map(|point| point[2] * point[2]).sum::<f64>() / 1600.0
    };
    let raw = variance(&["--denoise", "off"]);
    assert!((0.07..0.1).contains(&raw), "{raw}");
    for when in ["on", "auto"] {
        let denoised = variance(&["--denoise", when]);
        assert!(denoised < 0.3 * raw, "{when}: {denoised} {raw}");
    }
}

#[test]
fn normals_point_to_the_side_that_is_asked_for() {
    let folder = Folder::new();
    let cloud = folder.write("level.xyz", square(20, 9));
    let normals = |rule: &str| {
        let (points, names) = prepared(&folder, &cloud, &["--orient", rule]);
        let z = names.iter().position(|name| name == "nz").unwrap();
        let is_up = points.iter().filter(|point| 0.99 < point[z]).count();
        let is_down = points.iter().filter(|point| point[z] < -0.99).count();
        assert_eq!((points.len(), is_up + is_down), (400, 400), "{rule}");
        is_up
    };
    assert_eq!(normals("up"), 400);
    assert_eq!(normals("viewpoint:10,10,-30"), 0);
    assert_eq!(normals("viewpoint:10,10,30"), 400);
    let mixed = folder.write("two.xyz", square(20, 9) + &square(20, 9).replace(" 0 9", " 40 9"));
    let (points, names) = prepared(&folder, &mixed, &["--orient", "viewpoint:10,10,20"]);
    let z = names.iter().position(|name| name == "nz").unwrap();
    // A viewpoint between floor and ceiling sees the upper side of one and the lower side of the other.
    assert!(points.iter().all(|point| (0.99 < point[z]) == (point[2] == 0.0)));
}

//! Ways to name inputs: standard input, folders and patterns.

use super::common::{Folder, SMALL, command, dome, fail, shot, square, stderr, succeed, surfel};
use std::fs;
use std::io::Write;
use std::process::{Output, Stdio};

/// Runs the program with these bytes as standard input; fails if it leaves a temporary file behind.
fn pipe(arguments: &[&str], input: &[u8]) -> Output {
    let mut command = command(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let prefix = format!("surfel-stdin-{}.", child.id());
    // A program that fails early reads nothing.
    let _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    let entries = fs::read_dir(std::env::temp_dir()).unwrap().flatten();
    let mut names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    assert!(!names.any(|name| name.starts_with(&prefix)), "{prefix} was left behind");
    output
}

#[test]
fn standard_input_shows_the_same_picture_as_its_file() {
    let folder = Folder::new();
    for (name, content) in [("dome.ply", dome(20)), ("square.xyz", square(12, 90))] {
        let expected = shot(&folder, &[&folder.write(name, &content)]);
        let picture = folder.path("piped.png");
        let arguments = [&["render", "-", "-o", &picture], &SMALL[..]].concat();
        let output = pipe(&arguments, content.as_bytes());
        assert!(output.status.success(), "{name}: {}", stderr(&output));
        assert!(fs::read(&picture).unwrap() == expected, "{name}");
    }
}

#[test]
fn info_and_prepare_read_standard_input() {
    let folder = Folder::new();
    let info = pipe(&["info", "--json", "-"], dome(20).as_bytes());
    assert!(String::from_utf8_lossy(&info.stdout).contains("\"points\": 400"), "{info:?}");
    let prepared = folder.path("out.ply");
    let output = pipe(&["prepare", "-", "-o", &prepared], square(9, 5).as_bytes());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(succeed(&["info", &prepared]).contains("nz"));
}

#[test]
fn invalid_standard_input_is_an_error() {
    let folder = Folder::new();
    let picture = folder.path("no.png");
    for input in [&b""[..], b"these are no points", b"ply\nformat ascii 1.0\n"] {
        let output = pipe(&["render", "-", "-o", &picture], input);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: ") && !text.contains("panicked"), "{text}");
        let names_it = text.contains("standard input") && !text.contains("surfel-stdin");
        assert!(names_it, "{text}");
    }
    let output = pipe(&["render", "-", "-", "-o", &picture], dome(10).as_bytes());
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("name it once"), "{}", stderr(&output));
    assert!(folder.names().is_empty());
}

#[test]
fn a_folder_stands_for_its_clouds_and_meshes() {
    let folder = Folder::new();
    fs::create_dir(folder.path("tiles")).unwrap();
    let near = folder.write("tiles/near.ply", dome(20));
    let far = folder.write("tiles/far.xyz", square(6, 200));
    folder.write("tiles/notes.md", "no points");
    let readme = folder.write("tiles/README.TXT", "The tiles of the valley\n");
    folder.write("tiles/buffer.bin", [7; 41]);
    fs::create_dir(folder.path("tiles/more.ply")).unwrap();
    let expected = shot(&folder, &[&far, &near]);
    assert!(shot(&folder, &[&folder.path("tiles")]) == expected);
    let output = surfel(&["info", "--summary", &folder.path("tiles")]);
    assert!(stderr(&output).contains(&format!("{readme}: left out")), "{}", stderr(&output));
    assert!(shot(&folder, &[&near]) != expected);
    fs::remove_file(near).unwrap();
    fs::remove_file(far).unwrap();
    let text = fail(&["render", &folder.path("tiles"), "-o", "no.png"], 1);
    assert!(text.contains("tiles: holds no point cloud, mesh or glTF scene"), "{text}");
}

#[test]
fn a_pattern_stands_for_the_files_that_match_it() {
    let folder = Folder::new();
    let tiles: Vec<String> = ["tile_1.xyz", "tile_2.xyz", "tile_10.xyz"]
        .iter()
        .enumerate()
        .map(|(i, name)| folder.write(name, square(5 + 2 * i, 60 + 60 * i as u8)))
        .collect();
    folder.write("other.xyz", square(30, 9));
    let tiles: Vec<&str> = tiles.iter().map(String::as_str).collect();
    let expected = shot(&folder, &tiles);
    assert!(shot(&folder, &[&folder.path("tile_*.xyz")]) == expected);
    assert!(shot(&folder, &[&folder.path("*.xyz")]) != expected);
    let text = fail(&["render", &folder.path("tile_*.laz"), "-o", "no.png"], 1);
    assert!(text.contains("no file matches") && text.contains("tile_*.laz"), "{text}");
}

#[test]
fn a_file_whose_name_has_a_star_is_not_a_pattern() {
    let folder = Folder::new();
    let star = folder.write("a*.xyz", square(9, 100));
    folder.write("ab.xyz", square(20, 3));
    let plain = folder.write("plain.xyz", square(9, 100));
    assert!(shot(&folder, &[&star]) == shot(&folder, &[&plain]));
}

#[test]
fn the_first_column_of_a_text_may_be_skipped() {
    let folder = Folder::new();
    let lines: String = (0..100).map(|i| format!("7 {} {} 1\n", i % 10, i / 10)).collect();
    let cloud = folder.write("numbered.txt", lines);
    let info = succeed(&["info", "--json", "--columns", "-,x,y,z", &cloud]);
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    assert_eq!(info["bounds"]["max"], serde_json::json!([9.0, 9.0, 1.0]));
    let summary = succeed(&["info", "--summary", &cloud]);
    assert!(summary.contains("columns       not stated"), "{summary}");
}

#[test]
fn columns_of_a_survey_are_understood() {
    let folder = Folder::new();
    let lines: String = (0..100).map(|i| format!("{i} {} {} 7 post\n", i / 10, i % 10)).collect();
    let cloud = folder.write("survey.txt", lines);
    for columns in ["p,n,e,z,d", "-,N,E,H,-"] {
        let info = succeed(&["info", "--json", "--columns", columns, &cloud]);
        let info: serde_json::Value = serde_json::from_str(&info).unwrap();
        assert_eq!(info["bounds"]["max"], serde_json::json!([9.0, 9.0, 7.0]), "{columns}");
    }
    let text = fail(&["info", "--columns", "p,a,b,c,d", &cloud], 1);
    assert!(text.contains("as in x,y,z,-,r,g,b or -,n,e,h"), "{text}");
}

#[test]
fn misspelled_columns_of_text_are_told_with_the_nearest() {
    let folder = Folder::new();
    let lines: String = (0..100).map(|i| format!("{} {} 1 9 9 9\n", i % 10, i / 10)).collect();
    let cloud = folder.write("square.xyz", lines);
    let output = folder.path("square.ply");
    let told = |columns: &str| {
        let arguments = ["prepare", &cloud, "-o", &output, "--columns", columns];
        stderr(&surfel(&[&arguments[..], &["--subsample", "first:9"]].concat()))
    };
    let text = told("x,y,z,r,g,blu");
    let warning =
        "warning: column `blu` has no meaning; the nearest known one is `blue` [--columns]";
    assert!(text.contains(warning), "{text}");
    assert!(!told("x,y,z,rain,time,range").contains("warning"));
}

#[test]
fn a_file_without_colours_is_named_with_the_option_that_keeps_it_apart() {
    let folder = Folder::new();
    let lines = |color: &str| -> String {
        (0..100).map(|i| format!("{} {} 1{color}\n", i % 10, i / 10)).collect()
    };
    let red = folder.write("red.xyz", lines(" 255 0 0"));
    let bare = folder.write("bare.xyz", lines(""));
    let picture = folder.path("both.png");
    let arguments = [&["render", &red, &bare, "-o", &picture], &SMALL[..]].concat();
    let message = stderr(&surfel(&arguments));
    let option = format!("{bare}:color=#d6d2ca");
    let expected = format!("no colours in {bare}: --object-settings {option} keeps it apart");
    assert!(message.contains(&expected), "{message}");
    let another = folder.write("another.xyz", lines(""));
    let message = stderr(&surfel(&[&arguments[..], &[&another]].concat()));
    assert!(message.contains(&format!("no colours in {bare} and 1 file more: ")), "{message}");
    let message = stderr(&surfel(&[&arguments[..], &["--object-settings", &option]].concat()));
    assert!(!message.contains("no colours in"), "{message}");
    assert!(message.contains("color rgb"), "{message}");
}

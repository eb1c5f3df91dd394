//! Films that were stopped and are taken up again.

use super::animate::{film, read_gif};
use super::common::{Folder, command, dome, fail, stderr, succeed};
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Stops a film by Ctrl-C when so many frames of it are kept in a folder.
fn interrupt(arguments: &[&str], folder: &str, pattern: &str) {
    let mut child = command(arguments).stderr(Stdio::piped()).spawn().unwrap();
    let start = Instant::now();
    let is_begun = || {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().into_string().unwrap());
        names.into_iter().any(|name| name == pattern)
    };
    while !is_begun() {
        assert!(start.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("--resume"), "{}", stderr(&output));
}

/// Long enough that it is stopped on its way.
const LONG: [&str; 8] =
    ["--turntable", "4", "--fps", "10", "--resolution", "160x120", "--spp", "4"];

#[test]
fn a_film_that_was_stopped_is_taken_up_where_it_was() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let whole = folder.path("whole.gif");
    succeed(&[&["animate", &cloud, "-o", &whole], &LONG[..]].concat());
    let part = folder.path("part.gif");
    let arguments = [&["animate", &cloud, "-o", &part], &LONG[..]].concat();
    let frames = folder.path("part.gif.frames");
    interrupt(&arguments, &frames, "000002.png");
    assert!(!folder.names().contains(&"part.gif".to_owned()));
    let first = fs::metadata(format!("{frames}/000001.png")).unwrap().modified().unwrap();

    // Other settings, another file: refused, and what is there stays.
    let resume = [&arguments[..], &["--resume"]].concat();
    for other in [&["--seed", "3"][..], &["--cmap", "turbo"], &["--radius", "0.3"]] {
        let told = fail(&[&resume[..], other].concat(), 1);
        assert!(told.contains("part.gif") && told.contains("ask for the same"), "{told}");
    }
    let again = fs::metadata(format!("{frames}/000001.png")).unwrap().modified().unwrap();
    assert_eq!(first, again);

    let told = stderr(&command(&resume).output().unwrap());
    assert!(told.contains("of 40 frames are there already"), "{told}");
    assert!(fs::read(&part).unwrap() == fs::read(&whole).unwrap());
    assert_eq!(folder.names(), ["dome.ply", "part.gif", "whole.gif"]);
}

#[test]
fn a_film_is_not_taken_up_with_other_materials() {
    let folder = Folder::new();
    let grid = (0..400).map(|i| format!("v {} {} {}\n", i % 20, i / 20, (i * i) % 5));
    let faces = (1..379).map(|i| format!("f {i} {} {}\n", i + 1, i + 20));
    let mesh: String = grid.chain(["usemtl m\n".to_owned()]).chain(faces).collect();
    let mesh = folder.write("mesh.obj", format!("mtllib m.mtl\n{mesh}"));
    folder.write("m.mtl", "newmtl m\nKd 1 0 0\n");
    let part = folder.path("part.gif");
    let arguments = [&["animate", &mesh, "-o", &part], &LONG[..]].concat();
    interrupt(&arguments, &folder.path("part.gif.frames"), "000002.png");
    folder.write("m.mtl", "newmtl m\nKd 0 0.5 0\n");
    let told = fail(&[&arguments[..], &["--resume"]].concat(), 1);
    assert!(told.contains("ask for the same"), "{told}");
}

#[test]
fn numbered_pictures_are_taken_up_too() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let part = folder.path("f##.png");
    let arguments = [&["animate", &cloud, "-o", &part], &LONG[..]].concat();
    interrupt(&arguments, &folder.path(""), "f03.png");
    let early = fs::metadata(folder.path("f01.png")).unwrap().modified().unwrap();
    succeed(&[&arguments[..], &["--resume"]].concat());
    assert_eq!(early, fs::metadata(folder.path("f01.png")).unwrap().modified().unwrap());
    assert_eq!(folder.names().len(), 41);
    let resumed = fs::read(folder.path("f40.png")).unwrap();
    succeed(&arguments);
    assert!(resumed == fs::read(folder.path("f40.png")).unwrap());
}

#[test]
fn nothing_to_take_up_is_a_film_from_the_start() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let path = folder.path("film.gif");
    film(&[&cloud, "-o", &path, "--turntable", "1", "--fps", "3", "--resume"]);
    assert_eq!(read_gif(&path).0, 3);
}

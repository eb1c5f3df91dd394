//! Interrupted movies continue with `--resume`.

use super::animate::{movie, read_gif};
use super::common::{Folder, command, dome, fail, stderr, succeed};
use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

/// Runs the program and sends SIGINT as soon as the folder has this file.
fn interrupt(arguments: &[&str], folder: &str, pattern: &str) {
    let mut child = command(arguments).stderr(Stdio::piped()).spawn().unwrap();
    let is_begun = || {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let names = entries.map(|entry| entry.file_name().into_string().unwrap());
        names.into_iter().any(|name| name == pattern)
    };
    while !is_begun() {
        assert!(child.try_wait().unwrap().is_none(), "the movie ended before it was interrupted");
        std::thread::sleep(Duration::from_millis(2));
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(kill.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(stderr(&output).contains("--resume"), "{}", stderr(&output));
}

/// Options of a movie that takes long enough to be interrupted.
const SLOW_MOVIE: [&str; 8] =
    ["--turntable", "4", "--fps", "10", "--resolution", "160x120", "--spp", "4"];

#[test]
fn an_interrupted_movie_continues_with_the_missing_frames() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let whole = folder.path("whole.gif");
    succeed(&[&["animate", &cloud, "-o", &whole], &SLOW_MOVIE[..]].concat());
    let part = folder.path("part.gif");
    let arguments = [&["animate", &cloud, "-o", &part], &SLOW_MOVIE[..]].concat();
    let frames = folder.path("part.gif.frames");
    interrupt(&arguments, &frames, "000002.png");
    assert!(!folder.names().contains(&"part.gif".to_owned()));
    let first = fs::metadata(format!("{frames}/000001.png")).unwrap().modified().unwrap();

    // Other settings are rejected, and the finished frames stay.
    let resume = [&arguments[..], &["--resume"]].concat();
    for other in [&["--seed", "3"][..], &["--cmap", "turbo"], &["--radius", "0.3"]] {
        let message = fail(&[&resume[..], other].concat(), 1);
        assert!(message.contains("part.gif") && message.contains("request the same"), "{message}");
    }
    let again = fs::metadata(format!("{frames}/000001.png")).unwrap().modified().unwrap();
    assert_eq!(first, again);

    // Threads and memory change no frame.
    let resume = [&resume[..], &["--threads", "1", "--memory-limit", "4G"]].concat();
    let message = stderr(&command(&resume).output().unwrap());
    assert!(message.contains("of 40 frames already done"), "{message}");
    assert!(fs::read(&part).unwrap() == fs::read(&whole).unwrap());
    assert_eq!(folder.names(), ["dome.ply", "part.gif", "whole.gif"]);
}

#[test]
fn a_movie_with_changed_materials_is_not_resumed() {
    let folder = Folder::new();
    let grid = (0..400).map(|i| format!("v {} {} {}\n", i % 20, i / 20, (i * i) % 5));
    let faces = (1..379).map(|i| format!("f {i} {} {}\n", i + 1, i + 20));
    let mesh: String = grid.chain(["usemtl m\n".to_owned()]).chain(faces).collect();
    let mesh = folder.write("mesh.obj", format!("mtllib m.mtl\n{mesh}"));
    folder.write("m.mtl", "newmtl m\nKd 1 0 0\n");
    let part = folder.path("part.gif");
    let endless = ["animate", &mesh, "-o", &part, "--turntable", "9000"];
    let arguments = [&endless, &SLOW_MOVIE[2..]].concat();
    interrupt(&arguments, &folder.path("part.gif.frames"), "000002.png");
    folder.write("m.mtl", "newmtl m\nKd 0 0.5 0\n");
    let message = fail(&[&arguments[..], &["--resume"]].concat(), 1);
    assert!(message.contains("request the same"), "{message}");
}

#[test]
fn numbered_pictures_can_be_resumed() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(40));
    let part = folder.path("f##.png");
    let arguments = [&["animate", &cloud, "-o", &part], &SLOW_MOVIE[..]].concat();
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
fn resume_without_frames_starts_a_new_movie() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let path = folder.path("movie.gif");
    movie(&[&cloud, "-o", &path, "--turntable", "1", "--fps", "3", "--resume"]);
    assert_eq!(read_gif(&path).0, 3);
}

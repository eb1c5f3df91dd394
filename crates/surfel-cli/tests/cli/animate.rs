//! Movies: their frames, and the animations in them.

use super::common::{
    Folder, SMALL, command, dome, fail, gltf, read_png, square, stderr, succeed, surfel, tile,
};
use crate::skipped::report_skipped;
use std::fs;
use std::process::Command;

pub fn movie(arguments: &[&str]) {
    succeed(&[&["animate"], arguments, &SMALL].concat());
}

/// Returns the frames of an animated PNG, and the duration of each in seconds.
pub fn read_apng(path: &str) -> (Vec<Vec<u8>>, Vec<f64>) {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let n_frames = reader.info().animation_control().unwrap().num_frames;
    let mut samples = vec![0; reader.output_buffer_size().unwrap()];
    (0..n_frames)
        .map(|_| {
            let info = reader.next_frame(&mut samples).unwrap();
            let control = reader.info().frame_control().unwrap();
            let secs = f64::from(control.delay_num) / f64::from(control.delay_den);
            (samples[..info.buffer_size()].to_vec(), secs)
        })
        .unzip()
}

/// Returns the number of frames of a GIF, and their duration in hundredths of a second.
pub fn read_gif(path: &str) -> (usize, u32) {
    let mut reader = gif::DecodeOptions::new().read_info(fs::File::open(path).unwrap()).unwrap();
    let (mut n_frames, mut hundredths) = (0, 0);
    while let Some(frame) = reader.read_next_frame().unwrap() {
        n_frames += 1;
        hundredths += u32::from(frame.delay);
    }
    (n_frames, hundredths)
}

/// Returns the mean difference of two pictures' samples, from 0 to 255.
pub fn difference(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum: u64 = a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.len() as f64
}

#[test]
fn a_turntable_writes_every_kind_of_movie() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let turn = ["--turntable", "2", "--fps", "4"];
    let make = |name: &str| {
        let movie_path = folder.path(name);
        movie(&[&[&cloud, "-o", &movie_path], &turn[..]].concat());
        movie_path
    };
    let (frames, secs) = read_apng(&make("turn.png"));
    assert_eq!((frames.len(), secs), (8, vec![0.25; 8]));
    assert!(1.0 < difference(&frames[0], &frames[4]));
    assert_eq!(read_gif(&make("turn.gif")), (8, 200));
    make("frame_##.png");
    let pictures: Vec<String> = (1..=8).map(|i| format!("frame_{i:02}.png")).collect();
    let mut expected = vec!["dome.ply".to_owned(), "turn.gif".into(), "turn.png".into()];
    expected.extend(pictures.iter().cloned());
    expected.sort();
    assert_eq!(folder.names(), expected);
    for (picture, frame) in pictures.iter().zip(&frames) {
        assert!(&read_png(folder.path(picture)).3 == frame, "{picture}");
    }
    make("f#.exr");
    assert!(folder.names().contains(&"f8.exr".to_owned()));
}

#[test]
fn a_finished_movie_is_named_with_its_length_and_size() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let output = folder.path("still.gif");
    let arguments = ["animate", &cloud, "-o", &output, "--frames", "1", "--resolution", "32x24"];
    let text = stderr(&surfel(&arguments));
    assert!(text.ends_with(&format!("{output}: 1 frame of 32x24 pixels\n")), "{text}");
}

#[test]
fn a_whole_turn_ends_where_it_began() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let path = folder.path("turn.png");
    movie(&[&cloud, "-o", &path, "--turntable", "1", "--fps", "8", "--frames", "9"]);
    let (frames, _) = read_apng(&path);
    // Rounding moves a few samples over a pixel's edge.
    assert!(difference(&frames[0], &frames[8]) < 0.5, "{}", difference(&frames[0], &frames[8]));
    assert!(1.0 < difference(&frames[0], &frames[2]));
}

#[test]
fn video_is_written_if_ffmpeg_is_installed() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let video = folder.path("turn.mp4");
    let arguments = ["animate", &cloud, "-o", &video, "--turntable", "1", "--fps", "5"];
    let has_ffmpeg = Command::new("ffmpeg").arg("-version").output().is_ok();
    if has_ffmpeg {
        succeed(&[&arguments[..], &SMALL].concat());
        let bytes = fs::read(&video).unwrap();
        assert_eq!(&bytes[4..8], b"ftyp");
    } else {
        report_skipped("ffmpeg is absent");
    }
    // Without ffmpeg the error comes before the work and names other formats.
    let nowhere = folder.path("");
    let output = command(&[&arguments[..], &SMALL].concat()).env("PATH", nowhere).output().unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("ffmpeg") && message.contains(".gif"), "{message}");
}

#[test]
fn a_movie_lasts_as_long_as_its_animation() {
    let folder = Folder::new();
    folder.write("dome.ply", dome(10));
    let object = "[[object]]\nname = \"dome\"\nfile = \"dome.ply\"\n";
    let n_frames = |movement: &str, options: &[&str]| {
        let scene = folder.write("scene.toml", format!("{object}{movement}"));
        let path = folder.path("movie.png");
        movie(&[&[scene.as_str(), "-o", &path, "--fps", "4"], options].concat());
        read_apng(&path).0.len()
    };
    let keys = "[[animation]]\nobject = \"dome\"\ntimes = [0, 1.5]\nscale = [1, 2]\n";
    assert_eq!(n_frames(keys, &[]), 6);
    assert_eq!(n_frames(keys, &["--frames", "3"]), 3);
    assert_eq!(n_frames(keys, &["--turntable", "2"]), 8);
    let orbit = "[[animation]]\nobject = \"camera\"\nkind = \"orbit\"\nseconds = 2.5\n";
    assert_eq!(n_frames(&format!("{keys}{orbit}"), &[]), 10);
    let path = "[[animation]]\nobject = \"dome\"\nkind = \"path\"\nseconds = 1\n\
        points = [[0, 0, 0], [1, 0, 0]]\n";
    assert_eq!(n_frames(path, &[]), 4);
    assert_eq!(n_frames("", &["--frames", "2"]), 2, "a still movie");
}

/// Renders a scene at several times, from above, with a fixed camera.
fn at_times(folder: &Folder, text: &str, times: &[&str]) -> Vec<Vec<u8>> {
    let scene = folder.write("scene.toml", text);
    let picture = |time: &&str| {
        let path = folder.path("at.png");
        let view = ["--camera-direction", "0,0,-1", "--camera-orthographic=12", "--light"];
        let view = [&view[..], &["none", "--camera-focal-point", "0,0,0", "--up", "+Z"]].concat();
        succeed(&[&["render", &scene, "-o", &path, "--time", time], &view[..], &SMALL].concat());
        read_png(path).3
    };
    times.iter().map(picture).collect()
}

fn tile_at(place: [f64; 2], more: &str) -> String {
    let [x, y] = place;
    format!("[[object]]\nname = \"t\"\nfile = \"tile.ply\"\ntranslate = [{x}, {y}, 0]\n{more}\n")
}

#[test]
fn orbits_keys_and_paths_move_objects_to_the_expected_positions() {
    let folder = Folder::new();
    folder.write("tile.ply", tile(1.0, 0.0, [250, 10, 10]));
    let still = |x, y| at_times(&folder, &tile_at([x, y], ""), &["0"]).remove(0);
    let cases = [
        (
            "times = [0, 2]\ntranslate = [[-3, 0, 0], [3, 2, 0]]",
            ["0", "1", "2", "9"],
            [[-3.0, 0.0], [0.0, 1.0], [3.0, 2.0], [3.0, 2.0]],
        ),
        (
            "times = [0, 2, 4]\ntranslate = [[-3, 0, 0], [3, 2, 0], [0, 0, 0]]\n\
             interpolation = \"step\"",
            ["0", "1.9", "2", "4"],
            [[-3.0, 0.0], [-3.0, 0.0], [3.0, 2.0], [0.0, 0.0]],
        ),
        (
            "kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 4\naxis = [0, 0, 1]",
            ["0", "1", "2", "4"],
            [[3.0, 0.0], [0.0, 3.0], [-3.0, 0.0], [3.0, 0.0]],
        ),
        (
            "kind = \"path\"\nseconds = 2\npoints = [[0, 0, 0], [0, 2, 0], [4, 2, 0]]",
            ["0", "0.6666666666666", "2", "3"],
            [[0.0, 0.0], [0.0, 2.0], [4.0, 2.0], [4.0, 2.0]],
        ),
    ];
    for (movement, times, places) in cases {
        let text = tile_at([3.0, 0.0], &format!("[[animation]]\nobject = \"t\"\n{movement}"));
        let shown = at_times(&folder, &text, &times);
        for ((time, place), frame) in times.iter().zip(places).zip(&shown) {
            let found = difference(frame, &still(place[0], place[1]));
            assert!(found < 1.0, "{movement} at {time}: {found}");
        }
        assert!(3.0 < difference(&shown[0], &shown[1]) || movement.contains("step"));
    }
}

#[test]
fn an_orbit_is_applied_after_keys() {
    let folder = Folder::new();
    folder.write("tile.ply", tile(1.0, 0.0, [250, 10, 10]));
    let still = |x, y| at_times(&folder, &tile_at([x, y], ""), &["0"]).remove(0);
    let movement = "[[animation]]\nobject = \"t\"\nkind = \"orbit\"\ncenter = [1, 0, 0]\n\
        seconds = 4\n[[animation]]\nobject = \"t\"\ntimes = [0, 2]\n\
        translate = [[3, 0, 0], [5, 0, 0]]";
    let shown = at_times(&folder, &tile_at([3.0, 0.0], movement), &["0", "1", "2"]);
    // The position of the keys, turned about the center: by a quarter, then by half.
    for (frame, (x, y)) in shown.iter().zip([(3.0, 0.0), (1.0, 3.0), (-3.0, 0.0)]) {
        assert!(difference(frame, &still(x, y)) < 1.0, "{x}, {y}");
    }
}

#[test]
fn the_camera_and_lamps_can_be_animated() {
    let folder = Folder::new();
    folder.write("dome.ply", dome(20));
    let object = "light = [\"sun\"]\n[[object]]\nfile = \"dome.ply\"\n";
    let frames = |movement: &str| {
        let scene = folder.write("scene.toml", format!("{object}{movement}"));
        let path = folder.path("movie.png");
        movie(&[&scene, "-o", &path, "--fps", "4", "--frames", "5"]);
        read_apng(&path).0
    };
    for movement in [
        "[[animation]]\nobject = \"camera\"\nkind = \"orbit\"\nseconds = 1",
        "[[lamp]]\nname = \"l\"\nposition = [2, 0, 1]\nstrength = 20\n\
         [[animation]]\nobject = \"l\"\nkind = \"orbit\"\ncenter = [0, 0, 1]\nseconds = 1",
        "[[animation]]\nobject = \"camera\"\ntimes = [0, 0.5, 1]\n\
         position = [[3, 3, 3], [3, -3, 3], [3, 3, 3]]",
    ] {
        let frames = frames(movement);
        assert!(1.0 < difference(&frames[0], &frames[2]), "{movement}");
        assert!(difference(&frames[0], &frames[4]) < 0.5, "{movement}");
    }
}

#[test]
fn a_frame_equals_the_picture_at_its_time() {
    let folder = Folder::new();
    folder.write("dome.ply", dome(20));
    let scene = "light = [\"sun\"]\nexposure = 0.5\nup = \"+Z\"\nsun.azimuth = 40\n\
        camera.position = [2, -3, 3]\ncamera.focal-point = [0, 0, 0]\n\
        [[object]]\nfile = \"dome.ply\"\n\
        [[lamp]]\nname = \"l\"\nposition = [2, 0, 1]\nstrength = 3\n\
        [[lamp]]\nkind = \"directional\"\nstrength = 0.2\n\
        [[animation]]\nobject = \"l\"\nkind = \"orbit\"\ncenter = [0, 0, 1]\nseconds = 2\n\
        [[animation]]\nobject = \"dome\"\ntimes = [0, 1]\ntranslate = [[0, 0, 0], [0.5, 0, 0]]\n";
    let scene = folder.write("scene.toml", scene);
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    let (frames, _) = read_apng(&path);
    assert_eq!(frames.len(), 4);
    for (time, frame) in ["0", "0.5", "1", "1.5"].iter().zip(&frames) {
        let picture = folder.path("at.png");
        succeed(&[&["render", &scene, "-o", &picture, "--time", time], &SMALL[..]].concat());
        assert!(&read_png(&picture).3 == frame, "{time}");
    }
}

#[test]
fn a_picture_at_a_time_has_the_automatic_settings_of_the_movie() {
    let folder = Folder::new();
    folder.write("dome.ply", dome(20));
    // The object moves away and shrinks; camera, sun and exposure stay those of second 0.
    let scene = "[[object]]\nfile = \"dome.ply\"\n[[animation]]\nobject = \"dome\"\ntimes = [0, 1]\n\
        translate = [[0, 0, 0], [0.5, 2, 1]]\nscale = [1, 0.2]\n\
        [[animation]]\nobject = \"camera\"\nkind = \"orbit\"\nseconds = 3\n";
    let scene = folder.write("scene.toml", scene);
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2", "--frames", "3"]);
    let (frames, _) = read_apng(&path);
    for (time, frame) in ["0", "0.5", "1"].iter().zip(&frames) {
        let picture = folder.path("at.png");
        succeed(&[&["render", &scene, "-o", &picture, "--time", time], &SMALL[..]].concat());
        assert!(&read_png(&picture).3 == frame, "{time}");
    }
}

#[test]
fn the_animation_of_a_gltf_file_plays() {
    let folder = Folder::new();
    let scene = folder.write("triangle.gltf", gltf());
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    let (frames, _) = read_apng(&path);
    assert_eq!(frames.len(), 4, "two seconds");
    assert!(1.0 < difference(&frames[0], &frames[3]));
    // A scene file that adds nothing gives the same movie.
    let scene = folder.write("scene.toml", "[[object]]\nfile = \"triangle.gltf\"\n");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    assert!(read_apng(&path).0 == frames);
}

#[test]
fn animation_name_selects_an_animation_of_a_gltf_file() {
    let folder = Folder::new();
    let rest = r#"{"name":"rest","samplers":[],"channels":[]}"#;
    let text =
        gltf().replace(r#""animations":[{"#, &format!(r#""animations":[{rest},{{"name":"walk","#));
    let file = folder.write("walker.gltf", text);
    let at_end =
        |options: &[&str]| read_shot(&folder, &[&[&file, "--time", "2"], options].concat());
    let rest = at_end(&[]);
    assert!(rest == at_end(&["--animation-name", "rest"]));
    assert!(rest != at_end(&["--animation-name", "walk"]));
    let message = fail(&["render", &file, "-o", "no.png", "--animation-name", "fly"], 1);
    assert!(message.contains("`rest`, `walk`"), "{message}");
    // Two objects of one file play different animations.
    let object = |name: &str| {
        format!(
            "[[object]]\nname = \"{name}\"\nfile = \"walker.gltf\"\nanimation-name = \"{name}\"\n"
        )
    };
    let scene = folder.write("scene.toml", object("rest") + &object("walk"));
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    let (frames, _) = read_apng(&path);
    assert!(frames.len() == 4 && frames[0] != frames[3]);
}

#[test]
fn a_sequence_shows_one_file_after_the_other() {
    let folder = Folder::new();
    for (number, color) in [(1, [250, 0, 0]), (2, [0, 250, 0]), (10, [0, 0, 250])] {
        folder.write(&format!("f{number}.ply"), tile(4.0, 0.0, color));
    }
    let scene = "light = \"none\"\n[camera]\ndirection = [0, 0, -1]\northographic = 2\n\
        [[object]]\nfiles = \"f*.ply\"\nfps = 2\n";
    let scene = folder.write("scene.toml", scene);
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "4"]);
    let (frames, _) = read_apng(&path);
    let colors: Vec<[u8; 3]> = frames.iter().map(|frame| frame[..3].try_into().unwrap()).collect();
    let [r, g, b] = [[250, 0, 0], [0, 250, 0], [0, 0, 250]];
    assert_eq!(colors, [r, r, g, g, b, b]);
}

#[test]
fn a_sequence_of_clouds_is_streamed() {
    let folder = Folder::new();
    let n_files = 24;
    for number in 0..n_files {
        folder.write(&format!("f{number}.xyz"), square(9, 10 * number as u8));
    }
    let view = "light = \"none\"\nradius = 1\n[camera]\ndirection = [0, 0, -1]\northographic = 4\n";
    let sequence = "[[object]]\nfiles = \"f*.xyz\"\nfps = 4\n";
    let scene = folder.write("scene.toml", format!("{view}{sequence}"));
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "4"]);
    let (frames, _) = read_apng(&path);
    assert_eq!(frames.len(), n_files);
    // Each frame, and each picture at a time, equals a picture of its file alone.
    for (number, time) in [(0, "0"), (7, "1.75"), (23, "5.75"), (23, "99")] {
        let single = format!("{view}[[object]]\nfile = \"f{number}.xyz\"\n");
        let single = read_shot(&folder, &[&folder.write("alone.toml", single)]);
        assert!(frames[number] == single, "{number}");
        assert!(read_shot(&folder, &[&scene, "--time", time]) == single, "{time}");
    }
    // One cloud is in memory, whatever the number of files.
    let dry_run = succeed(&["animate", &scene, "--dry-run"]);
    assert!(dry_run.contains("\"points\": 81,"), "{dry_run}");
    // The error for a missing file comes before the first frame.
    let files: Vec<String> = (0..9).map(|number| format!("\"f{number}.xyz\"")).collect();
    let missing =
        format!("{view}[[object]]\nfiles = [{}, \"gone.xyz\"]\nfps = 4\n", files.join(","));
    fs::remove_file(&path).unwrap();
    let text = fail(&["animate", &folder.write("missing.toml", missing), "-o", &path], 1);
    assert!(text.contains("gone.xyz") && !text.contains("frames are kept"), "{text}");
}

pub fn read_shot(folder: &Folder, arguments: &[&str]) -> Vec<u8> {
    let path = folder.path("shot.png");
    succeed(&[&["render"], arguments, &SMALL, &["-o", &path]].concat());
    read_png(path).3
}

#[test]
fn invalid_movies_are_rejected_before_the_work() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let gif = folder.path("movie.gif");
    let message = fail(&["animate", &cloud, "-o", &gif], 2);
    assert!(message.contains("nothing moves") && message.contains("--turntable"), "{message}");
    let message = fail(&["animate", &cloud, "--turntable", "1"], 2);
    assert!(message.contains("-o"), "{message}");
    for name in ["movie.doc", "movie", "movie.jpg"] {
        let message = fail(&["animate", &cloud, "-o", &folder.path(name), "--turntable", "1"], 2);
        assert!(message.contains(name) && message.contains(".gif"), "{message}");
    }
    let nowhere = folder.path("no/such/movie.gif");
    let message = fail(&["animate", &cloud, "-o", &nowhere, "--turntable", "1"], 1);
    assert!(message.contains("movie.gif"), "{message}");
    for options in [
        &["--turntable", "0"][..],
        &["--turntable", "NaN"],
        &["--turntable", "1", "--fps", "0"],
        &["--turntable", "1", "--fps", "1000"],
        &["--turntable", "1", "--fps", "60"],
        &["--frames", "0"],
    ] {
        fail(&[&["animate", &cloud, "-o", &gif], options].concat(), 2);
    }
    assert_eq!(folder.names(), ["dome.ply"]);
}

#[test]
fn the_dry_run_of_a_movie_renders_the_same_movie() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let path = folder.path("movie.png");
    let arguments = [&cloud, "-o", &path, "--turntable", "1.5", "--fps", "3", "--color", "rain"];
    let arguments = [&["animate"], &arguments[..], &SMALL].concat();
    let dry_run = succeed(&[&arguments[..], &["--dry-run"]].concat());
    assert_eq!(folder.names(), ["dome.ply"]);
    assert!(succeed(&["animate", &cloud, "--frames", "3", "--dry-run"]).contains("\"frames\": 3"));
    succeed(&arguments);
    let expected = fs::read(&path).unwrap();
    fs::remove_file(&path).unwrap();
    let dry_run = folder.write("dry_run.json", dry_run);
    succeed(&["animate", &dry_run]);
    assert!(fs::read(&path).unwrap() == expected);
    // `surfel render` of the same file gives the first frame.
    let picture = folder.path("first.png");
    succeed(&["render", &dry_run, "-o", &picture]);
    assert!(read_png(&picture).3 == read_apng(&path).0[0]);
}

#[test]
fn a_cluster_needs_the_python_package() {
    let folder = Folder::new();
    let (cloud, movie) = (folder.write("dome.ply", dome(20)), folder.path("turn.gif"));
    let words = ["animate", &cloud, "-o", &movie, "--turntable", "2", "--cluster", "tcp://x:1"];
    let ended = command(&words).env("SURFEL_PYTHON", "no-such-python").output().unwrap();
    let text = stderr(&ended);
    assert_eq!(ended.status.code(), Some(1), "{text}");
    assert!(
        text.contains("error: ") && text.contains("pip install './crates/surfel-python[dask]'"),
        "{text}"
    );
    assert_eq!(folder.names(), ["dome.ply"]);
}

#[test]
fn keys_and_orbits_change_the_size_visibility_and_side_of_objects() {
    let folder = Folder::new();
    folder.write("tile.ply", tile(1.0, 0.0, [250, 10, 10]));
    folder.write("ground.ply", tile(9.0, -9.0, [10, 10, 250]));
    let ground = "[[object]]\nfile = \"ground.ply\"\n";
    let at = |text: &str, times: &[&str]| {
        at_times(&folder, &(tile_at([3.0, 2.0], text) + ground), times)
    };
    let still = |keys: &str| at(keys, &["0"]).remove(0);
    let moved =
        |[x, y]: [f64; 2]| at_times(&folder, &(tile_at([x, y], "") + ground), &["0"]).remove(0);
    for (movement, time, expected) in [
        ("times = [0, 2]\nscale = [1, [2, 0.5, 1]]", "2", still("scale = [2, 0.5, 1]")),
        ("times = [0, 2]\nscale = [1, 2]", "1", still("scale = 1.5")),
        ("times = [0, 2]\nvisible = [true, false]", "1.9", still("")),
        ("times = [0, 2]\nvisible = [true, false]", "2", still("visible = false")),
        ("times = [0, 2]\nvisible = [false, true]", "1", still("visible = false")),
        ("kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 2", "1", moved([-3.0, -2.0])),
        // A quarter of a turn clockwise, half a turn in the time of a whole one, and half a turn about x and y.
        (
            "kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 2\nturns = -0.5",
            "1",
            moved([2.0, -3.0]),
        ),
        (
            "kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 2\nturns = 1.5",
            "2",
            moved([-3.0, -2.0]),
        ),
        (
            "kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 2\naxis = [1, 0, 0]",
            "1",
            moved([3.0, -2.0]),
        ),
        (
            "kind = \"orbit\"\ncenter = [0, 0, 0]\nseconds = 2\naxis = [0, 2, 0]",
            "1",
            moved([-3.0, 2.0]),
        ),
    ] {
        let shown = at(&format!("[[animation]]\nobject = \"t\"\n{movement}\n"), &["0", time]);
        let found = difference(&shown[1], &expected);
        assert!(found < 1.0, "{movement} at {time}: {found}");
        let is_changed = 2.0 < difference(&shown[1], &still("")) || time == "1.9";
        assert!(is_changed, "{movement} at {time} changes nothing");
    }
}

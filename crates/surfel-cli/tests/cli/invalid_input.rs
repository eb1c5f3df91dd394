//! Broken, missing and mislabelled files: the error names the file, and an old output stays.

use super::common::{Folder, dome, fail, gltf, read_png, square, stderr, succeed, surfel};
use std::fs;

/// The header of a LAS 1.2 file that claims four billion points in 200 bytes.
fn lying_las() -> Vec<u8> {
    let mut bytes = vec![0; 227];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, 2]);
    bytes[94..96].copy_from_slice(&227u16.to_le_bytes());
    bytes[96..100].copy_from_slice(&227u32.to_le_bytes());
    bytes[105..107].copy_from_slice(&20u16.to_le_bytes());
    bytes[107..111].copy_from_slice(&4_000_000_000u32.to_le_bytes());
    bytes
}

fn broken_files() -> Vec<(&'static str, Vec<u8>)> {
    let header = |count: u64| {
        let properties = "property float x\nproperty float y\nproperty float z\nend_header\n";
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}")
    };
    let mut truncated = dome(20).into_bytes();
    truncated.truncate(3000);
    vec![
        ("empty.ply", vec![]),
        ("empty.las", vec![]),
        ("empty.xyz", vec![]),
        ("no-points.ply", header(0).into_bytes()),
        ("billions.ply", header(3_000_000_000).into_bytes()),
        ("billions.las", lying_las()),
        ("truncated.ply", truncated),
        ("magic.ply", b"plush toys, a list\n".to_vec()),
        ("magic.las", b"FSAL and then nothing that is known".to_vec()),
        ("magic.laz", vec![0xff; 500]),
        ("nan.xyz", b"NaN NaN NaN\nNaN NaN NaN\n".to_vec()),
        ("words.xyz", b"here are no numbers\n".to_vec()),
        ("cloud.docx", b"PK\x03\x04 something else".to_vec()),
    ]
}

#[test]
fn a_broken_file_is_named_and_nothing_is_written() {
    let folder = Folder::new();
    let picture = folder.write("old.png", "an old picture");
    let cloud = folder.write("old.ply", "an old cloud");
    for (name, content) in broken_files() {
        let file = folder.write(name, content);
        for arguments in [
            &["render", &file, "-o", &picture, "--resolution", "32x18"][..],
            &["prepare", &file, "-o", &cloud],
            &["bench", &file, "--runs", "1"],
        ] {
            let text = fail(arguments, 1);
            assert!(text.contains(name), "{arguments:?}: {text}");
        }
        fs::remove_file(file).unwrap();
    }
    assert_eq!(fs::read_to_string(picture).unwrap(), "an old picture");
    assert_eq!(fs::read_to_string(cloud).unwrap(), "an old cloud");
    assert_eq!(folder.names(), ["old.ply", "old.png"]);
}

#[test]
fn errors_name_missing_paths_and_folders() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    let (absent, nowhere) = (folder.path("absent.laz"), folder.path("no/such/out.png"));
    let picture = folder.path("out.png");
    let folder_path = folder.0.display().to_string();
    let empty = folder.path("empty");
    fs::create_dir(&empty).unwrap();
    assert!(fail(&["render", &absent, "-o", &picture], 1).contains("absent.laz"));
    assert!(fail(&["render", &empty, "-o", &picture], 1).contains("empty: holds no"));
    assert!(fail(&["info", &absent], 1).contains("absent.laz"));
    let text = fail(&["render", &cloud, "-o", &nowhere], 1);
    assert!(text.contains("out.png") && text.contains("create it first"), "{text}");
    if cfg!(target_os = "linux") {
        let text = fail(&["render", &cloud, "-o", "/proc/out.png"], 1);
        assert!(text.contains("/proc/out.png") && !text.contains("create it first"), "{text}");
        // The error comes before the work.
        assert!(!text.contains("normals"), "{text}");
    }
    let like_a_folder = format!("{picture}/");
    let text = fail(&["render", &cloud, "-o", &like_a_folder], 1);
    assert!(text.contains("name a file, not a folder") && !text.contains("normals"), "{text}");
    assert!(fail(&["render", &cloud, "-o", &folder_path], 2).contains(&folder_path));
    assert!(fail(&["render", &cloud, "-o", &folder.path("out.gif")], 2).contains("gif"));
    assert!(fail(&["prepare", &cloud, "-o", &picture], 2).contains("out.png"));
    assert_eq!(folder.names(), ["dome.ply", "empty"]);
}

#[test]
fn the_error_for_a_missing_column_lists_those_of_the_file() {
    let folder = Folder::new();
    let dome = folder.write("dome.ply", dome(10));
    let picture = folder.path("out.png");
    for cloud in [dome.clone(), folder.path("dome.las")] {
        if cloud != dome {
            succeed(&["prepare", &dome, "-o", &cloud, "--subsample", "first:90"]);
        }
        for color in ["intensity", "hail"] {
            let arguments = ["render", &cloud, "-o", &picture, "--color", color];
            let text = fail(&arguments, 1);
            assert!(text.contains(&format!("no column {color}; ")), "{text}");
            for known in [" rgb", " class", " rain", " elevation"] {
                assert!(text.contains(known), "{known}: {text}");
            }
            // The error comes before the work.
            assert!(!text.contains("normals of"), "{text}");
        }
    }
}

#[test]
fn classes_that_are_all_zero_are_reported_where_they_are_asked_for() {
    let folder = Folder::new();
    let cloud = folder.write("grey.xyz", square(10, 200));
    let las = folder.path("grey.las");
    succeed(&["prepare", &cloud, "-o", &las, "--duplicates", "keep"]);
    let picture = folder.path("out.png");
    let render = ["render", &las, "-o", &picture, "--resolution", "32x24"];
    let text = stderr(&surfel(&render));
    assert!(!text.contains("classes"), "{text}");
    let text = fail(&[&render[..], &["--color", "class"]].concat(), 1);
    assert!(text.contains("grey.las: all classes are zero"), "{text}");
    assert!(stderr(&surfel(&["info", &las])).contains("all classes are zero"));
}

#[test]
fn a_filter_of_an_unknown_column_is_answered_with_the_nearest() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(10));
    for command in ["render", "prepare"] {
        let output = folder.path(if command == "render" { "a.png" } else { "a.ply" });
        let text = fail(&[command, &cloud, "-o", &output, "--filter", "clasification > 3"], 1);
        let advice = "; the nearest known one is `classification`";
        assert!(text.contains("unknown column of the filter") && text.contains(advice), "{text}");
    }
}

#[test]
fn settings_for_points_warn_where_there_are_triangles_alone() {
    let folder = Folder::new();
    let mesh = folder.write("triangle.gltf", gltf());
    let picture = folder.path("out.png");
    let arguments = ["render", &mesh, "-o", &picture, "--resolution", "32x24"];
    let options = ["--color", "hail", "--class", "2"];
    let output = surfel(&[&arguments[..], &options].concat());
    let text = stderr(&output);
    assert!(
        text.contains("warning: settings for points") && text.contains("[--color, --class]"),
        "{text}"
    );
    assert!(!stderr(&surfel(&arguments)).contains("warning"));
    let cloud = folder.write("dome.ply", dome(10));
    let both = surfel(&[&arguments[..], &[&cloud, "--color", "elevation"]].concat());
    assert!(!stderr(&both).contains("settings for points"), "{}", stderr(&both));
}

#[test]
fn the_memory_limit_is_checked_before_the_work() {
    let folder = Folder::new();
    let cloud = folder.write("square.xyz", square(100, 9));
    let picture = folder.path("out.png");
    let arguments = ["render", &cloud, "-o", &picture, "--memory-limit", "1M"];
    let text = fail(&arguments, 1);
    assert!(text.contains("--resolution") && text.contains("1.0 MiB"), "{text}");
    // 10,000 points with an octree need another 4.6 MiB.
    let small = ["render", &cloud, "-o", &picture, "--resolution", "64x48", "--memory-limit", "3M"];
    succeed(&[&small[..], &["--dry-run"]].concat());
    let text = fail(&[&small[..], &["--surface", "octree"]].concat(), 1);
    assert!(text.contains("3.0 MiB") && text.contains("--subsample"), "{text}");
    let text = fail(&["prepare", &cloud, "-o", &folder.path("a.ply"), "--memory-limit", "9K"], 1);
    assert!(text.contains("--memory-limit"), "{text}");
    assert!(fail(&["info", &cloud, "--memory-limit", "9K"], 1).contains("--memory-limit"));
    succeed(&["info", &cloud, "--memory-limit", "1M"]);
}

#[test]
fn the_memory_limit_counts_the_points_that_a_filter_keeps() {
    let folder = Folder::new();
    let cloud = folder.write("square.xyz", square(100, 9));
    let (picture, prepared) = (folder.path("out.png"), folder.path("out.ply"));
    // Normals, radii and structures of 10,000 points take 1.7 MiB beside the points.
    let render =
        ["render", &cloud, "-o", &picture, "--resolution", "64x48", "--memory-limit", "1500K"];
    let prepare = ["prepare", &cloud, "-o", &prepared, "--normals", "--memory-limit", "1500K"];
    for arguments in [&render[..], &prepare[..]] {
        let text = fail(arguments, 1);
        assert!(text.contains("preparation") && text.contains("1.5 MiB"), "{text}");
        succeed(&[arguments, &["--crop", "([0,20],[0,20])"]].concat());
        let text = fail(&[arguments, &["--crop", "([0,90],[0,90])"]].concat(), 1);
        assert!(text.contains("8281 points need"), "{text}");
    }
}

/// Scanners and programs write their largest numbers where nothing was measured.
#[test]
fn points_without_a_measurement_do_not_change_the_picture() {
    let folder = Folder::new();
    let points = square(40, 9);
    let unmeasured = "3.4e38 3.4e38 3.4e38 0 0 0\n1e30 0 0 0 0 0\n0 0 -1e20 0 0 0\n";
    let (clean, picture) = (folder.write("clean.xyz", &points), folder.path("clean.png"));
    let (dirty, other) = (folder.write("dirty.xyz", points + unmeasured), folder.path("dirty.png"));
    let view = ["--camera-position", "-30,10,40", "--camera-focal-point", "20,20,0"];
    let options = [&view[..], &["--resolution", "64x48", "--spp", "1", "-o"]].concat();
    succeed(&[&["render", &clean], &options[..], &[&picture]].concat());
    let output = surfel(&[&["render", &dirty], &options[..], &[&other]].concat());
    let message = stderr(&output);
    assert!(
        output.status.success() && message.contains("3 points dropped: no position"),
        "{message}"
    );
    let ((.., expected), (.., found)) = (read_png(picture), read_png(other));
    let farthest = expected.iter().zip(&found).map(|(a, b)| a.abs_diff(*b)).max();
    // The clouds have different origins, and so different rounding.
    assert!(expected.len() == found.len() && farthest <= Some(1), "{farthest:?}");
    let nowhere = folder.write("nowhere.xyz", unmeasured);
    let text = fail(&["render", &nowhere, "-o", &folder.path("nowhere.png")], 1);
    assert!(text.contains("nowhere.xyz") && text.contains("no points"), "{text}");
}

/// These are too many to be removed as outliers.
#[test]
fn many_points_without_a_measurement_do_not_change_the_camera() {
    let folder = Folder::new();
    let points = (0..1600).map(|n| (n % 40, n / 40));
    let bowl: String = points.map(|(x, y)| format!("{x} {y} {}\n", x * x / 40)).collect();
    let picture = folder.path("out.png");
    let camera = |unmeasured: &str| {
        let many: String = (0..400).map(|i| format!("{} {unmeasured}\n", i % 40)).collect();
        let cloud = folder.write("cloud.xyz", format!("{bowl}{many}"));
        let output = surfel(&["render", &cloud, "-o", &picture, "--resolution", "32x24"]);
        let message = stderr(&output);
        let line = message.lines().find(|line| line.starts_with("camera at"));
        assert!(message.contains("400 points dropped: no position"), "{message}");
        line.unwrap().to_owned()
    };
    assert_eq!(camera("3.4e38 -1e30"), camera("NaN NaN"));
}

#[test]
fn the_memory_limit_counts_triangles_and_textures() {
    let folder = Folder::new();
    let corner = |i: usize| format!("v {} {} {}\nvt 0 0\n", i % 50, i / 50, i % 7);
    let corners: String = (0..2500).map(corner).collect();
    let faces: String = (1..2400).map(|i| format!("f {i}/1 {}/1 {}/1\n", i + 1, i + 51)).collect();
    let mesh = folder.write("mesh.obj", format!("{corners}{faces}"));
    let picture = folder.path("out.png");
    let render = |file: &str, limit: &str| {
        let options = ["-o", &picture, "--resolution", "32x24", "--memory-limit", limit];
        [&["render", file], &options[..]].concat().iter().map(|word| word.to_string()).collect()
    };
    let words: Vec<String> = render(&mesh, "450K");
    let text = fail(&words.iter().map(String::as_str).collect::<Vec<_>>(), 1);
    assert!(text.contains("2399 triangles need") && !text.contains("--subsample"), "{text}");
    let textured = format!("mtllib m.mtl\n{corners}usemtl m\n{faces}");
    folder.write("m.mtl", "newmtl m\nmap_Kd white.png\n");
    let mut white =
        png::Encoder::new(fs::File::create(folder.path("white.png")).unwrap(), 800, 800);
    white.set_color(png::ColorType::Grayscale);
    white.write_header().unwrap().write_image_data(&[255; 800 * 800]).unwrap();
    let words: Vec<String> = render(&folder.write("textured.obj", textured), "3M");
    let text = fail(&words.iter().map(String::as_str).collect::<Vec<_>>(), 1);
    assert!(text.contains("--memory-limit"), "{text}");
    fs::remove_file(folder.path("white.png")).unwrap();
    let words: Vec<String> = render(&folder.path("textured.obj"), "3M");
    succeed(&words.iter().map(String::as_str).collect::<Vec<_>>());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let arguments = ["render", &cloud, "-o", "-", "--resolution", "64x36"];
    let output = super::common::command(&arguments).stdout(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    fail(&["render", &cloud, "-o", "/dev/full"], 2);
    let arguments = ["info", &cloud];
    let output = super::common::command(&arguments).stdout(full()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_not_replaced_by_files() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    for (command, name) in [("prepare", "full.ply"), ("render", "full.png")] {
        let full = folder.path(name);
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let text = fail(&[command, &cloud, "-o", &full], 2);
        assert!(text.contains(name) && text.contains("device"), "{text}");
        assert_eq!(fs::read_link(&full).unwrap().to_str(), Some("/dev/full"));
    }
    assert_eq!(folder.names(), ["dome.ply", "full.ply", "full.png"]);
}

/// Limits the size of files to a kilobyte, so that writes fail as they do on a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_failed_write_keeps_the_old_output() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    for (command, name) in [("prepare", "old.ply"), ("prepare", "old.laz"), ("render", "old.png")] {
        let old = folder.write(name, "an old file");
        let limited = "trap '' XFSZ; ulimit -f 1; exec \"$@\"";
        let arguments = [env!("CARGO_BIN_EXE_surfel"), command, &cloud, "-o", &old];
        let size: &[&str] = if command == "render" { &["--resolution", "320x180"] } else { &[] };
        let shell = std::process::Command::new("bash")
            .args(["-c", limited, "bash"])
            .args(arguments)
            .args(size)
            .output()
            .unwrap();
        let text = stderr(&shell);
        assert_eq!(shell.status.code(), Some(1), "{text}");
        assert!(text.contains(&format!("error: {old}")), "{text}");
        assert_eq!(fs::read_to_string(&old).unwrap(), "an old file");
    }
    assert_eq!(folder.names(), ["dome.ply", "old.laz", "old.ply", "old.png"]);
}

#[test]
fn damaged_laz_is_an_error_without_a_panic_message() {
    let folder = Folder::new();
    let regressions =
        concat!(env!("CARGO_MANIFEST_DIR"), "/../surfel-formats/tests/fuzz_regressions");
    let message = fail(
        &["prepare", &format!("{regressions}/decoder_state.laz"), "-o", &folder.path("a.ply")],
        1,
    );
    assert!(message.contains("decoder_state.laz") && !message.contains("panicked"), "{message}");
}

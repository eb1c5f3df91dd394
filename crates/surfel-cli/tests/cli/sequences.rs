//! Sequences of meshes: each frame equals the picture of its file, whatever the parts of the files.

use super::animate::{movie, read_apng, read_shot};
use super::common::{Folder, SMALL, dome, fail, stderr, succeed, surfel, tile};
use std::fs;

/// Returns squares side by side as OBJ, each with its own material.
fn squares(materials: &[&str], height: f64) -> String {
    let mut text = "mtllib paint.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n".to_owned();
    for (i, material) in materials.iter().enumerate() {
        let (left, right) = (i as f64 - 1.0, i as f64 - 0.1);
        for (x, y) in [(left, -1.0), (right, -1.0), (right, 1.0), (left, 1.0)] {
            text += &format!("v {x} {y} {height}\n");
        }
        text += &format!("usemtl {material}\nf -4/1 -3/2 -2/3 -1/4\n");
    }
    text
}

/// Returns one triangle as STL.
fn stl() -> String {
    let corners = ["-1 -1 0.2", "1.5 -1 0.2", "0 1 0.9"].map(|c| format!("vertex {c}\n")).concat();
    format!("solid\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid\n")
}

/// Returns a PNG of two by two texels.
fn checkers() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[255, 255, 0, 0, 0, 99, 0, 255, 0, 255, 0, 255]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Files of a sequence: OBJ of one part, of three parts, STL, a cloud, and OBJ of two parts.
pub const FRAMES: [&str; 5] = ["f1.obj", "f2.obj", "f3.stl", "f4.ply", "f5.obj"];

pub fn site() -> Folder {
    let folder = Folder::new();
    folder.write("floor.ply", tile(9.0, -1.0, [200; 3]));
    folder.write(
        "paint.mtl",
        "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nnewmtl paper\nmap_Kd c.png\n",
    );
    folder.write("c.png", checkers());
    folder.write("f1.obj", squares(&["paper"], 0.0));
    folder.write("f2.obj", squares(&["red", "paper", "blue"], 0.3));
    folder.write("f3.stl", stl());
    folder.write("f4.ply", dome(12));
    folder.write("f5.obj", squares(&["blue", "red"], 0.1));
    folder
}

/// Returns a scene file. The floor is its first object, so that all scenes have one origin.
pub fn scene(light: &str, shown: &str) -> String {
    format!(
        "light = {light}\nsun.azimuth = 40\nexposure = 0.2\nup = \"+Z\"\n[camera]\n\
         position = [3, -6, 9]\nfocal-point = [1, 1, 0]\n\
         [[object]]\nfile = \"floor.ply\"\n\
         [[object]]\n{shown}\nclip-plane = [0.9, 0, 0, 1, 0, 0]\n\
         instances = [{{ translate = [3, 0, 0] }}, {{ rotate = [0, 30, 0], translate = [0, 0, 1] }}]\n\
         [[object]]\nname = \"twin\"\n{shown}\nclip-plane = [0.9, 0, 0, 1, 0, 0]\n\
         translate = [0, 3, 0]\nmaterial = {{ kind = \"plastic\", color = \"#20c080\" }}\n\
         [[object]]\nname = \"other\"\nfile = \"f4.ply\"\ntranslate = [3, 3, 0]\n"
    )
}

#[test]
fn each_frame_of_a_sequence_is_the_picture_of_its_file() {
    let folder = site();
    for light in ["\"none\"", "[\"sun\"]"] {
        let files = format!("files = {FRAMES:?}\nfps = 2\n");
        let sequence = folder.write("sequence.toml", scene(light, &files));
        let path = folder.path("movie.png");
        movie(&[&sequence, "-o", &path, "--fps", "2"]);
        let (frames, _) = read_apng(&path);
        assert_eq!(frames.len(), FRAMES.len());
        for (i, (frame, file)) in frames.iter().zip(FRAMES).enumerate() {
            let single = scene(light, &format!("file = \"{file}\"\n"));
            let single = read_shot(&folder, &[&folder.write("alone.toml", single)]);
            assert!(*frame == single, "{file} under {light}");
            let time = format!("{}", 0.5 * i as f64);
            assert!(
                read_shot(&folder, &[&sequence, "--time", &time]) == single,
                "{file} at {time}"
            );
            assert!(i == 0 || *frame != frames[i - 1], "{file}");
        }
    }
}

#[test]
fn emissive_materials_keep_their_brightness_through_a_sequence() {
    let folder = Folder::new();
    for name in ["a.ply", "b.ply"] {
        folder.write(name, tile(1.0, 0.0, [120; 3]));
    }
    let scene = "exposure = -1\nlight = \"sun\"\nup = \"+Z\"\n\
                 [[object]]\nfiles = [\"a.ply\", \"b.ply\"]\nfps = 2\n\
                 material = { emissive = \"#808080\" }\n";
    let scene = folder.write("scene.toml", scene);
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    let (frames, _) = read_apng(&path);
    assert!(frames.len() == 2 && frames[0] == frames[1]);
}

#[test]
fn one_range_of_values_colors_all_files_of_a_sequence() {
    let folder = Folder::new();
    // The second file is the first one, raised by 1.
    for (name, height) in [("a.xyz", 0.0), ("b.xyz", 1.0)] {
        let point =
            |n: usize| format!("{} {} {}\n", n % 20, n / 20, height + 0.1 * (n % 20) as f64);
        folder.write(name, (0..400).map(point).collect::<String>());
    }
    let scene = "light = \"none\"\ncolor = \"elevation\"\nlegend = true\nup = \"+Z\"\n\
                 [camera]\ndirection = [0, 0, -1]\northographic = 10\n\
                 [[object]]\nfiles = [\"a.xyz\", \"b.xyz\"]\nfps = 2\n";
    let scene = folder.write("scene.toml", scene);
    let path = folder.path("movie.png");
    movie(&[&scene, "-o", &path, "--fps", "2"]);
    let (frames, _) = read_apng(&path);
    assert!(frames.len() == 2 && frames[0] != frames[1]);
    let text = stderr(&surfel(&[&["render", &scene, "-o", &path], &SMALL[..]].concat()));
    assert!(text.contains("color elevation from 0.0"), "{text}");
}

#[test]
fn one_mesh_of_a_sequence_is_in_memory_at_a_time() {
    let folder = site();
    let scene = "[[object]]\nfiles = [\"f1.obj\", \"f2.obj\", \"f5.obj\"]\nfps = 1\n";
    let scene = folder.write("scene.toml", scene);
    let dry_run = succeed(&["animate", &scene, "--dry-run"]);
    assert!(dry_run.contains("\"triangles\": 2,"), "{dry_run}");
    // The memory limit counts the largest file; this header claims a million triangles.
    let many = tile(1.0, 0.0, [9; 3]).replace("element face 2", "element face 1000000");
    folder.write("many.ply", many);
    let files = |names: &str| {
        folder.write("limited.toml", format!("[[object]]\nfiles = [{names}]\nfps = 1\n"))
    };
    let limited = files("\"f1.obj\", \"many.ply\", \"many.ply\", \"f2.obj\"");
    let limit = ["--memory-limit", "50M", "-o", "no.png"];
    let message = fail(&[&["render", &limited][..], &limit, &SMALL].concat(), 1);
    assert!(message.contains("1000000 triangles"), "{message}");
}

#[test]
fn an_unreadable_mesh_of_a_sequence_is_named() {
    let folder = site();
    let path = folder.path("movie.png");
    let scene = |files: &str| folder.write("scene.toml", format!("[[object]]\nfiles = {files}\n"));
    let missing = scene("[\"f1.obj\", \"f2.obj\", \"gone.obj\"]");
    let message = fail(&["animate", &missing, "-o", &path], 1);
    assert!(message.contains("gone.obj") && !message.contains("frames are kept"), "{message}");
    // The header is valid: the error occurs when the frame is read.
    let broken = tile(1.0, 0.0, [9; 3]).replace("3 0 2 3", "3 0 2 x");
    folder.write("broken.ply", broken);
    let broken = scene("[\"f1.obj\", \"f2.obj\", \"broken.ply\"]");
    let message =
        fail(&[&["animate", &broken, "-o", &path, "--fps", "10"], &SMALL[..]].concat(), 1);
    assert!(
        message.contains("broken.ply") && message.contains("2 of 3 frames are kept"),
        "{message}"
    );
    // The repaired file is another input, so that --resume is rejected.
    folder.write("broken.ply", tile(1.0, 0.0, [9; 3]));
    let message = fail(&[&["animate", &broken, "-o", &path, "--resume"], &SMALL[..]].concat(), 1);
    assert!(message.contains("--resume"), "what frames depend on has changed: {message}");
    fs::remove_dir_all(folder.path("movie.png.frames")).unwrap();
    movie(&[&broken, "-o", &path, "--fps", "10"]);
    assert_eq!(read_apng(&path).0.len(), 3);
}

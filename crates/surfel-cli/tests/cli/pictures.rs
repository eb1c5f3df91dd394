//! Pixels, layers and bytes of pictures.

use super::common::{Folder, SMALL, dome, read_png, shot, square, stderr, succeed, surfel};
use std::fs;

#[test]
fn an_unlit_grey_of_128_is_128_in_the_picture() {
    let folder = Folder::new();
    let cloud = folder.write("grey.xyz", square(30, 128));
    let picture = folder.path("grey.png");
    let view = ["--camera-position", "14.5,14.5,30", "--camera-focal-point", "14.5,14.5,0"];
    let options = ["--light", "none", "--resolution", "40x30", "--camera-view-angle", "20"];
    let arguments = ["render", &cloud, "-o", &picture];
    succeed(&[&arguments[..], &view, &options].concat());
    let (.., samples) = read_png(&picture);
    let other = samples.iter().find(|&&sample| sample != 128);
    assert_eq!(other, None);
}

#[test]
fn a_transparent_background_has_alpha_0_and_the_cloud_255() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let picture = folder.path("dome.png");
    let arguments = ["render", &cloud, "-o", &picture, "--resolution", "64x36"];
    for background in [&["--no-background"][..], &["--background", "transparent"]] {
        succeed(&[&arguments[..], background].concat());
        let (width, _, channels, samples) = read_png(&picture);
        assert_eq!(channels, 4);
        let alpha = |x: u32, y: u32| samples[(4 * (y * width + x) + 3) as usize];
        assert_eq!((alpha(0, 0), alpha(32, 18)), (0, 255));
    }
    succeed(&[&arguments[..], &["--background", "#102030"]].concat());
    let (_, _, channels, samples) = read_png(&picture);
    assert_eq!((channels, &samples[..3]), (3, &[16, 32, 48][..]));
}

#[test]
fn colours_may_be_css_names_and_height_is_elevation() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let picture = |options: &[&str]| shot(&folder, &[&[cloud.as_str()][..], options].concat());
    for (name, digits) in [("red", "#ff0000"), ("SteelBlue", "#4682b4"), ("#fa0", "#ffaa00")] {
        let constant = picture(&["--color", name]);
        assert!(constant == picture(&["--color", digits]), "{name}");
        let background = picture(&["--background", name]);
        assert!(background == picture(&["--background", digits]), "{name}");
        assert!(background != constant, "{name}");
    }
    assert!(picture(&["--background", "white,navy"]) == picture(&["--background", "#fff,#000080"]));
    let elevation = picture(&["--color", "elevation", "--cmap", "turbo"]);
    assert!(picture(&["--color", "height", "--cmap", "turbo"]) == elevation);
    assert!(picture(&["--color", "rain", "--cmap", "turbo"]) != elevation);
}

#[test]
fn pictures_are_independent_of_the_number_of_threads() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(60));
    let render = |threads: &str, extension: &str| {
        let picture = folder.path(&format!("{threads}.{extension}"));
        succeed(&["render", &cloud, "-o", &picture, "--resolution", "80x60", "-t", threads]);
        picture
    };
    for extension in ["png", "exr"] {
        let bytes = |threads| fs::read(render(threads, extension)).unwrap();
        assert!(bytes("1") == bytes("2"), "{extension}");
    }
}

#[test]
fn radius_scale_applies_to_fixed_and_estimated_radii() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let picture = |options: &[&str]| shot(&folder, &[&[cloud.as_str()][..], options].concat());
    let fixed = picture(&["--radius", "0.25"]);
    assert_eq!(picture(&["--radius", "0.125", "--radius-scale", "2"]), fixed);
    assert_eq!(picture(&["--radius-scale", "1"]), picture(&[]));
    assert_ne!(picture(&["--radius-scale", "2"]), picture(&[]));
    let output = folder.path("dome.png");
    let arguments = ["render", &cloud, "-o", &output, "--radius-scale", "2"];
    let text = stderr(&surfel(&[&arguments[..], &SMALL].concat()));
    let radii = text.lines().find(|line| line.starts_with("radii")).unwrap_or_default();
    assert!(radii.ends_with("; all multiplied by 2 [--radius, --radius-scale]"), "{text}");
}

#[test]
fn lengths_of_normals_in_a_file_may_be_radii() {
    let folder = Folder::new();
    let row = |i: usize| format!("{} {} 0 0 0 {:.1}\n", i % 30, i / 30, 1.5 + 0.1 * (i % 5) as f32);
    let text = (0..900).map(row).collect::<String>();
    let cloud = folder.write("lengths.xyz", "x y z nx ny nz\n".to_owned() + &text);
    let output = folder.path("lengths.png");
    let report = stderr(&surfel(&[&["render", &cloud, "-o", &output][..], &SMALL].concat()));
    assert!(report.contains("radii 1.50 to 1.90: the lengths of the file's normals"), "{report}");
}

#[test]
fn points_have_the_size_that_is_given_or_chosen() {
    let folder = Folder::new();
    let cloud = folder.write("two.xyz", "0 0 0 255 0 0\n10 0 0 0 255 0\n");
    let picture = folder.path("two.png");
    let camera = ["--camera-position", "5,-20,0", "--camera-focal-point", "5,0,0"];
    let points = ["--surface", "points", "--background", "white", "--resolution", "96x64"];
    let covered = |options: &[&str]| {
        let arguments = [&["render", &cloud, "-o", &picture][..], &points, &camera, options];
        let report = stderr(&surfel(&arguments.concat()));
        let (_, _, channels, samples) = read_png(&picture);
        let pixels = samples.chunks_exact(channels);
        let red = pixels.clone().filter(|pixel| pixel[..3] == [255, 0, 0]).count();
        let green = pixels.filter(|pixel| pixel[..3] == [0, 255, 0]).count();
        (red, green, report)
    };
    let (red, green, report) = covered(&["--point-size", "1"]);
    assert_eq!((red, green), (1, 1), "{report}");
    assert!(!report.contains("--point-size"), "{report}");
    // Round points of ten pixels cover about 79 pixels, and neither point shades the other.
    let (red, green, _) = covered(&["--point-size", "10"]);
    assert!((70..90).contains(&red) && (70..90).contains(&green), "{red} {green}");
    let (chosen, _, report) = covered(&[]);
    assert!(
        report.contains("point size 8 pixels") && report.contains("[--point-size]"),
        "{report}"
    );
    assert_eq!(chosen, covered(&["--point-size", "8"]).0);
    let (.., orthographic) = covered(&["--point-size", "4", "--camera-orthographic=20"]);
    assert!(!orthographic.contains("error"), "{orthographic}");
}

#[test]
fn point_size_is_a_key_of_scene_files_and_of_the_dry_run() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let scene = format!("surface = \"points\"\npoint-size = 5.5\n[[object]]\nfile = {cloud:?}\n");
    let scene = folder.write("scene.toml", scene);
    let typed = shot(&folder, &[&cloud, "--surface", "points", "--point-size", "5.5"]);
    assert!(shot(&folder, &[&scene]) == typed);
    assert!(shot(&folder, &[&scene, "--point-size", "2"]) != typed);
    let dry = succeed(&["render", &cloud, "--surface", "points", "--dry-run"]);
    let dry: serde_json::Value = serde_json::from_str(&dry).unwrap();
    assert!(dry["point_size"].is_number(), "{dry}");
    // No other surface has a size in pixels.
    let dry = succeed(&["render", &cloud, "--dry-run"]);
    let dry: serde_json::Value = serde_json::from_str(&dry).unwrap();
    assert!(dry["point_size"].is_null(), "{dry}");
}

#[test]
fn another_seed_gives_other_noise() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let picture = |options: &[&str]| shot(&folder, &[&[cloud.as_str()][..], options].concat());
    let first = picture(&["--seed", "1"]);
    assert!(picture(&["--seed", "1"]) == first);
    assert!(picture(&["--seed", "2"]) != first);
    // Without samples that random numbers place there is no noise.
    let plain = ["--light", "none", "--surface", "points"];
    let without = |seed| picture(&[&plain[..], &["--seed", seed]].concat());
    assert!(without("1") == without("2"));
    let kept = |seed: &str| {
        let kept = folder.path("kept.xyz");
        succeed(&["prepare", &cloud, "-o", &kept, "--subsample", "random:50", "--seed", seed]);
        fs::read_to_string(kept).unwrap()
    };
    assert!(kept("1") == kept("1") && kept("1") != kept("2"));
}

#[test]
fn a_noise_threshold_saves_the_camera_rays_of_even_pixels() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let picture = folder.path("dome.png");
    let primary = |options: &[&str]| {
        let render = ["render", &cloud, "-o", &picture, "--resolution", "32x24", "--spp", "64"];
        let run = ["--light-samples", "1", "--backend", "cpu", "--stats", "-"];
        let stats = succeed(&[&render[..], &run, options].concat());
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        stats["rays"]["primary"].as_u64().unwrap()
    };
    let all = 32 * 24 * 64;
    assert_eq!(primary(&[]), all);
    assert_eq!(primary(&["--noise-threshold", "0"]), all);
    let (fine, coarse) =
        (primary(&["--noise-threshold", "0.01"]), primary(&["--noise-threshold", "0.5"]));
    assert!(coarse < fine && fine < all, "{coarse} {fine} {all}");
}

#[test]
fn an_exr_has_all_layers() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let picture = folder.path("dome.exr");
    succeed(&["render", &cloud, "-o", &picture, "--resolution", "32x18"]);
    let meta = exr::meta::MetaData::read_from_file(&picture, false).unwrap();
    let channels = &meta.headers[0].channels.list;
    let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
    for name in [
        "R",
        "A",
        "Z",
        "N.X",
        "P.Z",
        "id",
        "instance",
        "coverage",
        "support.count",
        "support.distance",
    ] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
}

#[test]
fn support_is_a_colour_source_with_a_map_and_a_range() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let picture = |options: &[&str]| shot(&folder, &[&[cloud.as_str()][..], options].concat());
    let support = picture(&["--color", "support"]);
    assert!(support != picture(&[]));
    assert!(support == picture(&["--color", "support", "--cmap", "viridis", "--range", "0,1"]));
    assert!(support != picture(&["--color", "support", "--cmap", "coolwarm"]));
    assert!(support != picture(&["--color", "support", "--range", "0,0.5"]));
    for surface in ["disc", "splat", "sphere", "points"] {
        let by_support = picture(&["--color", "support", "--surface", surface]);
        assert!(by_support != picture(&["--surface", surface]), "{surface}");
        let other_map = ["--color", "support", "--cmap", "coolwarm", "--surface", surface];
        assert!(by_support != picture(&other_map), "{surface}");
    }
    let file = folder.path("told.png");
    let render = ["render", &cloud, "-o", &file, "--color", "support"];
    let report = stderr(&surfel(&[&render[..], &SMALL].concat()));
    let expected = "color support from 0.000 to 1.000 (at a point to one radius away from all points), map \
                    viridis [--color, --cmap, --range, --gamma]";
    assert!(report.contains(expected), "{report}");
}

#[test]
fn one_point_and_a_line_are_in_the_picture() {
    let folder = Folder::new();
    let line: String = (0..50).map(|i| format!("{i} 0 0\n")).collect();
    let clouds = [("one.xyz", "1 2 3\n"), ("equal.xyz", &"1 2 3\n".repeat(9)), ("line.xyz", &line)];
    for (name, content) in clouds {
        let cloud = folder.write(name, content);
        let picture = folder.path(&format!("{name}.png"));
        let output = surfel(&["render", &cloud, "-o", &picture, "--resolution", "64x36"]);
        assert_eq!(read_png(&picture).0, 64, "{name}");
        let text = stderr(&output);
        assert!(!text.contains("of the picture is covered"), "{text}");
        let has_one = name != "line.xyz";
        for of_neighbours in ["th neighbour", "ambient occlusion by"] {
            assert_eq!(text.contains(of_neighbours), !has_one, "{of_neighbours}: {text}");
        }
        assert!(!text.contains("from planes through"), "{text}");
    }
}

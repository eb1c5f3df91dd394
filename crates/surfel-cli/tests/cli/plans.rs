//! Plans to scale: where a known point lands, and what other programs read of them.

use super::common::{Folder, fail, read_png, stderr, succeed, surfel};
use crate::skipped::report_skipped;
use std::fs;
use std::path::Path;
use std::process::Command;

/// World coordinates of the middle of the red square of [`floor`].
const MARKER: [f64; 2] = [691_607.13, 5_334_760.41];
/// Elevation of the floor.
const ELEVATION: f64 = 512.25;

/// A level floor of 6 m x 4 m about [`MARKER`], grey, with a red square of 1 m in its middle.
fn floor() -> String {
    let mut text = String::from("x,y,z,red,green,blue\n");
    for i in 0..=120 {
        for j in 0..=80 {
            let offset = [0.05 * f64::from(i) - 3.0, 0.05 * f64::from(j) - 2.0];
            let is_marked = offset.iter().all(|offset| offset.abs() < 0.51);
            let color = if is_marked { "255,0,0" } else { "128,128,128" };
            let [x, y] = [MARKER[0] + offset[0], MARKER[1] + offset[1]];
            text += &format!("{x:.3},{y:.3},{ELEVATION},{color}\n");
        }
    }
    text
}

/// Returns the middle of all red pixels of a picture, in pixels from its upper left corner.
fn middle_of_red((width, _, channels, samples): (u32, u32, usize, Vec<u8>)) -> [f64; 2] {
    let (mut sum, mut total) = ([0.0; 2], 0.0);
    for (i, pixel) in samples.chunks_exact(channels).enumerate() {
        let weight = f64::from(pixel[0].saturating_sub(pixel[1]));
        let position = [i as u32 % width, i as u32 / width].map(|at| f64::from(at) + 0.5);
        sum = [0, 1].map(|axis| sum[axis] + weight * position[axis]);
        total += weight;
    }
    sum.map(|sum| sum / total)
}

/// Returns the six numbers of a world file.
fn world_file(path: &str) -> [f64; 6] {
    let text = fs::read_to_string(path).unwrap();
    let numbers: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
    numbers.try_into().unwrap()
}

/// Returns what a program of GDAL prints; if GDAL is not installed, prints that the test is skipped.
fn gdal(program: &str, arguments: &[&str]) -> Option<String> {
    match Command::new(program).args(arguments).output() {
        Ok(output) => {
            assert!(output.status.success(), "{program} {arguments:?}: {}", stderr(&output));
            Some(String::from_utf8(output.stdout).unwrap())
        }
        Err(_) => {
            report_skipped(&format!("{program} is absent"));
            None
        }
    }
}

const UNLIT: [&str; 4] = ["--light", "none", "--spp", "16"];

#[test]
fn a_known_point_lands_within_half_a_pixel_by_the_world_file() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    for (options, pixel_size) in [
        (&["--gsd", "0.1"][..], 0.1),
        (&["--scale", "1:50", "--dpi", "25.4"], 0.05),
        (&["--gsd", "0.04", "--resolution", "101x75"], 0.04),
    ] {
        let picture = folder.path("plan.png");
        succeed(&[&["render", &cloud, "-o", &picture], &UNLIT[..], options].concat());
        let [a, d, b, e, c, f] = world_file(&folder.path("plan.pgw"));
        assert_eq!([d, b], [0.0, 0.0]);
        assert!((a - pixel_size).abs() < 1e-9 && (e + pixel_size).abs() < 1e-9, "{a} {e}");
        // World files name the centre of the upper left pixel; edges lie on multiples of a pixel.
        let edge = [(c - 0.5 * a) / a, (f - 0.5 * e) / a];
        assert!(edge.iter().all(|edge| (edge - edge.round()).abs() < 1e-3), "{edge:?}");
        let [x, y] = middle_of_red(read_png(&picture));
        let found = [c + a * (x - 0.5), f + e * (y - 0.5)];
        let off = [0, 1].map(|axis| (found[axis] - MARKER[axis]).abs());
        assert!(off.iter().all(|off| *off < 0.5 * pixel_size), "{options:?}: {found:?}");
    }
}

#[test]
fn sheets_continue_each_other() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let sheet = |name: &str, size: &str, middle: [f64; 2]| {
        let picture = folder.path(name);
        let focal_point = format!("{},{},0", middle[0], middle[1]);
        let sheet = ["--gsd", "0.1", "--resolution", size, "--camera-focal-point", &focal_point];
        succeed(&[&["render", &cloud, "-o", &picture], &UNLIT[..], &sheet].concat());
        (read_png(&picture).3, world_file(&picture.replace(".png", ".pgw")))
    };
    let (west, west_at) = sheet("west.png", "20x30", [691_606.0, 5_334_760.5]);
    let (east, east_at) = sheet("east.png", "20x30", [691_608.0, 5_334_760.5]);
    assert!((east_at[4] - west_at[4] - 2.0).abs() < 1e-9 && east_at[5] == west_at[5]);
    let (both, _) = sheet("both.png", "40x30", [691_607.0, 5_334_760.5]);
    for row in 0..30 {
        let joined = [&west[60 * row..][..60], &east[60 * row..][..60]].concat();
        let alike = joined.iter().zip(&both[120 * row..]).filter(|(a, b)| a.abs_diff(**b) <= 8);
        // Edges of the square are sampled at other places.
        assert!(112 < alike.count(), "row {row}");
    }
}

#[test]
fn gdal_reads_place_system_and_elevations() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let (picture, heights) = (folder.path("plan.tif"), folder.path("heights.tif"));
    let plan = ["--gsd", "0.1", "--crs", "EPSG:25832", "--height-map", &heights];
    succeed(&[&["render", &cloud, "-o", &picture], &UNLIT[..], &plan].concat());
    assert!(!Path::new(&folder.path("plan.tfw")).exists());
    let Some(info) = gdal("gdalinfo", &["-json", &picture]) else { return };
    assert!(info.contains("25832"), "{info}");
    let [x, y] = MARKER.map(|coordinate| coordinate.to_string());
    let value = |file: &str, x: &str, y: &str| {
        let values = gdal("gdallocationinfo", &["-geoloc", "-valonly", file, x, y]).unwrap();
        values.lines().map(|line| line.trim().parse().unwrap()).collect::<Vec<f64>>()
    };
    assert_eq!(value(&picture, &x, &y)[..3], [255.0, 0.0, 0.0]);
    // Just within and without the square's right edge, half a pixel to either side.
    let value_at = |offset: f64| value(&picture, &(MARKER[0] + offset).to_string(), &y)[1];
    assert!(value_at(0.45) < 64.0 && 100.0 < value_at(0.62));
    let elevation = value(&heights, &x, &y)[0];
    assert!((elevation - ELEVATION).abs() < 0.01, "{elevation}");
    let info = gdal("gdalinfo", &["-json", &heights]).unwrap();
    assert!(info.contains("\"noDataValue\":-9999.0"), "{info}");
}

#[test]
fn a_print_at_1_to_50_measures_right() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let picture = folder.path("plan.png");
    let print = ["--scale", "1:50", "--dpi", "300", "--scale-bar"];
    succeed(&[&["render", &cloud, "-o", &picture], &UNLIT[..], &print].concat());
    let file = std::io::BufReader::new(fs::File::open(&picture).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    let density = reader.info().pixel_dims.unwrap();
    let metres_on_paper = |pixels: f64| pixels / f64::from(density.xppu);
    // The floor is 6 m wide: 12 cm on paper.
    let width = metres_on_paper(f64::from(reader.info().width));
    assert!((50.0 * width - 6.0).abs() < 0.02, "{width}");
}

#[test]
fn an_elevation_looks_level_and_has_no_place_on_a_map() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let picture = folder.path("front.png");
    let front = ["--gsd", "0.1", "--camera-direction", "0,1,0", "--dry-run"];
    let scene = succeed(&[&["render", &cloud, "-o", &picture], &front[..]].concat());
    let scene: serde_json::Value = serde_json::from_str(&scene).unwrap();
    // Level, the floor is a line: one pixel high.
    let resolution = scene["resolution"].as_str().unwrap();
    assert!(["60x1", "61x1"].contains(&resolution), "{resolution}");
    assert_eq!(scene["gsd"], 0.1);
    succeed(&[&["render", &cloud, "-o", &picture], &front[..4]].concat());
    assert_eq!(folder.names(), ["floor.csv", "front.png"]);
}

#[test]
fn what_cannot_be_a_plan_is_refused() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let refused = |options: &[&str], code: i32| {
        let picture = folder.path("plan.png");
        fail(&[&["render", &cloud, "-o", &picture], options].concat(), code)
    };
    let heights = folder.path("heights.tif");
    for (options, code, words) in [
        (&["--gsd", "1e-6"][..], 2, "use larger pixels, or give the size of a sheet"),
        (&["--gsd", "0.1", "--scale", "1:50"], 2, "excludes"),
        (&["--gsd", "0.1", "--camera-panorama"], 2, "excludes"),
        (&["--gsd", "0.1", "--crs", "EPSG:4326"], 2, "degrees"),
        (&["--gsd", "0.1", "--crs", "EPSG:1"], 2, "EPSG:25832"),
        (&["--scale", "1:0"], 2, "as in 1:50"),
        (&["--height-map", &heights], 2, "[--gsd]"),
        (&["--gsd", "0.1", "--surface", "points", "--height-map", &heights], 2, "needs a surface"),
        (&["--gsd", "0.1", "--height-map", "heights.png"], 2, ".tif"),
    ] {
        let text = refused(options, code);
        assert!(text.contains(words), "{options:?}: {text}");
    }
    assert_eq!(folder.names(), ["floor.csv"]);
}

#[test]
fn the_sun_of_a_date_stands_where_the_place_says() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let dry = |options: &[&str]| {
        let arguments = ["render", &cloud, "-o", "a.png", "--dry-run"];
        surfel(&[&arguments[..], options].concat())
    };
    let sun = |options: &[&str]| {
        let output = dry(options);
        assert!(output.status.success(), "{options:?}: {}", stderr(&output));
        let scene: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        ["azimuth", "elevation"].map(|key| scene["sun"][key].as_f64().unwrap())
    };
    // Noon in Munich: the sun is in the true south, 1.9 degrees east of grid south.
    let noon = ["--sun", "2026-06-21T13:16+02:00"];
    let [by_place, elevation] = sun(&[&noon[..], &["--place", "48.1387,11.5736"]].concat());
    assert!((by_place - 180.0).abs() < 0.5 && (elevation - 65.3).abs() < 0.3, "{by_place}");
    let [by_system, _] = sun(&[&noon[..], &["--crs", "EPSG:25832"]].concat());
    assert!((by_place - by_system - 1.92).abs() < 0.05, "{by_system}");

    let text = stderr(&dry(&noon));
    assert!(text.contains("[--place, --crs]"), "{text}");
    let midnight = ["--sun", "2026-06-21T01:00+02:00", "--place", "48.1,11.6"];
    let output = dry(&midnight);
    assert!(stderr(&output).contains("below the horizon"), "{}", stderr(&output));
    let scene: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(scene["light"], serde_json::json!(["sky"]));
    let text = stderr(&dry(&[&midnight[..], &["--light", "sun"]].concat()));
    assert!(text.contains("choose another time"), "{text}");
}

#[test]
fn a_plan_that_does_not_fit_into_memory_is_refused_before_the_work() {
    let folder = Folder::new();
    let cloud = folder.write("floor.csv", floor());
    let plan = ["--gsd", "0.001", "--memory-limit", "400M"];
    let picture = folder.path("plan.png");
    let text = fail(&[&["render", &cloud, "-o", &picture], &plan[..]].concat(), 1);
    assert!(text.contains("--memory-limit"), "{text}");
}

#[test]
fn a_movie_of_a_plan_has_the_pixels_of_the_plan() {
    let folder = Folder::new();
    folder.write("floor.csv", floor());
    let scene =
        folder.write("scene.toml", "gsd = 0.2\nspp = 1\n[[object]]\nfile = \"floor.csv\"\n");
    let (movie, picture) = (folder.path("movie.png"), folder.path("plan.png"));
    succeed(&["animate", &scene, "-o", &movie, "--frames", "2"]);
    succeed(&["render", &scene, "-o", &picture]);
    let (frame, plan) = (read_png(movie), read_png(picture));
    assert_eq!((frame.0, frame.1), (plan.0, plan.1));
    assert!(29 <= frame.0 && frame.0 <= 34, "{} pixels", frame.0);
}

#[test]
fn the_stated_system_of_degrees_is_that_of_the_file() {
    let folder = Folder::new();
    let point = |n: usize| {
        let (i, j) = (n % 40, n / 40);
        let [x, y] = [11.57 + 2e-6 * i as f64, 48.13 + 2e-6 * j as f64];
        format!("{x:.7} {y:.7} {:.2}\n", 520.0 + 0.01 * (i * j) as f64)
    };
    let cloud = folder.write("degrees.xyz", (0..1600).map(point).collect::<String>());
    let focal_point = |crs: &[&str]| {
        let options = ["--gsd", "0.05", "--sun", "2026-06-21T15:00+02:00", "--dry-run"];
        let text = succeed(&[&["render", &cloud], &options[..], crs].concat());
        let scene: serde_json::Value = serde_json::from_str(&text).unwrap();
        let azimuth = scene["sun"]["azimuth"].as_f64().unwrap();
        (scene["camera"]["focal_point"][0].as_f64().unwrap(), azimuth)
    };
    // The meridian of zone 32 lies 2.57 degrees to the west, that of zone 33 3.43 degrees to the east.
    let (x, azimuth) = focal_point(&["--crs", "EPSG:4326"]);
    assert!((focal_point(&["--crs", "EPSG:25832"]).0 - x).abs() < 0.1);
    let (x_of_33, azimuth_of_33) = focal_point(&["--crs", "EPSG:25833"]);
    assert!((691_000.0..692_000.0).contains(&x) && (244_000.0..246_000.0).contains(&x_of_33));
    // Grid north of both zones differs by 4.5 degrees.
    assert!((azimuth_of_33 - azimuth - 4.5).abs() < 0.3, "{azimuth} {azimuth_of_33}");
    let picture = folder.path("plan.png");
    let plan = ["--gsd", "0.05", "--crs", "EPSG:25833", "--spp", "1"];
    succeed(&[&["render", &cloud, "-o", &picture], &plan[..]].concat());
    let [.., left, _] = world_file(&folder.path("plan.pgw"));
    assert!((244_000.0..246_000.0).contains(&left), "{left}");
}

#[test]
fn points_beside_a_plan_are_reported_with_the_plan_that_shows_them() {
    let folder = Folder::new();
    let shed = (0..20).map(|i| {
        let [x, y] = [MARKER[0] + 30.0 + 0.05 * f64::from(i), MARKER[1]];
        format!("{x:.3},{y:.3},{ELEVATION},128,128,128\n")
    });
    let cloud = folder.write("site.csv", floor() + &shed.collect::<String>());
    let dry = |options: &[&str]| {
        surfel(&[&["render", &cloud, "--gsd", "0.1", "--dry-run"], options].concat())
    };
    let text = stderr(&dry(&[]));
    let warning = text.lines().find(|line| line.starts_with("warning: ")).unwrap_or_default();
    assert!(warning.contains("20 points outside of the plan, up to 27.9 m away"), "{text}");
    assert!(warning.ends_with("[--resolution, --camera-focal-point]"), "{text}");
    let words: Vec<&str> = warning.split(' ').collect();
    let word_before =
        |word: &str| words[words.iter().position(|other| *other == word).unwrap() - 1];
    let (size, middle) = (word_before("pixels"), word_before("show"));
    let output = dry(&["--resolution", size, "--camera-focal-point", middle]);
    assert!(!stderr(&output).contains("outside of the plan"), "{}", stderr(&output));
    let scene: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let width: f64 = size.split('x').next().unwrap().parse().unwrap();
    let x = scene["camera"]["focal_point"][0].as_f64().unwrap();
    let [low, high] = [x - 0.05 * width, x + 0.05 * width];
    assert!(low <= MARKER[0] - 2.99 && MARKER[0] + 30.95 <= high, "{low} {high}");
}

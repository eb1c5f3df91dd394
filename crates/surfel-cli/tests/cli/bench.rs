//! `surfel bench`: rays and hits equal Embree's; tables and JSON have their documented form.

use super::common::{Folder, dome, fail, gltf, stderr, succeed, surfel, tile};
use serde_json::Value;
use surfel_core::progress::NoProgress;
use surfel_formats::{LoadOptions, load, load_bytes};

/// Returns the points of a ball as x y z radius nx ny nz.
fn ball() -> Vec<[f32; 7]> {
    let n = 4000;
    let golden_angle = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let point = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (sin, cos) = (i as f64 * golden_angle).sin_cos();
        let across = (1.0 - z * z).sqrt();
        let [x, y, z] = [across * cos, across * sin, z].map(|v| v as f32);
        [x, y, z, 0.08, x, y, z]
    };
    (0..n).map(point).collect()
}

fn bin(points: &[[f32; 7]]) -> Vec<u8> {
    points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

fn ply(points: &[[f32; 7]]) -> Vec<u8> {
    let names = ["x", "y", "z", "radius", "nx", "ny", "nz"];
    let properties = names.map(|name| format!("property float {name}\n")).concat();
    let n = points.len();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {n}\n{properties}end_header\n"
    );
    [header.into_bytes(), bin(points)].concat()
}

const CAMERA: &str = "3,-4,1.5,0,0.1,0,40,-2,-5,6\n";

fn bench(arguments: &[&str]) -> Value {
    let common = ["bench", "--runs", "1", "--json", "--quiet"];
    serde_json::from_str(&succeed(&[&common, arguments].concat())).unwrap()
}

fn keys(object: &Value) -> Vec<&str> {
    object.as_object().unwrap().keys().map(String::as_str).collect()
}

/// The expected numbers are those of Embree 4.4 along the same rays: hits of primary and shadow rays, and the mean
/// distance of primary hits.
#[test]
fn hits_are_those_of_embree() {
    let folder = Folder::new();
    let cloud = folder.write("ball.bin", bin(&ball()));
    let camera = folder.write("ball.cam", CAMERA);
    let embree = [
        ("disc", 3275, 330, 4.50827),
        ("splat", 3275, 330, 4.50827),
        ("sphere", 3811, 1147, 4.45503),
    ];
    for (surface, n_hits, n_shadowed, mean_distance) in embree {
        let options = ["--camera-file", &camera, "--surface", surface, "--resolution", "200x120"];
        let result = bench(&[&[cloud.as_str()][..], &options].concat());
        let rays = &result["rays"];
        let near = |found: &Value, expected: i64| (found.as_i64().unwrap() - expected).abs() <= 5;
        assert_eq!(rays["primary"]["rays"], 200 * 120);
        assert!(near(&rays["primary"]["hits"], n_hits), "{surface}: {rays}");
        assert!(near(&rays["shadow"]["hits"], n_shadowed), "{surface}: {rays}");
        assert_eq!(rays["shadow"]["rays"], rays["primary"]["hits"]);
        assert_eq!(rays["bounce"]["hits"], rays["bounce-any"]["hits"]);
        let mean = rays["primary"]["mean_distance"].as_f64().unwrap();
        assert!((mean - mean_distance).abs() < 5e-4, "{surface}: {mean}");
        if surface != "sphere" {
            let n_discs = rays["gather"]["hits_per_ray"].as_f64().unwrap();
            assert!((n_discs - 6.369).abs() < 0.03, "{surface}: {n_discs}");
        }
    }
}

#[test]
fn json_has_its_keys_in_order() {
    let folder = Folder::new();
    let cloud = folder.write("ball.bin", bin(&ball()));
    let result = bench(&[&cloud, "--resolution", "40x30", "--simd", "portable"]);
    let first = ["rays", "build_s", "bytes_per_point", "peak_rss_bytes", "threads", "simd"];
    assert_eq!(keys(&result)[..6], first);
    assert_eq!(result["backend"], "cpu");
    assert_eq!(keys(&result["bytes_per_point"]), ["tree", "points", "total"]);
    assert_eq!(keys(&result["rays"]), ["primary", "shadow", "bounce-any", "bounce", "gather"]);
    let row =
        ["rays", "hits", "median_mrays_per_s", "best_mrays_per_s", "wall_mrays_per_s"].as_slice();
    for (kind, found) in result["rays"].as_object().unwrap() {
        assert_eq!(&keys(found)[..5], row, "{kind}");
        assert!(found["best_mrays_per_s"].as_f64() >= found["median_mrays_per_s"].as_f64());
    }
    assert_eq!((&result["simd"], &result["points"]), (&"portable".into(), &4000.into()));
}

#[test]
fn radii_and_normals_of_a_file_are_not_changed() {
    let folder = Folder::new();
    // The normals point inward: a step that orients normals would flip them.
    let inward = ball().into_iter().map(|[x, y, z, r, ..]| [x, y, z, r + 0.01 * x, -x, -y, -z]);
    let points: Vec<[f32; 7]> = inward.collect();
    let camera = folder.write("ball.cam", CAMERA);
    let found = [("a.bin", bin(&points)), ("a.ply", ply(&points))].map(|(name, bytes)| {
        let cloud = folder.write(name, &bytes);
        let prepared = folder.path("prepared.ply");
        succeed(&["prepare", &cloud, "-o", &prepared]);
        let there = load(prepared.as_ref(), &LoadOptions::default(), &NoProgress).unwrap().cloud;
        let here = load_bytes(name, &bytes, &LoadOptions::default(), &NoProgress).unwrap().cloud;
        assert_eq!((&there.positions, &there.radii), (&here.positions, &here.radii), "{name}");
        let normals = there.normals.unwrap().into_iter().zip(here.normals.unwrap());
        assert!(normals.into_iter().all(|(a, b)| a.distance(b) < 1e-6), "{name}");
        let result = bench(&[&cloud, "--camera-file", &camera, "--resolution", "100x60"]);
        ["primary", "shadow", "bounce"].map(|kind| result["rays"][kind]["hits"].clone())
    });
    assert_eq!(found[0], found[1]);
}

/// Returns the hits of camera rays and of shadow rays.
fn hits(arguments: &[&str]) -> [Value; 2] {
    let result = bench(&[arguments, &["--resolution", "64x64"]].concat());
    ["primary", "shadow"].map(|kind| result["rays"][kind]["hits"].clone())
}

#[test]
fn bench_applies_the_transforms_of_gltf_nodes() {
    let folder = Folder::new();
    let plain = folder.write("plain.gltf", gltf());
    let expected = hits(&[&plain]);
    assert!(600 < expected[0].as_i64().unwrap(), "{expected:?}");
    for (name, place) in [
        ("moved.gltf", r#""translation":[100,20,-7]"#),
        ("small.gltf", r#""scale":[0.01,0.01,0.01]"#),
        ("turned.gltf", r#""rotation":[0,0,0,-1],"translation":[5e6,0,0]"#),
    ] {
        let text = gltf().replace(r#"{"mesh":0}"#, &format!(r#"{{"mesh":0,{place}}}"#));
        // Positions near 5e6 have a precision of 0.5 in f32; node transforms are f64.
        assert_eq!(hits(&[&folder.write(name, text)]), expected, "{name}");
    }
    let twice = gltf().replace(r#""nodes":[{"mesh":0}]"#, r#""nodes":[{"mesh":0},{"mesh":0}]"#);
    let twice = twice.replace(r#"[{"nodes":[0]}]"#, r#"[{"nodes":[0,1]}]"#);
    let error = fail(&["bench", &folder.write("twice.gltf", twice)], 1);
    assert!(error.contains("holds 2 objects"), "{error}");
}

#[test]
fn vertices_of_a_mesh_are_measured_as_points() {
    let folder = Folder::new();
    let scene = folder.write("plain.gltf", gltf());
    assert_eq!(bench(&[&scene])["surface"], "triangle");
    let result = bench(&[&scene, "--vertices", "--surface", "disc", "--radius", "0.5"]);
    assert_eq!((&result["surface"], &result["points"]), (&"disc".into(), &3.into()));
}

#[test]
fn bench_warns_if_no_camera_ray_hits() {
    let folder = Folder::new();
    let cloud = folder.write("ball.bin", bin(&ball()));
    let camera = folder.write("ball.cam", "3,-4,1.5,6,-9,1.5,40,-2,-5,6");
    let message = stderr(&surfel(&["bench", &cloud, "--camera-file", &camera, "--runs", "1"]));
    assert!(message.contains("no camera ray hits anything"), "{message}");
    assert!(message.contains("radii as in the file"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_as_camera_file() {
    let folder = Folder::new();
    let cloud = folder.write("ball.bin", bin(&ball()));
    let pipe = folder.path("pipe.cam");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let error = fail(&["bench", &cloud, "--camera-file", &pipe], 1);
    assert!(error.contains("a pipe or device"), "{error}");
}

#[test]
fn rays_selects_the_kinds_that_are_measured() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(30));
    let kinds = "surface,primary,gather";
    let rays = &bench(&[&cloud, "--resolution", "64x64", "--rays", kinds])["rays"];
    assert_eq!(keys(rays), ["surface", "primary", "gather"]);
    assert!(rays["primary"]["hits"].as_u64() >= rays["surface"]["hits"].as_u64());
    assert_eq!(rays["primary"]["hits"], rays["gather"]["hits"]);
    let map = ["--camera-direction", "0,0,-1", "--camera-orthographic", "--rays", "shadow"];
    let rays = bench(&[&[cloud.as_str(), "--resolution", "64x64"][..], &map].concat());
    assert!(500 < rays["rays"]["shadow"]["rays"].as_u64().unwrap());

    let table = succeed(&["bench", &cloud, "--resolution", "32x32", "--runs", "2"]);
    for word in ["median", "wall", "bounce-any", "discs a hit", "built in", "threads:", "simd:"] {
        assert!(table.contains(word), "{word}: {table}");
    }
}

#[test]
fn gather_rays_are_left_out_for_spheres() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let spheres = ["bench", &cloud, "--runs", "1", "--resolution", "32x32", "--surface", "sphere"];
    let output = surfel(&spheres);
    assert!(output.status.success() && stderr(&output).contains("gather left out"));
    assert!(!String::from_utf8_lossy(&output.stdout).contains("gather"));
    let text = fail(&[&spheres[..], &["--rays", "primary,gather"]].concat(), 2);
    assert!(text.contains("--surface sphere"), "{text}");
    assert!(fail(&["bench", &cloud, "--surface", "points"], 2).contains("choose another kind"));
    let balls = ["bench", &cloud, "--runs", "1", "--resolution", "32x32", "--surface", "mls"];
    assert!(stderr(&surfel(&balls)).contains("gather left out: balls do not blend"));
    let text = fail(&[&balls[..], &["--rays", "gather"]].concat(), 2);
    assert!(text.contains("--surface mls"), "{text}");
}

#[test]
fn a_mesh_is_measured_per_triangle() {
    let folder = Folder::new();
    let mesh = folder.write("tile.ply", tile(2.0, 1.0, [9; 3]));
    let result = bench(&[&mesh, "--resolution", "32x32"]);
    assert_eq!((&result["triangles"], &result["surface"]), (&2.into(), &"triangle".into()));
    assert!(result.get("points").is_none() && result.get("bytes_per_point").is_none());
    assert_eq!(keys(&result["bytes_per_triangle"]), ["tree", "triangles", "total"]);
    assert!(100 < result["rays"]["primary"]["hits"].as_u64().unwrap());
    assert_eq!(keys(&result["rays"]), ["primary", "shadow", "bounce-any", "bounce"]);
    let message = fail(&["bench", &mesh, "--runs", "1", "--rays", "gather"], 2);
    assert!(message.contains("a mesh"), "{message}");
    assert!(succeed(&["bench", &mesh, "--runs", "1", "--resolution", "9x9"]).contains("triangle"));
}

#[test]
fn invalid_camera_files_are_errors() {
    let folder = Folder::new();
    let cloud = folder.write("dome.ply", dome(20));
    let with = |name: &str| fail(&["bench", &cloud, "--camera-file", name], 1);
    let short = folder.write("short.cam", "1,2,3\n");
    let text = with(&short);
    assert!(text.contains(&format!("{short}: found 3 numbers, expected one line of ten numbers")));
    let binary = folder.write("binary.cam", [0xff; 9000]);
    assert!(with(&binary).contains("binary.cam: found 9000 bytes where at most 4096 are expected"));
    let binary = folder.write("binary.cam", [0xff; 90]);
    assert!(with(&binary).contains("binary.cam: found bytes that are no text"));
    assert!(with(&folder.path("absent.cam")).contains("check the name and the folder"));
    let camera = folder.write("good.cam", CAMERA);
    for other in [&["--camera-position", "1,2,3"][..], &["--up", "+Y"]] {
        fail(&[&["bench", &cloud, "--camera-file", &camera][..], other].concat(), 2);
    }
    fail(&["bench", &cloud, "--simd", "abacus"], 2);
}

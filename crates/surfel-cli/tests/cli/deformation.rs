//! Points of glTF files that morph targets and skins deform.

use super::animate::{difference, movie, read_apng, read_shot};
use super::common::Folder;

const N_SIDE: usize = 40;

/// Returns a sheet of points: level for `bend` 0, otherwise wider and in waves.
fn sheet(bend: f32) -> Vec<[f32; 3]> {
    let coordinate = |i: usize| 2.0 * i as f32 / (N_SIDE - 1) as f32 - 1.0;
    let points = (0..N_SIDE * N_SIDE).map(|n| [coordinate(n % N_SIDE), coordinate(n / N_SIDE)]);
    points.map(|[x, z]| [(1.0 + bend) * x, 0.4 * bend * (4.0 * x).sin(), z]).collect()
}

/// Bytes of a glTF buffer with its views and accessors.
#[derive(Default)]
struct Buffer {
    data: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Buffer {
    /// Appends bytes and returns the index of their accessor.
    fn put(&mut self, kind: &str, width: usize, code: u32, bytes: &[u8]) -> usize {
        let (offset, length) = (self.data.len(), bytes.len());
        self.data.extend(bytes);
        let view = format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#);
        self.views.push(view);
        let (view, count) = (self.views.len() - 1, length / width);
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{code},"type":"{kind}","count":{count}}}"#
        ));
        view
    }

    fn floats(&mut self, kind: &str, width: usize, floats: &[f32]) -> usize {
        let bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.put(kind, 4 * width, 5126, &bytes)
    }

    /// Returns the file with these further members.
    fn gltf(&self, members: &str) -> String {
        let data: String = self.data.iter().map(|byte| format!("%{byte:02x}")).collect();
        let (length, views) = (self.data.len(), self.views.join(","));
        let accessors = self.accessors.join(",");
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{length},"uri":"data:,{data}"}}],
"bufferViews":[{views}],"accessors":[{accessors}],{members}}}"#
        )
    }
}

fn still(points: &[[f32; 3]]) -> String {
    let mut buffer = Buffer::default();
    buffer.floats("VEC3", 3, points.as_flattened());
    buffer.gltf(
        r#""nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0}}]}]"#,
    )
}

/// Returns the sheet with a morph target that bends it within two seconds.
fn morphed(bend: f32) -> String {
    let (rest, bent) = (sheet(0.0), sheet(bend));
    let offsets: Vec<f32> =
        rest.as_flattened().iter().zip(bent.as_flattened()).map(|(a, b)| b - a).collect();
    let mut buffer = Buffer::default();
    buffer.floats("VEC3", 3, rest.as_flattened());
    buffer.floats("VEC3", 3, &offsets);
    buffer.floats("SCALAR", 1, &[0.0, 2.0]);
    buffer.floats("SCALAR", 1, &[0.0, 1.0]);
    buffer.gltf(
        r#""nodes":[{"mesh":0}],
"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}]}],
"animations":[{"samplers":[{"input":2,"output":3}],
"channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}]"#,
    )
}

/// Returns the sheet with a joint that lifts its right half by 1 within two seconds.
fn skinned() -> String {
    let rest = sheet(0.0);
    let is_right = |[x, _, _]: &[f32; 3]| 0.0 < *x;
    let joints: Vec<u8> = rest.iter().flat_map(|p| [u8::from(is_right(p)), 0, 0, 0]).collect();
    let mut buffer = Buffer::default();
    buffer.floats("VEC3", 3, rest.as_flattened());
    buffer.put("VEC4", 4, 5121, &joints);
    buffer.floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(rest.len()));
    buffer.floats("SCALAR", 1, &[0.0, 2.0]);
    buffer.floats("VEC3", 3, &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    buffer.gltf(
        r#""nodes":[{"mesh":0,"skin":0},{},{}],"skins":[{"joints":[1,2]}],
"meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}]}],
"animations":[{"samplers":[{"input":3,"output":4}],
"channels":[{"sampler":0,"target":{"node":2,"path":"translation"}}]}]"#,
    )
}

const VIEW: [&str; 8] = [
    "--camera-position=2,-5,4",
    "--camera-focal-point=0,0,0",
    "--light=sun",
    "--sun-azimuth=40",
    "--sun-angle=0",
    "--exposure=0",
    "--up=+Z",
    "--edge-test=off",
];

/// Maximum mean difference, of 255, between a picture of deformed points and one of points written in that pose.
/// Deformed points are within 1/65536 of a block's size of their positions, which changes a sample in a few hundred at
/// rims and edges of shadows. The deformation itself changes the mean by some tens.
const ALLOWED: f64 = 0.5;

#[test]
fn animated_gltf_points_match_points_written_in_the_deformed_pose() {
    let folder = Folder::new();
    let lifted = |[x, y, z]: [f32; 3]| [x, if 0.0 < x { y + 1.0 } else { y }, z];
    let lifted = sheet(0.0).into_iter().map(lifted).collect();
    // A small deformation refits the tree, a large one rebuilds it. A torn sheet has a fixed radius, as adaptive radii
    // differ along the tear.
    for (name, moving, end, radius) in [
        ("a little", morphed(0.2), sheet(0.2), "adaptive"),
        ("far", morphed(1.0), sheet(1.0), "adaptive"),
        ("torn", skinned(), lifted, "0.09"),
    ] {
        let moving = folder.write("moving.gltf", moving);
        let picture = |file: &str, time: &str| {
            // Structures are found only for points that do not move.
            let options = ["--time", time, "--radius", radius, "--structure", "surface"];
            read_shot(&folder, &[&[file], &options[..], &VIEW].concat())
        };
        let rest = picture(&folder.write("rest.gltf", still(&sheet(0.0))), "0");
        let bent = picture(&folder.write("bent.gltf", still(&end)), "0");
        let change = difference(&rest, &bent);
        assert!(3.0 * ALLOWED < change, "{name}: {change} is nothing to tell");
        assert!(picture(&moving, "0") == rest, "{name} at rest");
        let off = difference(&picture(&moving, "2"), &bent);
        assert!(off < ALLOWED, "{name}: {off} of {change}");
        // A frame equals the picture at its time, whatever the deformation of earlier frames.
        let path = folder.path("movie.png");
        let options = ["-o", &path, "--fps", "2", "--radius", radius];
        movie(&[&[moving.as_str()], &options[..], &VIEW].concat());
        let (frames, _) = read_apng(&path);
        assert_eq!(frames.len(), 4);
        for (time, frame) in ["0", "0.5", "1", "1.5"].iter().zip(&frames) {
            assert!(picture(&moving, time) == *frame, "{name} at {time}");
        }
    }
}

#[test]
fn deformed_points_are_subsampled_with_their_skin_and_targets() {
    let folder = Folder::new();
    let moving = folder.write("moving.gltf", morphed(1.0));
    let options = ["--subsample=stride:2", "--radius=0.09", "--radius-scale=1.2"];
    let bent = folder.write("bent.gltf", still(&sheet(1.0)));
    let picture =
        |file: &str| read_shot(&folder, &[&[file, "--time", "2"], &options[..], &VIEW].concat());
    assert!(difference(&picture(&moving), &picture(&bent)) < ALLOWED);
}

//! Temporary folders, sample files and runs of the program, which the tests share.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Maximum time in which a process must end after a signal: far longer than a busy machine needs.
const END_TIMEOUT: Duration = Duration::from_secs(60);

/// A temporary folder for one test, removed at its end.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let name = format!("surfel-cli-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    pub fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        fs::write(self.0.join(name), content).unwrap();
        self.path(name)
    }

    /// Returns the sorted names of its files.
    pub fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
        let mut names: Vec<String> = entries.map(|entry| name(entry).unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // The system cleans its temporary folder.
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_surfel"));
    command.args(arguments);
    command
}

pub fn surfel(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// Runs the program, which must succeed; returns its stdout.
pub fn succeed(arguments: &[&str]) -> String {
    let output = surfel(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs the program, which must fail with this code and a line that starts with `error: `; returns its stderr.
pub fn fail(arguments: &[&str], code: i32) -> String {
    let output = surfel(arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    assert!(text.lines().any(|line| line.starts_with("error: ")), "{arguments:?}: {text}");
    text
}

/// Waits for a process to end; kills it and panics after a timeout.
pub fn wait(child: &mut Child) -> ExitStatus {
    let start = Instant::now();
    while start.elapsed() < END_TIMEOUT {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    panic!("the process was still running after {END_TIMEOUT:?}");
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns a coloured hemisphere on a floor as PLY, with classes and the column `rain`.
pub fn dome(n_side: usize) -> String {
    let coordinate = |i: usize| 2.0 * i as f64 / (n_side - 1) as f64 - 1.0;
    let mut body = String::new();
    for (i, j) in (0..n_side * n_side).map(|n| (n % n_side, n / n_side)) {
        let (x, y) = (coordinate(i), coordinate(j));
        let z = (0.5 - x * x - y * y).max(0.0).sqrt();
        body += &format!("{x} {y} {z} {} {} 128 {} {}\n", i % 256, j % 256, 2 + i % 5, i * j);
    }
    let header = "property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nproperty uchar classification\n\
        property float rain\nend_header\n";
    format!("ply\nformat ascii 1.0\nelement vertex {}\n{header}{body}", n_side * n_side)
}

/// Returns a level square of points of one grey as text.
pub fn square(n_side: usize, color: u8) -> String {
    let points = (0..n_side * n_side).map(|n| (n % n_side, n / n_side));
    points.map(|(x, y)| format!("{x} {y} 0 {color} {color} {color}\n")).collect()
}

/// Returns width, height, channels and samples of an 8-bit PNG.
pub fn read_png(path: impl AsRef<Path>) -> (u32, u32, usize, Vec<u8>) {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut samples = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut samples).unwrap();
    samples.truncate(info.buffer_size());
    (info.width, info.height, info.color_type.samples(), samples)
}

/// Returns a square of two triangles at height `z` in one colour as PLY.
pub fn tile(size: f64, z: f64, color: [u8; 3]) -> String {
    let [r, g, b] = color;
    let corners = [(-size, -size), (size, -size), (size, size), (-size, size)];
    let corners = corners.map(|(x, y)| format!("{x} {y} {z} {r} {g} {b}\n")).concat();
    let header = "property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nelement face 2\n\
        property list uchar int vertex_index\nend_header\n";
    format!("ply\nformat ascii 1.0\nelement vertex 4\n{header}{corners}3 0 1 2\n3 0 2 3\n")
}

/// Returns a triangle that moves by 3 along x within two seconds as glTF.
pub fn gltf() -> String {
    let triangle = [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0f32];
    let (times, places) = ([0.0, 2.0f32], [0.0, 0.0, 0.0, 3.0, 0.0, 0.0f32]);
    let floats = triangle.iter().chain(&times).chain(&places);
    let data: String =
        floats.flat_map(|f| f.to_le_bytes()).map(|byte| format!("%{byte:02x}")).collect();
    let view = |offset: usize, length: usize| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let views = [view(0, 36), view(36, 8), view(44, 24)].join(",");
    let accessor = |view: usize, kind: &str, count: usize| {
        format!(r#"{{"bufferView":{view},"componentType":5126,"type":"{kind}","count":{count}}}"#)
    };
    let accessors = [accessor(0, "VEC3", 3), accessor(1, "SCALAR", 2), accessor(2, "VEC3", 2)];
    let accessors = accessors.join(",");
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":68,"uri":"data:,{data}"}}],
"bufferViews":[{views}],"accessors":[{accessors}],"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
"animations":[{{"samplers":[{{"input":1,"output":2}}],
"channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}}]}}]}}"#
    )
}

/// Returns the triangle of [`gltf`] at rest with two cameras: `still` with a view angle of 0.5 rad, and `eye`, which
/// moves by 3 along x.
pub fn gltf_with_cameras() -> String {
    let nodes = r#"{"mesh":0,"name":"triangle"},
{"name":"still","camera":0,"translation":[0,1,7]},{"name":"eye","camera":1,"translation":[0,1,9]}"#;
    let camera = |angle: f64| {
        format!(r#"{{"type":"perspective","perspective":{{"yfov":{angle},"znear":0.1}}}}"#)
    };
    let cameras = [camera(0.5), camera(0.7)].join(",");
    gltf()
        .replace(r#""nodes":[{"mesh":0}]"#, &format!(r#""nodes":[{nodes}],"cameras":[{cameras}]"#))
        .replace(r#""scenes":[{"nodes":[0]}]"#, r#""scenes":[{"nodes":[0,1,2]}]"#)
        .replace(r#""target":{"node":0"#, r#""target":{"node":2"#)
}

/// Returns an environment map as HDR, twice as wide as high and brightest in the east.
pub fn light_picture() -> Vec<u8> {
    let head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n";
    let row = [[40, 60, 90, 128], [60, 60, 60, 128], [250, 200, 90, 130], [60, 60, 60, 128]];
    [&head[..], row.as_flattened(), row.as_flattened()].concat()
}

/// Renders a small picture and returns the bytes of its file.
pub fn shot(folder: &Folder, arguments: &[&str]) -> Vec<u8> {
    let picture = folder.path("shot.png");
    succeed(&[&["render"], arguments, &SMALL, &["-o", &picture]].concat());
    let bytes = fs::read(&picture).unwrap();
    fs::remove_file(picture).unwrap();
    bytes
}

/// Options of a picture that renders quickly.
pub const SMALL: [&str; 6] = ["--resolution", "32x24", "--spp", "1", "--light-samples", "1"];

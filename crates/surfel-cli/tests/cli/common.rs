//! Folders, clouds and runs of the program for the tests.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};

/// A folder of its own for each test, removed at the end.
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

    /// Names of the files in it, sorted.
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
        // What stays behind in the system's temporary folder harms nobody.
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

/// A run that must succeed; its stdout.
pub fn succeed(arguments: &[&str]) -> String {
    let output = surfel(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// A run that must fail with this code, in one line of its own; its stderr.
pub fn fail(arguments: &[&str], code: i32) -> String {
    let output = surfel(arguments);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    assert!(text.lines().any(|line| line.starts_with("error: ")), "{arguments:?}: {text}");
    text
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A hemisphere on a floor, coloured, with a class and a column of its own, as PLY.
pub fn dome(n_side: usize) -> String {
    let place = |i: usize| 2.0 * i as f64 / (n_side - 1) as f64 - 1.0;
    let mut body = String::new();
    for (i, j) in (0..n_side * n_side).map(|n| (n % n_side, n / n_side)) {
        let (x, y) = (place(i), place(j));
        let z = (0.5 - x * x - y * y).max(0.0).sqrt();
        body += &format!("{x} {y} {z} {} {} 128 {} {}\n", i % 256, j % 256, 2 + i % 5, i * j);
    }
    let header = "property float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nproperty uchar classification\n\
        property float rain\nend_header\n";
    format!("ply\nformat ascii 1.0\nelement vertex {}\n{header}{body}", n_side * n_side)
}

/// A level square of points in one colour, as text.
pub fn square(n_side: usize, color: u8) -> String {
    let points = (0..n_side * n_side).map(|n| (n % n_side, n / n_side));
    points.map(|(x, y)| format!("{x} {y} 0 {color} {color} {color}\n")).collect()
}

/// Width, height, channels and samples of an 8-bit PNG.
pub fn read_png(path: impl AsRef<Path>) -> (u32, u32, usize, Vec<u8>) {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut samples = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut samples).unwrap();
    samples.truncate(info.buffer_size());
    (info.width, info.height, info.color_type.samples(), samples)
}

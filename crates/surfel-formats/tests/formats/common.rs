//! Helpers for all tests: shared scans, temporary folders, recorded notes and small clouds.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::shared_data::shared_data;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::scene::{Geometry, Graph, Mesh};
use surfel_formats::{
    Error, FileInfo, LoadOptions, Loaded, SaveOptions, load, load_bytes, load_graph_bytes, save,
};

/// Returns the path of a shared test file, or reports that the shared data is absent and returns `None`.
pub fn shared(name: &str) -> Option<PathBuf> {
    Some(shared_data()?.join(name))
}

/// A temporary folder that is removed when dropped.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("surfel-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Records all notes, and cancels if `cancelled` is set.
#[derive(Default)]
pub struct Listener {
    pub notes: Mutex<Vec<String>>,
    pub cancelled: AtomicBool,
}

impl Listener {
    pub fn has_note(&self, words: &str) -> bool {
        self.notes.lock().unwrap().iter().any(|note| note.contains(words))
    }
}

impl Progress for Listener {
    fn note(&self, line: &str) {
        self.notes.lock().unwrap().push(line.into());
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

pub fn read(name: &str, bytes: impl AsRef<[u8]>) -> Result<Loaded, Error> {
    load_bytes(name, bytes.as_ref(), &LoadOptions::default(), &NoProgress)
}

/// Reads a file as a graph and records the notes.
pub fn read_graph(
    name: &str,
    bytes: impl AsRef<[u8]>,
) -> Result<(Graph<PointCloud>, FileInfo, Listener), Error> {
    let listener = Listener::default();
    let (graph, info) = load_graph_bytes(name, bytes.as_ref(), &LoadOptions::default(), &listener)?;
    Ok((graph, info, listener))
}

/// Reads a file with a single mesh.
pub fn read_mesh(name: &str, bytes: impl AsRef<[u8]>) -> Mesh {
    let (mut graph, ..) = read_graph(name, bytes).unwrap();
    assert_eq!(graph.geometries.len(), 1, "{name}");
    match graph.geometries.remove(0) {
        Geometry::Triangles(mesh) => mesh,
        Geometry::Points(_) => panic!("{name}: points"),
    }
}

/// Writes a cloud to a file with this extension and reads it back.
pub fn round_trip(cloud: &PointCloud, extension: &str, options: &SaveOptions) -> Loaded {
    static COUNT: std::sync::atomic::AtomicUsize = std::sync::atomic::AtomicUsize::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = Folder::new(&format!("there-and-back-{count}"));
    let path = folder.path(&format!("cloud.{extension}"));
    save(&path, cloud, options, &NoProgress).unwrap();
    load(&path, &LoadOptions::default(), &NoProgress).unwrap()
}

/// Returns the bytes of the file that `save` writes for the cloud.
pub fn encode_cloud(cloud: &PointCloud, extension: &str) -> Vec<u8> {
    let folder = Folder::new(&format!("file-of-{extension}-{:p}", cloud));
    let path = folder.path(&format!("cloud.{extension}"));
    save(&path, cloud, &SaveOptions::default(), &NoProgress).unwrap();
    std::fs::read(&path).unwrap()
}

/// Returns a cloud with every kind of column.
pub fn full_cloud(n: usize) -> PointCloud {
    let f = |i: usize, step: f32| ((i * 7919) % 1000) as f32 * step;
    let scalar = |name: &str, values| Scalar { name: name.into(), values };
    PointCloud {
        origin: DVec3::new(500_000.0, 4_900_000.0, 100.0),
        positions: (0..n).map(|i| Vec3::new(f(i, 0.25), f(i + 1, 0.125), f(i + 2, 0.5))).collect(),
        normals: Some((0..n).map(|i| Vec3::new(f(i, 1.0), 1.0, 2.0).normalize()).collect()),
        radii: Some((0..n).map(|i| f(i, 0.001) + 0.5).collect()),
        colors: Some((0..n).map(|i| [(i % 256) as u16 * 257, 1000, 65535]).collect()),
        intensity: Some((0..n).map(|i| (1 + i * 3 % 60_000) as f32).collect()),
        classification: Some((0..n).map(|i| 1 + (i % 18) as u8).collect()),
        scalars: vec![
            scalar("return_number", Values::U8((0..n).map(|i| 1 + (i % 5) as u8).collect())),
            scalar("gps_time", Values::F64((0..n).map(|i| 1e8 + i as f64 * 1e-3).collect())),
            scalar("Deviation", Values::U16((0..n).map(|i| i as u16).collect())),
            scalar("amplitude", Values::F32((0..n).map(|i| f(i, -0.3)).collect())),
            scalar("count", Values::I32((0..n).map(|i| -(i as i32)).collect())),
        ],
        ..PointCloud::default()
    }
}

/// Returns the colours that a file with this extension holds: all but LAS and LAZ round them to 8 bits.
pub fn colors_in_file(cloud: &PointCloud, extension: &str) -> Option<Vec<[u16; 3]>> {
    let round = |channel: u16| (f64::from(channel) / 257.0).round() as u16 * 257;
    let is_rounded = !["las", "laz"].contains(&extension);
    let channel = |channel: u16| if is_rounded { round(channel) } else { channel };
    let colors = cloud.colors.as_ref()?.iter();
    Some(colors.map(|color| color.map(channel)).collect())
}

/// Returns the largest distance per axis between corresponding points.
pub fn largest_difference(a: &PointCloud, b: &PointCloud) -> DVec3 {
    assert_eq!(a.len(), b.len());
    (0..a.len())
        .map(|i| (a.world_position(i) - b.world_position(i)).abs())
        .fold(DVec3::ZERO, DVec3::max)
}

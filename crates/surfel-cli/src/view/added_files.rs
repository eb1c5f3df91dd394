//! Files that pages have added to their views: clouds and meshes in memory, which settings name by random ids.

use super::rejection::rejection;
use super::rows::{bounds_json, free_name};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use surfel::SceneDescription;
use surfel::description::ObjectDescription;
use surfel::description::rule::absolute_text;
use surfel::memory_files::{FileContent, MemoryContent};
use surfel::progress_log::ProgressLog;
use surfel::resolve::can_be_colored;
use surfel_core::bytes::readable;
use surfel_core::points::{Morph, PointCloud, Skin, Values};
use surfel_core::progress::Progress;
use surfel_core::scene::color::choose_source;
use surfel_core::scene::{Animation, Geometry, Graph, Mesh};
use surfel_formats::{ColumnChoice, LoadOptions};
use surfel_web::{AddedFile, Error, Result, SentFile, SettingsMap};

/// The key of a page's settings that lists the ids of the files that it has added.
pub const KEY: &str = "added_files";

/// The beginning of the folder by which descriptions name an added file; its id follows.
pub const FOLDER: &str = "added-";

/// Number of hexadecimal digits of an id.
const ID_LENGTH: usize = 32;

/// Least number of bytes that a point takes: its position.
const POINT_BYTES: u64 = 12;

/// The files that all pages have added, by their ids.
#[derive(Default)]
pub struct AddedFiles(Mutex<BTreeMap<String, Weak<PageFile>>>);

/// A file that a page has added.
pub struct PageFile {
    id: String,
    name: String,
    content: Arc<FileContent>,
    notes: Vec<String>,
    n_bytes: u64,
}

impl AddedFiles {
    /// Keeps a file for as long as others hold it.
    pub fn insert(&self, file: PageFile) -> Arc<PageFile> {
        let file = Arc::new(file);
        let mut files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        files.retain(|_, other| 0 < other.strong_count());
        files.insert(file.id.clone(), Arc::downgrade(&file));
        file
    }

    /// The files that settings list.
    ///
    /// # Errors
    ///
    /// Fails for files that are not kept any more, and if one is listed twice.
    pub fn listed(&self, settings: &SettingsMap) -> Result<Vec<Arc<PageFile>>> {
        let Some(list) = settings.get(KEY) else { return Ok(Vec::new()) };
        let files = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let invalid = |text: &str| Error::invalid_value(KEY, text);
        let find = |id: &Value| files.get(id.as_str()?)?.upgrade();
        let ids = list.as_array().ok_or_else(|| invalid("expected a list"))?;
        let is_repeated = |(i, id): (usize, &Value)| ids[..i].contains(id);
        if ids.iter().enumerate().any(is_repeated) {
            return Err(invalid("expected each file once"));
        }
        let gone = "a file that was added before is not kept any more; add it again";
        ids.iter().map(|id| find(id).ok_or_else(|| invalid(gone))).collect()
    }
}

impl PageFile {
    /// Reads a file that a page sends. Its name is made different from those of other files of the page and of `rows`.
    ///
    /// # Errors
    ///
    /// Fails as reading does, and for files that need too much memory.
    pub fn read(file: &SentFile, rows: &[String], progress: &dyn Progress) -> Result<Self> {
        let (bytes, max_bytes) = (file.bytes, file.max_bytes);
        let name = free_name(&plain_name(file.name), &[file.taken, rows].concat());
        let too_large = |n_bytes: u64| {
            let (found, limit) = (readable(n_bytes), readable(max_bytes));
            Error::invalid_request(format!(
                "{name}: needs {found} of memory, expected at most {limit}"
            ))
        };
        let n_stated = stated_bytes(&name, bytes)?;
        if max_bytes < n_stated {
            return Err(too_large(n_stated));
        }
        progress.begin(&format!("read {name}"), 0);
        let log = ProgressLog::new(progress);
        let options = LoadOptions { columns: ColumnChoice::All, ..LoadOptions::default() };
        let loaded = surfel_formats::load_graph_bytes(&name, bytes, &options, &log);
        let (mut graph, mut info) = loaded.map_err(surfel::Error::from).map_err(rejection)?;
        progress.end();
        let mut notes = log.into_records().into_lines();
        if !graph.animation.channels.is_empty() {
            graph.animation = Animation::default();
            notes.push(format!("{name}: is shown as it is at the start; added files do not move"));
        }
        let (n_points, n_triangles) = graph.n_points_and_triangles();
        if n_points + n_triangles == 0 {
            return Err(Error::invalid_request(format!(
                "{name}: has neither points nor triangles"
            )));
        }
        info.n_points = Some(n_points as u64);
        info.n_triangles = (0 < n_triangles).then_some(n_triangles as u64);
        let n_bytes = n_bytes_of(&graph);
        if max_bytes < n_bytes {
            return Err(too_large(n_bytes));
        }
        Ok(Self {
            id: file.id.to_owned(),
            name,
            content: Arc::new(FileContent { graph, info }),
            notes,
            n_bytes,
        })
    }

    /// The path by which a description names the file.
    fn path(&self) -> PathBuf {
        PathBuf::from(format!("{FOLDER}{}/{}", self.id, self.name))
    }

    /// Adds the file to a description, as its last object.
    pub fn add_to(&self, description: &mut SceneDescription) {
        let mut object = ObjectDescription::new(self.path());
        object.name = Some(self.name.clone());
        let clouds = || self.content.graph.geometries.iter().filter_map(cloud_of);
        let color = description.objects_default.color.color.as_ref();
        let lacks_color = |cloud| color.is_some_and(|color| !can_be_colored(cloud, color));
        if clouds().any(lacks_color)
            && let Some(cloud) = clouds().next()
        {
            object.settings.color.color = Some(choose_source(cloud).0);
        }
        description.objects.push(object);
        description.memory.insert(self.path(), MemoryContent::File(self.content.clone()));
    }
}

impl AddedFile for PageFile {
    fn name(&self) -> &str {
        &self.name
    }

    fn description(&self) -> Value {
        let graph = &self.content.graph;
        let (n_points, n_triangles) = graph.n_points_and_triangles();
        json!({
            "name": self.name,
            "kind": if 0 < n_triangles { "triangles" } else { "points" },
            "points": n_points,
            "triangles": n_triangles,
            "notes": self.notes,
            "visible": true,
            "color": Value::Null,
            "bounds": bounds_json(&graph.sample_points()),
        })
    }

    fn n_bytes(&self) -> u64 {
        self.n_bytes
    }
}

/// Returns the number of bytes that a file's points take at least, as the file states them.
///
/// # Errors
///
/// Fails if the bytes are of no known format or broken.
pub fn stated_bytes(name: &str, bytes: &[u8]) -> Result<u64> {
    let stated = surfel_formats::inspect_bytes(name, bytes).map_err(surfel::Error::from);
    Ok(stated.map_err(rejection)?.n_points.unwrap_or(0).saturating_mul(POINT_BYTES))
}

/// Returns true if a description shows the object because a page has added it.
pub fn is_added(object: &ObjectDescription) -> bool {
    object.files.iter().any(|file| file.to_string_lossy().starts_with(FOLDER))
}

/// Returns the words of a command line that name the added files of a description, which lie where the command runs, and
/// give them their colours where those of the scene are missing.
pub fn words(description: &SceneDescription) -> Vec<String> {
    let settings = description.overrides.all();
    let added = description.objects.iter().filter(|object| is_added(object));
    let words = added.flat_map(|object| {
        let name = object.name();
        let has_own = settings.iter().any(|one| one.target == name && one.key == "color");
        let color = object.settings.color.color.as_ref().filter(|_| !has_own);
        let color = color.map(|color| format!("--object-settings={name}:color={color}"));
        std::iter::once(name).chain(color)
    });
    words.collect()
}

/// Returns the text of a scene file in which added files lie in the folder of the file.
pub fn with_relative_paths(text: &str) -> String {
    let folder = absolute_text(Path::new(FOLDER));
    // JSON and TOML escape backslashes.
    let escaped = folder.replace('\\', r"\\");
    without_ids(&text.replace(&folder, FOLDER).replace(&escaped, FOLDER))
}

/// Returns a text in which added files are named without their ids.
pub fn without_ids(text: &str) -> String {
    let mut rest = text;
    let mut kept = String::new();
    while let Some(at) = rest.find(FOLDER) {
        let (before, after) = rest.split_at(at);
        kept += before;
        let id = after[FOLDER.len()..].split('/').next().unwrap_or_default();
        let is_id = id.len() == ID_LENGTH && id.bytes().all(|byte| byte.is_ascii_hexdigit());
        let n_left_out = if is_id { FOLDER.len() + id.len() + 1 } else { 0 };
        let n_taken = n_left_out.max(FOLDER.len()).min(after.len());
        if !is_id {
            kept += &after[..n_taken];
        }
        rest = &after[n_taken..];
    }
    kept + rest
}

/// The last part of a path of any system, without signs that lists of settings separate by.
fn plain_name(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let is_plain = |letter: char| !letter.is_control() && !":=,;".contains(letter);
    let name: String = last.chars().map(|sign| if is_plain(sign) { sign } else { '_' }).collect();
    if name.trim_matches('.').is_empty() { "file".to_owned() } else { name }
}

fn cloud_of(geometry: &Geometry<PointCloud>) -> Option<&PointCloud> {
    match geometry {
        Geometry::Points(cloud) => Some(cloud),
        Geometry::Triangles(_) => None,
    }
}

/// Number of bytes of memory of what was read.
fn n_bytes_of(graph: &Graph<PointCloud>) -> u64 {
    let geometries = graph.geometries.iter().map(|geometry| match geometry {
        Geometry::Points(cloud) => cloud_bytes(cloud),
        Geometry::Triangles(mesh) => mesh_bytes(mesh),
    });
    let textures = graph.textures.iter().map(|texture| size_of_val(&texture.texels[..]));
    let primitives = graph.nodes.iter().map(|node| size_of_val(&node.primitives[..]));
    let nodes = size_of_val(&graph.nodes[..]);
    geometries.chain(textures).chain(primitives).chain([nodes]).sum::<usize>() as u64
}

fn cloud_bytes(cloud: &PointCloud) -> usize {
    let scalars = cloud.scalars.iter().map(|scalar| match &scalar.values {
        Values::U8(values) => size_of_val(&values[..]),
        Values::U16(values) => size_of_val(&values[..]),
        Values::I32(values) => size_of_val(&values[..]),
        Values::F32(values) => size_of_val(&values[..]),
        Values::F64(values) => size_of_val(&values[..]),
    });
    size_of_val(&cloud.positions[..])
        + column_bytes(&cloud.normals)
        + column_bytes(&cloud.radii)
        + column_bytes(&cloud.colors)
        + column_bytes(&cloud.intensity)
        + column_bytes(&cloud.classification)
        + scalars.sum::<usize>()
        + deformation_bytes(&cloud.morphs, cloud.skin.as_ref())
}

fn mesh_bytes(mesh: &Mesh) -> usize {
    size_of_val(&mesh.positions[..])
        + size_of_val(&mesh.triangles[..])
        + column_bytes(&mesh.normals)
        + column_bytes(&mesh.tangents)
        + column_bytes(&mesh.colors)
        + mesh.uvs.iter().map(column_bytes).sum::<usize>()
        + deformation_bytes(&mesh.morphs, mesh.skin.as_ref())
}

fn deformation_bytes(morphs: &[Morph], skin: Option<&Skin>) -> usize {
    let of_morph = |morph: &Morph| {
        size_of_val(&morph.positions[..])
            + column_bytes(&morph.normals)
            + column_bytes(&morph.tangents)
            + column_bytes(&morph.radii)
    };
    let of_skin = |skin: &Skin| size_of_val(&skin.joints[..]) + size_of_val(&skin.weights[..]);
    morphs.iter().map(of_morph).sum::<usize>() + skin.map_or(0, of_skin)
}

fn column_bytes<T>(column: &Option<Vec<T>>) -> usize {
    column.as_ref().map_or(0, |column| size_of_val(&column[..]))
}

#[cfg(test)]
mod tests {
    //! Names of added files, and files that are refused.

    use super::*;
    use surfel_core::progress::NoProgress;

    fn read(name: &str, bytes: &[u8], taken: &[&str]) -> Result<PageFile> {
        let taken: Vec<String> = taken.iter().map(|name| (*name).to_owned()).collect();
        let file = SentFile { id: "1", name, bytes, taken: &taken, max_bytes: 1 << 20 };
        PageFile::read(&file, &[], &NoProgress)
    }

    const TRIANGLE: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn names_are_plain_and_free() {
        for (name, taken, expected) in [
            ("a.xyz", &[][..], "a.xyz"),
            ("C:\\scans\\a.xyz", &["b.xyz"], "a.xyz"),
            ("../../etc/a.xyz", &["a.xyz"], "a (2).xyz"),
            ("a.xyz", &["a", "a (2).xyz"], "a (3).xyz"),
            ("a:color=rgb,x.xyz", &[], "a_color_rgb_x.xyz"),
            ("a\u{0}\n.xyz", &[], "a__.xyz"),
        ] {
            assert_eq!(read(name, b"0 0 0\n1 1 1\n", taken).unwrap().name, expected);
        }
        assert_eq!((plain_name(".."), plain_name("/")), ("file".into(), "file".into()));
    }

    #[test]
    fn clouds_and_meshes_are_described() {
        let mesh = read("a.obj", TRIANGLE, &[]).unwrap().description();
        assert_eq!((&mesh["kind"], &mesh["triangles"]), (&json!("triangles"), &json!(1)));
        let cloud = read("a.xyz", b"500000 0 0\n500002 1 3\n", &[]).unwrap();
        assert!(24 <= cloud.n_bytes());
        let cloud = cloud.description();
        assert_eq!((&cloud["kind"], &cloud["points"]), (&json!("points"), &json!(2)));
        assert_eq!(cloud["bounds"]["min"], json!([500000.0, 0.0, 0.0]));
    }

    #[test]
    fn broken_and_large_files_are_refused_by_their_names() {
        let large = "1 2 3\n".repeat(100_000);
        let vast = b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        for (name, bytes) in [
            ("a.xyz", &b""[..]),
            ("a.xyz", b"not a number\n"),
            ("a.laz", b"LASF but nothing else"),
            ("a.what", b"some words"),
            ("a.zip", b"PK\x03\x04"),
            ("a.obj", b"v 0 0 0\nf 1 2 3\n"),
            ("a.gltf", b"{}"),
            ("a.ply", vast),
            ("a.xyz", large.as_bytes()),
        ] {
            let Err(error) = read(name, bytes, &[]) else { panic!("{name} was read") };
            assert!(error.to_string().contains(name), "{error}");
        }
    }

    #[test]
    fn settings_list_files_that_are_kept() {
        let files = AddedFiles::default();
        let settings = |ids: Value| SettingsMap::from_iter([(KEY.to_owned(), ids)]);
        let file = files.insert(read("a.obj", TRIANGLE, &[]).unwrap());
        let id = file.id.clone();
        assert_eq!(files.listed(&settings(json!([id]))).unwrap().len(), 1);
        assert_eq!(files.listed(&SettingsMap::new()).unwrap().len(), 0);
        for wrong in [json!([id, id]), json!(["0"]), json!([7]), json!(id)] {
            assert!(files.listed(&settings(wrong)).is_err());
        }
        drop(file);
        assert!(files.listed(&settings(json!([id]))).is_err());
    }

    #[test]
    fn texts_name_added_files_without_ids() {
        let id = "0123456789abcdef0123456789abcdef";
        let text = format!("added-{id}/a.xyz and added-{id}/b.xyz: no; added-on stays, added-");
        assert_eq!(without_ids(&text), "a.xyz and b.xyz: no; added-on stays, added-");
    }
}

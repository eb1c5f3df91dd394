//! glTF 2.0 reader: scenes as `.gltf` with external files or as a single `.glb`.
//!
//! The JSON is read into a tree of values (`json`) in which every access is checked and every error names its
//! JSON pointer. `accessor` reads numbers from the buffers of `document`; `primitive` builds geometry from
//! them with `attributes` and `triangulate`, `mesh` adds materials, `node` and `hierarchy` build the scene
//! graph.

mod json;
mod container;
mod uri;
mod document;
mod accessor;
mod extensions;
mod texture;
mod point_cloud;
mod filter;
mod inspect;
mod material;
mod triangulate;
mod attributes;
mod primitive;
mod mesh;
mod transform;
mod hierarchy;
mod instancing;
mod node;
mod animation;

pub(crate) use filter::filter_points;
pub(crate) use inspect::inspect;
pub(crate) use point_cloud::merge_points;

use std::path::Path;

use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::Graph;

use self::document::{Document, load_buffers};
use self::hierarchy::Hierarchy;
use self::json::Json;
use self::mesh::MeshCache;
use self::texture::TextureCache;
use crate::error::Result;
use crate::file::{Input, ResourceResolver};
use crate::options::FileInfo;

/// Reads the default scene of a glTF file. A root node rotates it from Y up to Z up.
///
/// The returned graph is valid: its indices exist, columns have equal lengths, positions are finite, and
/// parents come before their children. Unsupported content (lines, unknown extensions) and local defects (a
/// missing or malformed image, vertices that are not finite, normals of length zero) are reported through
/// `progress.note` and skipped. Nodes with a singular transform are kept but invisible. The first animation
/// is read.
///
/// Point clouds store their colours sRGB-encoded. They are not prepared.
///
/// # Errors
///
/// Fails if a file cannot be read, if the file is malformed or requires an unsupported extension, or if
/// `progress` cancels.
pub fn load_gltf(path: &Path, progress: &dyn Progress) -> Result<(Graph<PointCloud>, FileInfo)> {
    read(&Input::open(path)?, ResourceResolver::for_file(path), None, progress)
}

/// Detects glTF by the first bytes or the extension.
pub(crate) fn is_gltf(input: &Input) -> bool {
    input.starts_with(b"glTF") || ["gltf", "glb"].contains(&input.extension().as_str())
}

/// Reads the bytes of a self-contained glTF file. Messages call the file `name`.
///
/// # Errors
///
/// Fails like [`load_gltf`], and if the file refers to buffers in other files.
pub fn load_gltf_bytes(
    name: &str,
    bytes: &[u8],
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    read(&Input::from_bytes(name, bytes), ResourceResolver::none(), None, progress)
}

/// Reads a glTF file with the animation named `animation`, or the first one.
pub(crate) fn read(
    input: &Input,
    resolver: ResourceResolver,
    animation: Option<&str>,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    progress.check()?;
    let container = container::open(input)?;
    let root = Json::root(&input.name, &container.json);
    container::check_version(&root)?;
    let buffers = load_buffers(&root, container.bin_chunk, &resolver)?;
    let document = Document::new(root, &buffers, input.len(), &resolver, progress);
    extensions::check(&document)?;
    let (graph, columns) = read_graph(&document, animation)?;
    document.flush_warnings();
    let (n_points, n_triangles) = graph.n_points_and_triangles();
    let info = FileInfo {
        format: container.format_name(),
        is_in_metres: true,
        external_files: resolver.into_requested(),
        n_points: (0 < n_points).then_some(n_points as u64),
        n_triangles: (0 < n_triangles).then_some(n_triangles as u64),
        columns,
        ..FileInfo::default()
    };
    Ok((graph, info))
}

/// Returns the graph and the names of its vertex attributes.
fn read_graph(
    document: &Document,
    animation: Option<&str>,
) -> Result<(Graph<PointCloud>, Vec<String>)> {
    let n_meshes = document.root.array_or_empty("meshes")?.len();
    document.progress.begin(&format!("read {}", document.root.file()), n_meshes as u64);
    let hierarchy = Hierarchy::read(document)?;
    let mut textures = TextureCache::new(document);
    let materials = material::read_all(document, &mut textures)?;
    let mut meshes = MeshCache::new(document, materials);
    let name = Path::new(document.root.file()).file_stem().unwrap_or_default().to_string_lossy();
    let nodes = node::read_all(document, &hierarchy, &mut meshes, name.into_owned())?;
    let animation = animation::read(document, &hierarchy, &nodes, animation)?;
    let MeshCache { geometries, materials, .. } = meshes;
    let mut graph =
        Graph { geometries: geometries.all, materials, textures: textures.all, nodes, animation };
    transform::check_all(document, &hierarchy, &mut graph)?;
    if cfg!(debug_assertions) {
        graph.validate();
    }
    Ok((graph, geometries.attribute_names.into_iter().collect()))
}

//! glTF 2.0: whole scenes, as `.gltf` with other files beside it or as one `.glb`.
//!
//! The JSON is read to a tree of values (`json`), in which every step is checked and every error names its
//! place. `accessor` reads numbers from `document`'s buffers; `primitive` makes geometry of them with
//! `attributes` and `triangles`, `mesh` gives it materials, `node` and `hierarchy` put it in its place.

mod json;
mod container;
mod uri;
mod document;
mod accessor;
mod extensions;
mod picture;
mod points;
mod inspect;
mod material;
mod triangles;
mod attributes;
mod primitive;
mod mesh;
mod transform;
mod hierarchy;
mod instancing;
mod node;
mod animation;

pub(crate) use inspect::inspect;
pub(crate) use points::points_of;

use std::path::Path;

use surfel::progress::Progress;
use surfel::scene::Graph;

use self::container::Container;
use self::document::{Document, load_buffers};
use self::hierarchy::Hierarchy;
use self::json::Json;
use self::mesh::Meshes;
use self::picture::Pictures;
use crate::beside::Beside;
use crate::error::{Error, Result};
use crate::input::Input;
use crate::options::Source;

/// Reads the scene that a glTF file shows first, below a node that turns it upright (Z up).
///
/// The graph has indices that are there, columns of equal length, finite positions, and parents before their
/// children. What surfel does not draw (lines, unknown extensions), and what is wrong in places (a missing or
/// broken picture, corners that are not finite, normals without direction) is told by `progress.note`, and
/// the rest is read. All else that is wrong is an error. Nodes that are scaled to nothing, or flat, are there
/// but not visible. Of several animations the first is taken.
///
/// Points have their colours in the cloud, sRGB-encoded; they are neither prepared nor otherwise coloured.
pub fn load_gltf(path: &Path, progress: &dyn Progress) -> Result<(Graph, Source)> {
    read(&Input::open(path)?, Beside::file(path), None, progress)
}

/// By the first bytes or the extension.
pub(crate) fn is_gltf(input: &Input) -> bool {
    input.starts_with(b"glTF") || ["gltf", "glb"].contains(&input.extension().as_str())
}

/// Reads the bytes of a glTF file that has all its data inside; `name` stands in messages.
pub fn load_gltf_bytes(
    name: &str,
    bytes: &[u8],
    progress: &dyn Progress,
) -> Result<(Graph, Source)> {
    read(&Input::of_bytes(name, bytes), Beside::nowhere(), None, progress)
}

/// The animation is that of the name `wanted`, or the first.
pub(crate) fn read(
    input: &Input,
    beside: Beside,
    wanted: Option<&str>,
    progress: &dyn Progress,
) -> Result<(Graph, Source)> {
    progress.check()?;
    let container = container::open(input)?;
    let root = Json::root(&input.name, &container.json);
    check_version(&root)?;
    let buffers = load_buffers(&root, container.chunk, &beside)?;
    let document = Document::new(root, &buffers, input.len(), &beside, progress);
    extensions::check(&document)?;
    let (graph, columns) = read_graph(&document, wanted)?;
    document.tell_notes();
    let (n_points, n_triangles) = graph.counts();
    let source = Source {
        format: format_name(&container),
        beside: beside.into_wanted(),
        n_points: (0 < n_points).then_some(n_points as u64),
        n_triangles: (0 < n_triangles).then_some(n_triangles as u64),
        columns,
        ..Source::default()
    };
    Ok((graph, source))
}

/// The graph and the names of the attributes in it.
fn read_graph(document: &Document, wanted: Option<&str>) -> Result<(Graph, Vec<String>)> {
    let n_meshes = document.root.list("meshes")?.len();
    document.progress.begin(&format!("read {}", document.root.file()), n_meshes as u64);
    let hierarchy = Hierarchy::read(document)?;
    let mut pictures = Pictures::new(document);
    let materials = material::read_all(document, &mut pictures)?;
    let mut meshes = Meshes::new(document, materials);
    let name = Path::new(document.root.file()).file_stem().unwrap_or_default().to_string_lossy();
    let nodes = node::read_all(document, &hierarchy, &mut meshes, name.into_owned())?;
    let animation = animation::read(document, &hierarchy, &nodes, wanted)?;
    let Meshes { primitives, materials, .. } = meshes;
    let mut graph = Graph {
        geometries: primitives.geometries,
        materials,
        textures: pictures.textures,
        nodes,
        animation,
    };
    transform::check(document, &hierarchy, &mut graph)?;
    if cfg!(debug_assertions) {
        graph.validate();
    }
    Ok((graph, primitives.columns.into_iter().collect()))
}

fn format_name(container: &Container) -> String {
    if container.is_binary { "glTF 2.0, binary" } else { "glTF 2.0" }.into()
}

fn check_version(root: &Json) -> Result<()> {
    let asset = root.need("asset")?;
    let version = asset.need("version")?;
    let needed = asset.get("minVersion");
    let is_2 = version.text()?.starts_with("2.");
    let is_enough = needed.as_ref().map_or(Ok("2.0"), Json::text)? == "2.0";
    if is_2 && is_enough {
        return Ok(());
    }
    let found = needed.filter(|_| is_2).unwrap_or(version).text()?;
    Err(Error::Unsupported {
        file: root.file().into(),
        action: "read",
        found: format!("glTF {}", json::shortened(found)),
        advice: "convert it to glTF 2.0",
    })
}

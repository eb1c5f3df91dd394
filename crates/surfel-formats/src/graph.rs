//! Files as graphs of scenes: meshes as triangles, clouds as points.

use std::path::Path;

use surfel::progress::Progress;
use surfel::scene::{Geometry, Graph, Material, Node, Part, Points, Texture};

use crate::beside::Beside;
use crate::error::Result;
use crate::input::Input;
use crate::load::{Format, format_of, read as read_points};
use crate::options::{LoadOptions, Loaded, Source};
use crate::{gltf, obj, ply, stl};

/// Reads a file to a graph: triangles with their materials if it has some, its points if not.
///
/// Geometry stands under one node, named after the file. Points are as they stand in the file, not
/// prepared and without `Points::colors`. Of `options`, the columns are a matter of points only.
pub fn load_graph(
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph, Source)> {
    let input = Input::open(path)?;
    if gltf::is_gltf(&input) {
        return gltf::read(&input, Beside::file(path), options.animation.as_deref(), progress);
    }
    read(&input, Beside::file(path), options, progress)
}

/// Whether [`load_graph`] reads nothing but points from a file, which become one cloud in its place.
pub fn is_cloud(path: &Path) -> Result<bool> {
    let input = Input::open(path)?;
    Ok(!gltf::is_gltf(&input) && !has_triangles(&input)?)
}

/// Whether a file holds a whole scene, with places and movement of its own, rather than one cloud or mesh in
/// its place.
pub fn is_scene(path: &Path) -> Result<bool> {
    Ok(gltf::is_gltf(&Input::open(path)?))
}

/// Reads the bytes of a file to a graph; `name` stands in messages, and its extension counts.
///
/// Files that these name, such as materials and textures, are not read; `progress` is told so.
pub fn load_graph_bytes(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph, Source)> {
    let input = Input::of_bytes(name, bytes);
    if gltf::is_gltf(&input) {
        return gltf::read(&input, Beside::nowhere(), options.animation.as_deref(), progress);
    }
    read(&input, Beside::nowhere(), options, progress)
}

fn read(
    input: &Input,
    beside: Beside,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph, Source)> {
    progress.check()?;
    if !has_triangles(input)? {
        let Loaded { cloud, source } = read_points(input, options, progress)?;
        let points = Geometry::Points(Points { cloud, ..Points::default() });
        return Ok((graph_of(input, vec![(points, Material::MATTE)], Vec::new()), source));
    }
    let (model, mut source) = match format_of(input)? {
        Format::Ply => ply::read_mesh(input, &beside, options, progress)?,
        Format::Obj => obj::read_mesh(input, &beside, options, progress)?,
        _ => stl::read_mesh(input, options, progress)?,
    };
    source.beside = beside.into_wanted();
    let parts = model.parts.into_iter();
    let parts = parts.map(|(mesh, material)| (Geometry::Triangles(mesh), material)).collect();
    Ok((graph_of(input, parts, model.textures), source))
}

fn has_triangles(input: &Input) -> Result<bool> {
    Ok(match format_of(input)? {
        Format::Ply => ply::has_faces(input)?,
        Format::Obj => obj::has_faces(input),
        Format::Stl => true,
        Format::Las | Format::Text | Format::Bin => false,
    })
}

/// All parts under one node, each with a material of its own.
fn graph_of(input: &Input, parts: Vec<(Geometry, Material)>, textures: Vec<Texture>) -> Graph {
    let name = Path::new(input.name.as_ref()).file_stem().unwrap_or_default();
    let part = |i| Part { geometry: i, material: i };
    let node =
        Node { parts: (0..parts.len()).map(part).collect(), ..Node::new(name.to_string_lossy()) };
    let (geometries, materials) = parts.into_iter().unzip();
    Graph { geometries, materials, textures, nodes: vec![node], ..Graph::default() }
}

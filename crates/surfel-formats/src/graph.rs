//! Reads files as scene graphs: meshes as triangles, clouds as points.

use std::path::Path;

use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Geometry, Graph, Material, Node, Primitive, Texture};

use crate::error::{Error, Result};
use crate::file::{Input, ResourceResolver};
use crate::filtered::read_filtered;
use crate::format::{self, Reader, detect};
use crate::gltf;
use crate::options::{FileInfo, LoadOptions, Loaded};

/// Reads a file to a scene graph: a glTF scene as it is, else triangles with their materials if the file has any, else
/// its points.
///
/// Clouds and meshes belong to one node, which has the name of the file. Points are those of the file, not
/// prepared. The columns and the filter of `options` apply to points only.
///
/// # Errors
///
/// Fails if the file cannot be read, if its format is not supported or broken, if it does not fit in memory, or if the
/// work is cancelled. Missing materials and textures are notes of `progress`.
pub fn load_graph(
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    read(&Input::open(path)?, ResourceResolver::for_file(path), options, progress)
}

/// Returns true if a file holds a scene with transforms and animation, rather than one cloud or mesh.
///
/// # Errors
///
/// Fails if the file cannot be read.
pub fn is_scene(path: &Path) -> Result<bool> {
    Ok(format::is_scene(&Input::open(path)?))
}

/// Reads the bytes of a file to a scene graph. `name` is its name in messages, and its extension gives the format of
/// bytes without a signature.
///
/// Materials and textures in further files are not read; `progress` gets a note of them.
///
/// # Errors
///
/// Fails for the reasons of [`load_graph`], and if a glTF scene has buffers in further files.
pub fn load_graph_bytes(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    read(&Input::from_bytes(name, bytes), ResourceResolver::none(), options, progress)
}

fn read(
    input: &Input,
    resolver: ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    progress.check()?;
    let read_points = match &detect(input)?.read {
        Reader::Scene(read) => {
            let scene = read(input, resolver, options.animation.as_deref(), progress)?;
            return gltf::filter_points(input, scene, options, progress);
        }
        Reader::Mesh { has_triangles, read_points, read_mesh } if has_triangles(input)? => {
            match read_mesh(input, &resolver, options, progress) {
                // Without all of its vertices a mesh has no faces; what is whole of it are points.
                Err(Error::Truncated { .. }) if options.salvage => read_points,
                read => {
                    let (model, mut info) = read?;
                    info.external_files = resolver.into_requested();
                    let parts = model.parts.into_iter();
                    let parts = parts.map(|(mesh, material)| (Geometry::Triangles(mesh), material));
                    return Ok((graph_of(input, parts.collect(), model.textures), info));
                }
            }
        }
        Reader::Points(read_points) | Reader::Mesh { read_points, .. } => read_points,
    };
    let Loaded { cloud, info } = read_filtered(*read_points, input, options, progress)?;
    let points = Geometry::Points(cloud);
    Ok((graph_of(input, vec![(points, Material::MATTE)], Vec::new()), info))
}

/// Returns a graph of one node that has all geometries, each with its material.
fn graph_of(
    input: &Input,
    parts: Vec<(Geometry<PointCloud>, Material)>,
    textures: Vec<Texture>,
) -> Graph<PointCloud> {
    let name = Path::new(input.name.as_ref()).file_stem().unwrap_or_default();
    let part = |i| Primitive { geometry: i, material: i };
    let node = Node {
        primitives: (0..parts.len()).map(part).collect(),
        ..Node::new(name.to_string_lossy())
    };
    let (geometries, materials) = parts.into_iter().unzip();
    Graph { geometries, materials, textures, nodes: vec![node], ..Graph::default() }
}

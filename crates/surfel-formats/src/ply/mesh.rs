//! Reads the meshes of PLY files: vertices with normals, colours and texture coordinates, and their faces.

use surfel_core::math::Vec2;
use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::{Material, Mesh, TextureRef};

use super::faces::{count_faces, read_faces};
use super::header::read_header;
use super::read::{file_info, find_vertex, read_cloud};
use crate::error::{Location, Result};
use crate::file::{Input, ResourceResolver};
use crate::mesh::{Model, TextureLoader, linear_colors, repair_model, weld};
use crate::options::{FileInfo, LoadOptions};
use crate::salvage::Salvage;
use crate::table::{Column, ColumnChoice};

/// Names of texture coordinates, as Blender and MeshLab write them.
const UV_NAMES: [[&str; 2]; 4] =
    [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// Returns true if the header announces faces.
pub(crate) fn has_faces(input: &Input) -> Result<bool> {
    Ok(0 < count_faces(&read_header(input)?))
}

/// Reads the faces as a mesh of triangles.
pub(crate) fn read_mesh(
    input: &Input,
    resolver: &ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, FileInfo)> {
    let header = read_header(input)?;
    let (_, vertex) = find_vertex(input, &header)?;
    if vertex.count > u64::from(u32::MAX) {
        let found = format!("{} vertices", vertex.count);
        return Err(input.unsupported(found, "cut the mesh into several files"));
    }
    let scalars = ["alpha"].into_iter().chain(UV_NAMES.into_iter().flatten());
    let columns = scalars.map(|name| Column::Scalar(name.into()));
    let columns = columns.chain([Column::Normals, Column::Colors]).collect();
    // Faces name vertices by their places, so all are read.
    let columns = ColumnChoice::Only(columns);
    let options = LoadOptions { columns, filter: None, ..options.clone() };
    let mut salvage = Salvage::new(input, options.salvage);
    let (cloud, n_vertices) = read_cloud(&mut salvage, &header, &options, progress)?;
    if n_vertices < vertex.count {
        return Err(vertex.truncated(input, n_vertices));
    }
    let faces = read_faces(&mut salvage, &header, vertex.count, progress)?;
    salvage.report("face", faces.n_read, Some(count_faces(&header)), progress)?;
    let mut mesh = Mesh {
        origin: cloud.origin,
        uvs: [uvs(&cloud), None],
        colors: linear_colors(&cloud),
        triangles: faces.triangles,
        positions: cloud.positions,
        normals: cloud.normals,
        ..Mesh::default()
    };
    // Elements of faces without texture coordinates leave too few for all triangles.
    if !faces.uvs.is_empty() && faces.uvs.len() == mesh.triangles.len() {
        if u32::MAX as usize / 3 <= faces.uvs.len() {
            let found = format!("{} triangles", faces.uvs.len());
            return Err(input.unsupported(found, "cut the mesh into several files"));
        }
        mesh = with_corner_uvs(&mesh, &faces.uvs);
    }
    let mut textures = TextureLoader::new(resolver);
    let mut material = Material::MATTE;
    if let (Some(_), [name, others @ ..]) = (&mesh.uvs[0], header.textures.as_slice()) {
        material.textures.base_color = textures.load(name).map(TextureRef::new);
        if !others.is_empty() {
            let n_textures = header.textures.len();
            progress.note(&format!(
                "{}: the first of {n_textures} textures is used for all faces",
                input.name
            ));
        }
    }
    textures.missing.report("a texture is left out", progress);
    let model = Model { parts: vec![(mesh, material)], textures: textures.textures };
    let location = faces.location.unwrap_or(Location::Byte(header.body as u64));
    let (model, n_triangles) = repair_model(input, model, faces.n_short, location, progress)?;
    Ok((model, FileInfo { n_triangles: Some(n_triangles), ..file_info(&header, vertex) }))
}

/// Returns the mesh with a vertex for each pair of a vertex and its texture coordinates.
fn with_corner_uvs(mesh: &Mesh, uvs: &[[Vec2; 3]]) -> Mesh {
    let (vertices, uvs) = (mesh.triangles.as_flattened(), uvs.as_flattened());
    let key = |(vertex, uv): (&u32, &Vec2)| [*vertex, uv.x.to_bits(), uv.y.to_bits()];
    let welded = weld(&vertices.iter().zip(uvs).map(key).collect::<Vec<_>>());
    let corners = || welded.first_corners.iter().map(|corner| *corner as usize);
    fn gather<T: Copy>(column: &[T], vertices: impl Iterator<Item = u32>) -> Vec<T> {
        vertices.map(|vertex| column[vertex as usize]).collect()
    }
    let vertices = || corners().map(|corner| vertices[corner]);
    Mesh {
        origin: mesh.origin,
        positions: gather(&mesh.positions, vertices()),
        normals: mesh.normals.as_ref().map(|normals| gather(normals, vertices())),
        colors: mesh.colors.as_ref().map(|colors| gather(colors, vertices())),
        uvs: [Some(corners().map(|corner| flip_v(uvs[corner])).collect()), None],
        triangles: welded.vertex_of_corner.as_chunks().0.to_vec(),
        ..Mesh::default()
    }
}

/// Flips v, which points up in the file and down in a texture.
fn flip_v(uv: Vec2) -> Vec2 {
    Vec2::new(uv.x, 1.0 - uv.y)
}

/// Returns the texture coordinates of the vertices, if the file has them.
fn uvs(cloud: &PointCloud) -> Option<Vec<Vec2>> {
    UV_NAMES.iter().find_map(|[u, v]| {
        let (u, v) = (cloud.scalar(u)?, cloud.scalar(v)?);
        let uv = |i| flip_v(Vec2::new(u.get(i) as f32, v.get(i) as f32));
        Some((0..cloud.len()).map(uv).collect())
    })
}

//! Meshes of PLY files: vertices with normals, colours and texture coordinates, and their faces.

use surfel::image::{decode_srgb, decode_srgb8};
use surfel::math::{Vec2, Vec4};
use surfel::points::{PointCloud, Values};
use surfel::progress::Progress;
use surfel::scene::{Material, Mesh, TextureRef};

use super::faces::{count_faces, read_faces};
use super::header::read_header;
use super::read::{find_vertex, read_cloud, source};
use crate::beside::{Beside, Textures};
use crate::error::{Place, Result};
use crate::input::Input;
use crate::mesh::{Model, finish};
use crate::options::{Column, ColumnChoice, LoadOptions, Source};

/// Names of texture coordinates, as Blender and MeshLab write them.
const UV_NAMES: [[&str; 2]; 4] =
    [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

pub(crate) fn has_faces(input: &Input) -> Result<bool> {
    Ok(0 < count_faces(&read_header(input)?))
}

pub(crate) fn read_mesh(
    input: &Input,
    beside: &Beside,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, Source)> {
    let header = read_header(input)?;
    let (_, vertex) = find_vertex(input, &header)?;
    if vertex.count > u64::from(u32::MAX) {
        let found = format!("{} vertices", vertex.count);
        return Err(input.unsupported(found, "cut the mesh into several files"));
    }
    let scalars = ["alpha"].into_iter().chain(UV_NAMES.into_iter().flatten());
    let columns = scalars.map(|name| Column::Scalar(name.into()));
    let columns = columns.chain([Column::Normals, Column::Colors]).collect();
    let options = LoadOptions { columns: ColumnChoice::Only(columns), ..options.clone() };
    let cloud = read_cloud(input, &header, &options, progress)?;
    let faces = read_faces(input, &header, vertex.count, progress)?;
    let mesh = Mesh {
        origin: cloud.origin,
        uvs: [uvs(&cloud), None],
        colors: linear_colors(&cloud),
        triangles: faces.triangles,
        positions: cloud.positions,
        normals: cloud.normals,
        ..Mesh::default()
    };
    let mut textures = Textures::new(beside);
    let mut material = Material::MATTE;
    if let (Some(_), Some(name)) = (&mesh.uvs[0], &header.texture) {
        material.textures.base_color = textures.read(name).map(TextureRef::new);
    }
    textures.missing.tell("a texture is left out", progress);
    let model = Model { parts: vec![(mesh, material)], textures: textures.all };
    let place = faces.place.unwrap_or(Place::Byte(header.body as u64));
    let (model, n_triangles) = finish(input, model, faces.n_short, place, progress)?;
    Ok((model, Source { n_triangles: Some(n_triangles), ..source(&header, vertex) }))
}

/// Texture coordinates with v down; in the file it goes up.
fn uvs(cloud: &PointCloud) -> Option<Vec<Vec2>> {
    UV_NAMES.iter().find_map(|[u, v]| {
        let (u, v) = (cloud.scalar(u)?, cloud.scalar(v)?);
        let uv = |i| Vec2::new(u.get(i) as f32, (1.0 - v.get(i)) as f32);
        Some((0..cloud.len()).map(uv).collect())
    })
}

fn linear_colors(cloud: &PointCloud) -> Option<Vec<Vec4>> {
    let colors = cloud.colors.as_ref()?;
    let alpha = cloud.scalar("alpha");
    let linear = |channel: u16| match (channel / 257, channel % 257) {
        // Most files have 8 bits, which are looked up.
        (byte, 0) => decode_srgb8(byte as u8),
        _ => decode_srgb(f32::from(channel) / 65535.0),
    };
    let color = |(i, color): (usize, &[u16; 3])| {
        let [red, green, blue] = color.map(linear);
        let alpha = alpha.map_or(1.0, |alpha: &Values| alpha.get(i).clamp(0.0, 1.0) as f32);
        Vec4::new(red, green, blue, alpha)
    };
    Some(colors.iter().enumerate().map(color).collect())
}

//! Blocks of triangles with the attributes of their vertices, in the order in which kernels read them.

use crate::numbers::attribute;
use surfel_core::bvh::NO_PRIMITIVE;
use surfel_core::flat::{FlatMesh, TriangleBlock};
use surfel_core::math::{LANES, Vec4};

/// Words of a component of the three corners of eight triangles.
const COMPONENT_WORDS: usize = 3 * LANES;
/// Words in a vector.
const WORDS_PER_VECTOR: usize = 4;

/// A column of the vertices of a mesh.
struct Column<'a> {
    /// Its bit among the attributes.
    attribute: u32,
    is_present: bool,
    n_components: usize,
    value: Box<dyn Fn(usize) -> Vec4 + 'a>,
}

/// Returns the columns that a mesh may have, in the order in which they follow its corners.
fn columns(mesh: &FlatMesh) -> [Column<'_>; 5] {
    let uvs = |set: usize, attribute| Column {
        attribute,
        is_present: !mesh.uvs[set].is_empty(),
        n_components: 2,
        value: Box::new(move |vertex| mesh.uvs[set][vertex].extend(0.0).extend(0.0)),
    };
    [
        Column {
            attribute: attribute::NORMALS,
            is_present: !mesh.normals.is_empty(),
            n_components: 3,
            value: Box::new(|vertex| mesh.normals[vertex].extend(0.0)),
        },
        Column {
            attribute: attribute::COLORS,
            is_present: !mesh.colors.is_empty(),
            n_components: 4,
            value: Box::new(|vertex| mesh.colors[vertex]),
        },
        uvs(0, attribute::FIRST_UVS),
        uvs(1, attribute::SECOND_UVS),
        Column {
            attribute: attribute::TANGENTS,
            is_present: !mesh.tangents.is_empty(),
            n_components: 4,
            value: Box::new(|vertex| mesh.tangents[vertex]),
        },
    ]
}

/// Returns the bits of the attributes that a mesh has.
pub fn attributes(mesh: &FlatMesh) -> u32 {
    let present = columns(mesh).into_iter().filter(|column| column.is_present);
    present.fold(0, |bits, column| bits | column.attribute)
}

/// Returns the number of vectors of four words that a block takes.
pub fn block_vectors(mesh: &FlatMesh) -> u32 {
    let present = columns(mesh).into_iter().filter(|column| column.is_present);
    let n_components: usize = present.map(|column| column.n_components).sum();
    let words = size_of::<TriangleBlock>() / 4 + n_components * COMPONENT_WORDS;
    (words / WORDS_PER_VECTOR) as u32
}

/// Returns the blocks of a mesh, each followed by the attributes of its corners.
pub fn mesh_blocks(mesh: &FlatMesh) -> Vec<f32> {
    let columns = columns(mesh);
    let n_words = block_vectors(mesh) as usize * WORDS_PER_VECTOR;
    let mut words = Vec::with_capacity(mesh.triangles.blocks.len() * n_words);
    for block in &mesh.triangles.blocks {
        words.extend_from_slice(bytemuck::cast_slice(std::slice::from_ref(block)));
        let vertices = block.ids.map(|id| (id != NO_PRIMITIVE).then_some(id));
        let vertices = vertices.map(|id| mesh.vertex_indices.get(id? as usize).copied());
        columns.iter().for_each(|column| add_column(&mut words, column, vertices));
    }
    words
}

/// Adds an attribute of the corners of eight triangles, by corner, component and lane; zero in unused lanes.
fn add_column(words: &mut Vec<f32>, column: &Column, vertices: [Option<[u32; 3]>; LANES]) {
    if !column.is_present {
        return;
    }
    let (first, n) = (words.len(), column.n_components);
    words.resize(first + n * COMPONENT_WORDS, 0.0);
    for (lane, corners) in vertices.into_iter().enumerate() {
        for (corner, vertex) in corners.into_iter().flatten().enumerate() {
            let value = (column.value)(vertex as usize).to_array();
            for (component, value) in value[..n].iter().enumerate() {
                words[first + (n * corner + component) * LANES + lane] = *value;
            }
        }
    }
}

//! Blocks of triangles with the attributes of their vertices, in the order in which kernels read them.

use surfel_core::bvh::NO_PRIMITIVE;
use surfel_core::flat::{FlatMesh, TriangleBlock};
use surfel_core::math::{LANES, Vec3};

/// Words of the three corners of eight triangles, by corner, axis and lane.
const VECTOR_WORDS: usize = 3 * 3 * LANES;
/// Words in a vector.
const WORDS_PER_VECTOR: usize = 4;
/// The bit of meshes that have the normals of their vertices.
const HAS_NORMALS: u32 = 1;
/// The bit of meshes that have the colours of their vertices.
const HAS_COLORS: u32 = 2;

/// Returns the bits of the attributes that a mesh has.
pub fn attributes(mesh: &FlatMesh) -> u32 {
    let normals = if mesh.normals.is_empty() { 0 } else { HAS_NORMALS };
    let colors = if mesh.colors.is_empty() { 0 } else { HAS_COLORS };
    normals | colors
}

/// Returns the number of vectors of four words that a block takes.
pub fn block_vectors(mesh: &FlatMesh) -> u32 {
    let n_columns = attributes(mesh).count_ones() as usize;
    let words = size_of::<TriangleBlock>() / 4 + n_columns * VECTOR_WORDS;
    (words / WORDS_PER_VECTOR) as u32
}

/// Returns the blocks of a mesh, each followed by the normals and colours of its corners.
pub fn mesh_blocks(mesh: &FlatMesh) -> Vec<f32> {
    let n_words = block_vectors(mesh) as usize * WORDS_PER_VECTOR;
    let mut words = Vec::with_capacity(mesh.triangles.blocks.len() * n_words);
    for block in &mesh.triangles.blocks {
        words.extend_from_slice(bytemuck::cast_slice(std::slice::from_ref(block)));
        let vertices = block.ids.map(|id| (id != NO_PRIMITIVE).then_some(id));
        let vertices = vertices.map(|id| mesh.vertex_indices.get(id? as usize).copied());
        if !mesh.normals.is_empty() {
            words.extend(rows(vertices, |vertex| mesh.normals[vertex]));
        }
        if !mesh.colors.is_empty() {
            words.extend(rows(vertices, |vertex| mesh.colors[vertex].truncate()));
        }
    }
    words
}

/// Returns an attribute of the corners of eight triangles, by corner, axis and lane; zero in unused lanes.
fn rows(
    vertices: [Option<[u32; 3]>; LANES],
    attribute: impl Fn(usize) -> Vec3,
) -> [f32; VECTOR_WORDS] {
    let mut words = [0.0; VECTOR_WORDS];
    for (lane, corners) in vertices.into_iter().enumerate() {
        for (corner, vertex) in corners.into_iter().flatten().enumerate() {
            for (axis, value) in attribute(vertex as usize).to_array().into_iter().enumerate() {
                words[(3 * corner + axis) * LANES + lane] = value;
            }
        }
    }
    words
}

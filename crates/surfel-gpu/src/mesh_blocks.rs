//! Blocks of triangles with the attributes of their vertices, in the order in which kernels read them.

use crate::numbers::attribute;
use crate::payload::PayloadPart;
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
    value: Box<dyn Fn(usize) -> Vec4 + Sync + 'a>,
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
pub fn mesh_blocks(mesh: &FlatMesh) -> PayloadPart<'_> {
    const BLOCK_WORDS: usize = size_of::<TriangleBlock>() / 4;
    let present: Vec<_> = columns(mesh).into_iter().filter(|column| column.is_present).collect();
    let lay_out = move |block_idx: usize, words: &mut [u32]| {
        let block = &mesh.triangles.blocks[block_idx];
        let (of_block, mut rest) = words.split_at_mut(BLOCK_WORDS);
        of_block.copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(block)));
        let vertices = block.ids.map(|id| (id != NO_PRIMITIVE).then_some(id));
        let vertices = vertices.map(|id| mesh.vertex_indices.get(id? as usize).copied());
        for column in &present {
            let (of_column, behind) = rest.split_at_mut(column.n_components * COMPONENT_WORDS);
            lay_out_column(of_column, column, vertices);
            rest = behind;
        }
    };
    PayloadPart::Records {
        n_records: mesh.triangles.blocks.len(),
        n_words: block_vectors(mesh) as usize * WORDS_PER_VECTOR,
        lay_out: Box::new(lay_out),
    }
}

/// Lays out an attribute of the corners of eight triangles, by corner, component and lane; zero stays in unused lanes.
fn lay_out_column(words: &mut [u32], column: &Column, vertices: [Option<[u32; 3]>; LANES]) {
    let n = column.n_components;
    for (lane, corners) in vertices.into_iter().enumerate() {
        for (corner, vertex) in corners.into_iter().flatten().enumerate() {
            let value = (column.value)(vertex as usize).to_array();
            for (component, value) in value[..n].iter().enumerate() {
                words[(n * corner + component) * LANES + lane] = value.to_bits();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Kernels find the attributes of corners behind their blocks.

    use super::*;
    use crate::payload::{Payload, bytes_of};
    use surfel_core::math::{DVec3, Vec2, Vec3};
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Mesh;

    /// Returns a component of the attribute of a vertex.
    type Value<'a> = &'a dyn Fn(usize, usize) -> f32;

    /// Returns a mesh of 11 triangles with all attributes, so that lanes of its blocks are unused.
    fn mesh() -> FlatMesh {
        let vertices = || (0..13u8).map(f32::from);
        let mesh = Mesh {
            origin: DVec3::ZERO,
            positions: vertices().map(|x| Vec3::new(x, x * x, x.sin())).collect(),
            triangles: (0..11).map(|i| [i, i + 1, i + 2]).collect(),
            normals: Some(vertices().map(|x| Vec3::new(x, x + 0.1, x + 0.2)).collect()),
            tangents: Some(vertices().map(|x| Vec4::new(x, 2.0, x + 0.4, -1.0)).collect()),
            uvs: [0.5, 0.6].map(|y| Some(vertices().map(|x| Vec2::new(x, x + y)).collect())),
            colors: Some(vertices().map(|x| Vec4::splat(x + 0.7)).collect()),
            morphs: Vec::new(),
            skin: None,
        };
        FlatMesh::new(&mesh, &NoProgress).unwrap()
    }

    #[test]
    fn attributes_follow_their_blocks() {
        let mesh = mesh();
        let bytes = bytes_of(&Payload(vec![mesh_blocks(&mesh)]));
        let words: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
        let n_words = 4 * block_vectors(&mesh) as usize;
        assert_eq!(words.len(), n_words * mesh.triangles.blocks.len());
        let mut n_unused = 0;
        for (block, words) in mesh.triangles.blocks.iter().zip(words.chunks_exact(n_words)) {
            let (own, rest) = words.split_at(size_of::<TriangleBlock>() / 4);
            assert_eq!(bytemuck::cast_slice::<_, u8>(own), bytemuck::bytes_of(block));
            let mut rest = rest.iter();
            // An attribute of a corner by component, in the order of attributes.
            let columns: [(usize, Value); 5] = [
                (3, &|vertex, component| mesh.normals[vertex][component]),
                (4, &|vertex, component| mesh.colors[vertex][component]),
                (2, &|vertex, component| mesh.uvs[0][vertex][component]),
                (2, &|vertex, component| mesh.uvs[1][vertex][component]),
                (4, &|vertex, component| mesh.tangents[vertex][component]),
            ];
            for (n_components, value) in columns {
                for i in 0..3 * n_components {
                    let (corner, component) = (i / n_components, i % n_components);
                    for id in block.ids {
                        let vertices = mesh.vertex_indices.get(id as usize);
                        n_unused += usize::from(vertices.is_none());
                        let value = |own: &[u32; 3]| value(own[corner] as usize, component);
                        assert_eq!(rest.next(), Some(&vertices.map_or(0.0, value)));
                    }
                }
            }
            assert_eq!(rest.next(), None);
        }
        assert!(0 < n_unused);
    }
}

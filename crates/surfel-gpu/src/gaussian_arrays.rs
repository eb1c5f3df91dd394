//! The trained Gaussians of all clouds of a scene in one tree of a device: rays composite them together.

use crate::numbers::VECTOR_BYTES;
use crate::payload::{Payload, PayloadPart};
use std::sync::Arc;
use surfel_core::bvh::BvhNode;
use surfel_core::flat::{BlockTree, FlatGaussians, FlatGeometry, GaussianBlock};
use surfel_core::math::LANES;

/// The range of a cloud's Gaussians in the arrays of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GaussianRange {
    /// Index of the geometry.
    pub geometry_idx: usize,
    /// Index of the root of the cloud's tree.
    pub root_node: u32,
    /// Index of the first vector of four words of the cloud's blocks.
    pub first_vector: u32,
    /// Vectors of four words that a block takes with the coefficients of its colours.
    pub block_vectors: u32,
}

/// Returns the Gaussians of the geometries that have any, with the indices of the geometries.
pub fn gaussian_clouds(
    geometries: &[Arc<FlatGeometry>],
) -> impl Iterator<Item = (usize, &FlatGaussians)> {
    let clouds = geometries.iter().enumerate().filter_map(|(i, geometry)| match &**geometry {
        FlatGeometry::Cloud(cloud) => Some((i, &*cloud.gaussians)),
        FlatGeometry::Mesh(_) => None,
    });
    clouds.filter(|(_, gaussians)| !gaussians.nodes().is_empty())
}

/// Returns the ranges of all Gaussians, in the order of the geometries.
pub fn gaussian_ranges(geometries: &[Arc<FlatGeometry>]) -> Vec<GaussianRange> {
    let (mut root_node, mut first_vector) = (0, 0);
    let range = |(geometry_idx, gaussians): (usize, &FlatGaussians)| {
        let block_vectors = block_vectors(gaussians);
        let range = GaussianRange { geometry_idx, root_node, first_vector, block_vectors };
        root_node += gaussians.nodes().len() as u32;
        first_vector += gaussians.blocks().len() as u32 * block_vectors;
        range
    };
    gaussian_clouds(geometries).map(range).collect()
}

/// Returns the vectors of four words that a block takes with the coefficients of its colours.
fn block_vectors(gaussians: &FlatGaussians) -> u32 {
    let coefficients = 3 * gaussians.n_harmonics() * LANES * size_of::<u16>();
    ((size_of::<GaussianBlock>() + coefficients) / VECTOR_BYTES) as u32
}

/// Returns the nodes of all Gaussians, with the indices that they have among all.
pub fn gaussian_nodes(geometries: &[Arc<FlatGeometry>]) -> Payload<'_> {
    let ranges = gaussian_ranges(geometries).into_iter();
    let clouds = ranges.zip(gaussian_clouds(geometries));
    Payload(clouds.map(|(range, (_, gaussians))| nodes(gaussians, range.root_node)).collect())
}

/// Returns the blocks of all Gaussians, each followed by the coefficients of its colours.
pub fn gaussian_blocks(geometries: &[Arc<FlatGeometry>]) -> Payload<'_> {
    Payload(gaussian_clouds(geometries).map(|(_, gaussians)| blocks(gaussians)).collect())
}

fn nodes(gaussians: &FlatGaussians, root_node: u32) -> PayloadPart<'_> {
    let nodes = gaussians.nodes();
    PayloadPart::nodes(nodes.len(), move |i| {
        let mut node: BvhNode = nodes[i];
        node.first_node = node.first_node.wrapping_add(root_node);
        node
    })
}

fn blocks(gaussians: &FlatGaussians) -> PayloadPart<'_> {
    let (blocks, coefficients) = (gaussians.blocks(), gaussians.coefficient_bits());
    let n_coefficients = 3 * gaussians.n_harmonics() * LANES;
    let lay_out = move |i: usize, words: &mut [u32]| {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(words);
        let (of_block, of_coefficients) = bytes.split_at_mut(size_of::<GaussianBlock>());
        of_block.copy_from_slice(bytemuck::bytes_of(&blocks[i]));
        let coefficients = &coefficients[n_coefficients * i..][..n_coefficients];
        of_coefficients.copy_from_slice(bytemuck::cast_slice(coefficients));
    };
    PayloadPart::Records {
        n_records: blocks.len(),
        n_words: block_vectors(gaussians) as usize * VECTOR_BYTES / 4,
        lay_out: Box::new(lay_out),
    }
}

//! The trained Gaussians of all clouds of a scene in one tree of a device: rays composite them together.

use crate::numbers::VECTOR_BYTES;
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

/// The nodes and blocks of the Gaussians of all clouds.
#[derive(Debug, Default)]
pub struct GaussianArrays {
    /// Nodes, with the indices that they have here.
    pub nodes: Vec<BvhNode>,
    /// Blocks, each followed by the coefficients of its colours.
    pub blocks: Vec<u8>,
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

impl GaussianArrays {
    /// Returns the arrays of all Gaussians.
    pub fn new(geometries: &[Arc<FlatGeometry>]) -> Self {
        let mut arrays = Self::default();
        for (_, gaussians) in gaussian_clouds(geometries) {
            let first_node = arrays.nodes.len() as u32;
            arrays.nodes.extend_from_slice(gaussians.nodes());
            for node in &mut arrays.nodes[first_node as usize..] {
                node.first_node = node.first_node.wrapping_add(first_node);
            }
            let n = 3 * gaussians.n_harmonics() * LANES;
            let coefficients = gaussians.coefficient_bits().chunks(n);
            for (block, coefficients) in gaussians.blocks().iter().zip(coefficients) {
                arrays.blocks.extend_from_slice(bytemuck::bytes_of(block));
                arrays.blocks.extend_from_slice(bytemuck::cast_slice(coefficients));
            }
        }
        arrays
    }
}

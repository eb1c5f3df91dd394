//! Trees in the memory of a device, kept from picture to picture.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::kernels::{Kernels, bind};
use crate::mesh_blocks::mesh_blocks;
use crate::unsupported::trees;
use std::sync::{Arc, Weak};
use surfel_core::bvh::BvhNode;
use surfel_core::flat::FlatGeometry;

/// Bytes of a node in the device's memory: five times sixteen, so that it is read in vectors of four words.
const NODE_BYTES: usize = 80;
/// Bytes that are uploaded at once.
const CHUNK_BYTES: usize = 1 << 24;

/// A tree over blocks of points in a device's memory.
#[derive(Debug)]
pub struct GpuTree {
    /// The arrays of nodes and blocks.
    pub arrays: wgpu::BindGroup,
}

/// The trees of a geometry: of the points of its surface, of its lines, and of its scatter.
pub type GpuGeometry = [Option<GpuTree>; 3];

/// The geometries that are in a device's memory.
#[derive(Debug, Default)]
pub struct Uploads(Vec<(Weak<FlatGeometry>, GpuGeometry)>);

impl Uploads {
    /// Uploads the geometries that are not uploaded yet, and frees those that are no longer in use.
    ///
    /// # Errors
    /// Fails if a geometry is too large for the device.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        kernels: &Kernels,
        geometries: &[Arc<FlatGeometry>],
    ) -> Result<()> {
        // A geometry that was changed has lost its weak references, also where it stayed at its place in memory.
        self.0.retain(|(geometry, _)| geometry.strong_count() != 0);
        for geometry in geometries {
            if self.position(geometry).is_none() {
                let uploaded = upload(gpu, kernels, geometry)?;
                self.0.push((Arc::downgrade(geometry), uploaded));
            }
        }
        Ok(())
    }

    /// Returns a geometry that is uploaded.
    pub fn get(&self, geometry: &Arc<FlatGeometry>) -> Option<&GpuGeometry> {
        self.position(geometry).map(|i| &self.0[i].1)
    }

    fn position(&self, geometry: &Arc<FlatGeometry>) -> Option<usize> {
        let is_same = |known: &Weak<FlatGeometry>| {
            known.upgrade().is_some_and(|known| Arc::ptr_eq(&known, geometry))
        };
        self.0.iter().position(|(known, _)| is_same(known))
    }
}

fn upload(gpu: &Gpu, kernels: &Kernels, geometry: &FlatGeometry) -> Result<GpuGeometry> {
    let cloud = match geometry {
        FlatGeometry::Cloud(cloud) => cloud,
        FlatGeometry::Mesh(mesh) => {
            let blocks = mesh_blocks(mesh);
            let tree =
                upload_tree(gpu, kernels, &mesh.triangles.nodes, bytemuck::cast_slice(&blocks));
            return Ok([tree?, None, None]);
        }
    };
    let [surface, lines, scatter] = trees(cloud).map(|(_, points)| {
        upload_tree(gpu, kernels, &points.nodes, bytemuck::cast_slice(&points.blocks))
    });
    Ok([surface?, lines?, scatter?])
}

fn upload_tree(
    gpu: &Gpu,
    kernels: &Kernels,
    tree_nodes: &[BvhNode],
    tree_blocks: &[u8],
) -> Result<Option<GpuTree>> {
    if tree_nodes.is_empty() {
        return Ok(None);
    }
    let nodes = array(gpu, "nodes", tree_nodes.len() * NODE_BYTES)?;
    let blocks = array(gpu, "blocks", tree_blocks.len())?;
    write_padded(gpu, &nodes, tree_nodes)?;
    write(gpu, &blocks, tree_blocks)?;
    let buffers = [nodes.as_entire_binding(), blocks.as_entire_binding()];
    let arrays = gpu.catch("a tree", || bind(gpu, &kernels.tree, &buffers))?;
    Ok(Some(GpuTree { arrays }))
}

fn array(gpu: &Gpu, label: &'static str, n_bytes: usize) -> Result<wgpu::Buffer> {
    let (needed, found) = (n_bytes as u64, gpu.info.max_array_bytes);
    if found < needed {
        let limit = "bytes in one array";
        return Err(Error::Limit { device: gpu.info.name.clone(), limit, found, needed });
    }
    gpu.buffer(label, needed, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)
}

/// Writes nodes, each followed by the bytes that are missing to `NODE_BYTES`.
fn write_padded(gpu: &Gpu, buffer: &wgpu::Buffer, nodes: &[BvhNode]) -> Result<()> {
    let per_chunk = CHUNK_BYTES / NODE_BYTES;
    let mut padded = vec![0; nodes.len().min(per_chunk) * NODE_BYTES];
    for (chunk_idx, chunk) in nodes.chunks(per_chunk).enumerate() {
        for (node, padded) in chunk.iter().zip(padded.chunks_exact_mut(NODE_BYTES)) {
            padded[..size_of::<BvhNode>()].copy_from_slice(bytemuck::bytes_of(node));
        }
        let offset = chunk_idx * per_chunk * NODE_BYTES;
        write_chunk(gpu, buffer, offset, &padded[..chunk.len() * NODE_BYTES])?;
    }
    Ok(())
}

fn write(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: &[u8]) -> Result<()> {
    for (chunk_idx, chunk) in bytes.chunks(CHUNK_BYTES).enumerate() {
        write_chunk(gpu, buffer, chunk_idx * CHUNK_BYTES, chunk)?;
    }
    Ok(())
}

/// Writes a chunk and waits for it, so that copies on their way never take the memory of the whole.
fn write_chunk(gpu: &Gpu, buffer: &wgpu::Buffer, offset: usize, bytes: &[u8]) -> Result<()> {
    gpu.catch("points", || {
        gpu.queue.write_buffer(buffer, offset as u64, bytes);
        gpu.queue.submit([]);
    })?;
    gpu.wait()
}

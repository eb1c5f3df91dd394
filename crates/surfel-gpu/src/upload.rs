//! Trees in the memory of a device, kept from picture to picture.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::field_arrays::structure;
use crate::gaussian_arrays::{GaussianArrays, gaussian_clouds};
use crate::kernels::{Kernels, bind};
use crate::mesh_blocks::mesh_blocks;
use crate::numbers::{N_BLOCK_PAGES, N_NODE_PAGES};
use crate::unsupported::trees;
use std::sync::{Arc, Weak};
use std::time::Instant;
use surfel_core::bvh::BvhNode;
use surfel_core::flat::FlatGeometry;

/// Bytes of a node in the device's memory: five times sixteen, so that it is read in vectors of four words.
const NODE_BYTES: usize = 16 * NODE_VECTORS;
/// Vectors of four words that a node takes.
pub const NODE_VECTORS: usize = 5;
/// Bytes that are uploaded at once.
const CHUNK_BYTES: usize = 1 << 24;

/// A tree over blocks of points in a device's memory.
#[derive(Debug)]
pub struct GpuTree {
    /// The pages of nodes.
    nodes: Vec<wgpu::Buffer>,
    /// The pages of blocks.
    blocks: Vec<wgpu::Buffer>,
}

impl GpuTree {
    /// Returns true if the tree has more than one page of nodes or blocks.
    pub fn is_paged(&self) -> bool {
        1 < self.nodes.len().max(self.blocks.len())
    }

    /// Binds the tree together with the records of its instances.
    pub fn bind(&self, gpu: &Gpu, kernels: &Kernels, visits: &wgpu::Buffer) -> wgpu::BindGroup {
        let Self { nodes, blocks } = self;
        // The places of pages that are missing are never read.
        let page = |pages: &'_ [wgpu::Buffer], i: usize| pages[i.min(pages.len() - 1)].clone();
        let (layout, n_nodes, n_blocks) = match self.is_paged() {
            true => (&kernels.paged_tree, N_NODE_PAGES, N_BLOCK_PAGES),
            false => (&kernels.tree, 1, 1),
        };
        let nodes = (0..n_nodes).map(|i| page(nodes, i));
        let blocks = (0..n_blocks).map(|i| page(blocks, i));
        let arrays: Vec<_> = [visits.clone()].into_iter().chain(nodes).chain(blocks).collect();
        let arrays: Vec<_> = arrays.iter().map(wgpu::Buffer::as_entire_binding).collect();
        bind(gpu, layout, &arrays)
    }
}

/// A tree that rays are traced against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TreeRef {
    /// A tree of a geometry.
    Geometry {
        /// Index of the geometry.
        geometry_idx: usize,
        /// Index of the tree among those of the geometry.
        tree_idx: usize,
    },
    /// The tree of the trained Gaussians of all clouds.
    Gaussians,
}

/// The trees of a geometry: of the points of its surface, of its lines, and of its scatter.
pub type GpuGeometry = [Option<GpuTree>; 3];

/// The geometries that are in a device's memory.
#[derive(Debug, Default)]
pub struct Uploads {
    geometries: Vec<(Weak<FlatGeometry>, GpuGeometry)>,
    /// The trained Gaussians of these geometries in one tree.
    gaussians: Option<(Vec<Weak<FlatGeometry>>, GpuTree)>,
    /// The work so far.
    pub time: UploadTime,
}

/// Bytes that went to a device, and the time that this took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UploadTime {
    /// Number of bytes.
    pub n_bytes: u64,
    /// Seconds, with the time in which the CPU laid the bytes out.
    pub secs: f64,
}

impl UploadTime {
    fn add<'t>(&mut self, start: Instant, trees: impl IntoIterator<Item = &'t GpuTree>) {
        let buffers = trees.into_iter().flat_map(|tree| tree.nodes.iter().chain(&tree.blocks));
        self.n_bytes += buffers.map(wgpu::Buffer::size).sum::<u64>();
        self.secs += start.elapsed().as_secs_f64();
    }
}

impl Uploads {
    /// Uploads the geometries that are not uploaded yet, and frees those that are no longer in use.
    ///
    /// # Errors
    /// Fails if a geometry is too large for the device.
    pub fn update(&mut self, gpu: &Gpu, geometries: &[Arc<FlatGeometry>]) -> Result<()> {
        // A geometry that was changed has lost its weak references, also where it stayed at its place in memory.
        self.geometries.retain(|(geometry, _)| geometry.strong_count() != 0);
        for geometry in geometries {
            if self.position(geometry).is_none() {
                let start = Instant::now();
                let uploaded = upload(gpu, geometry)?;
                self.time.add(start, uploaded.iter().flatten());
                self.geometries.push((Arc::downgrade(geometry), uploaded));
            }
        }
        self.update_gaussians(gpu, geometries)
    }

    /// Uploads the trained Gaussians of all geometries in one tree, unless they are there.
    fn update_gaussians(&mut self, gpu: &Gpu, geometries: &[Arc<FlatGeometry>]) -> Result<()> {
        let clouds: Vec<_> = gaussian_clouds(geometries).map(|(i, _)| &geometries[i]).collect();
        let known = self.gaussians.take().filter(|(known, _)| {
            known.len() == clouds.len()
                && known.iter().zip(&clouds).all(|(known, cloud)| is_same(known, cloud))
        });
        if known.is_some() || clouds.is_empty() {
            self.gaussians = known;
            return Ok(());
        }
        let start = Instant::now();
        let arrays = GaussianArrays::new(geometries);
        if let Some(tree) = upload_tree(gpu, &arrays.nodes, &[], &arrays.blocks)? {
            self.time.add(start, [&tree]);
            self.gaussians = Some((clouds.into_iter().map(Arc::downgrade).collect(), tree));
        }
        Ok(())
    }

    /// Returns a tree that is uploaded, among those of these geometries.
    pub fn tree(&self, geometries: &[Arc<FlatGeometry>], tree: TreeRef) -> Option<&GpuTree> {
        match tree {
            TreeRef::Gaussians => self.gaussians.as_ref().map(|(_, tree)| tree),
            TreeRef::Geometry { geometry_idx, tree_idx } => {
                self.get(&geometries[geometry_idx])?[tree_idx].as_ref()
            }
        }
    }

    /// Returns a geometry that is uploaded.
    pub fn get(&self, geometry: &Arc<FlatGeometry>) -> Option<&GpuGeometry> {
        self.position(geometry).map(|i| &self.geometries[i].1)
    }

    fn position(&self, geometry: &Arc<FlatGeometry>) -> Option<usize> {
        self.geometries.iter().position(|(known, _)| is_same(known, geometry))
    }
}

fn is_same(known: &Weak<FlatGeometry>, geometry: &Arc<FlatGeometry>) -> bool {
    known.upgrade().is_some_and(|known| Arc::ptr_eq(&known, geometry))
}

fn upload(gpu: &Gpu, geometry: &FlatGeometry) -> Result<GpuGeometry> {
    let cloud = match geometry {
        FlatGeometry::Cloud(cloud) => cloud,
        FlatGeometry::Mesh(mesh) => {
            let blocks = mesh_blocks(mesh);
            let tree = upload_tree(gpu, &mesh.triangles.nodes, &[], bytemuck::cast_slice(&blocks));
            return Ok([tree?, None, None]);
        }
    };
    let structure = structure(cloud);
    let tree = |tree_idx: usize| {
        let (_, points) = trees(cloud)[tree_idx];
        let behind_nodes: &[[u32; 4]] = if tree_idx == 0 { &structure } else { &[] };
        let blocks = bytemuck::cast_slice(&points.blocks);
        upload_tree(gpu, &points.nodes, bytemuck::cast_slice(behind_nodes), blocks)
    };
    Ok([tree(0)?, tree(1)?, tree(2)?])
}

/// Uploads a tree, with the bytes of a structure behind its nodes.
fn upload_tree(
    gpu: &Gpu,
    tree_nodes: &[BvhNode],
    behind_nodes: &[u8],
    tree_blocks: &[u8],
) -> Result<Option<GpuTree>> {
    if tree_nodes.is_empty() {
        return Ok(None);
    }
    let mut node_bytes = padded_nodes(tree_nodes);
    node_bytes.extend_from_slice(behind_nodes);
    let nodes = pages(gpu, "nodes", &node_bytes, N_NODE_PAGES)?;
    let blocks = pages(gpu, "blocks", tree_blocks, N_BLOCK_PAGES)?;
    Ok(Some(GpuTree { nodes, blocks }))
}

/// Uploads bytes in pages.
fn pages(
    gpu: &Gpu,
    label: &'static str,
    bytes: &[u8],
    max_pages: usize,
) -> Result<Vec<wgpu::Buffer>> {
    let max_pages = if gpu.has_pages() { max_pages } else { 1 };
    let max_bytes = max_pages * gpu.page_bytes();
    if max_bytes < bytes.len() {
        let (device, limit) = (gpu.info.name.clone(), "bytes in the pages of a tree");
        let (found, needed) = (max_bytes as u64, bytes.len() as u64);
        return Err(Error::Limit { device, limit, found, needed });
    }
    let page = |bytes: &[u8]| {
        let buffer = array(gpu, label, bytes.len())?;
        write(gpu, &buffer, bytes)?;
        Ok(buffer)
    };
    bytes.chunks(gpu.page_bytes()).map(page).collect()
}

/// Returns nodes, each followed by the bytes that are missing to `NODE_BYTES`.
fn padded_nodes(nodes: &[BvhNode]) -> Vec<u8> {
    let mut padded = vec![0; nodes.len() * NODE_BYTES];
    for (node, padded) in nodes.iter().zip(padded.chunks_exact_mut(NODE_BYTES)) {
        padded[..size_of::<BvhNode>()].copy_from_slice(bytemuck::bytes_of(node));
    }
    padded
}

/// Makes an array, if the device allows one of this size.
pub fn array(gpu: &Gpu, label: &'static str, n_bytes: usize) -> Result<wgpu::Buffer> {
    let (needed, found) = (n_bytes as u64, gpu.info.max_array_bytes);
    if found < needed {
        let limit = "bytes in one array";
        return Err(Error::Limit { device: gpu.info.name.clone(), limit, found, needed });
    }
    gpu.buffer(label, needed, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)
}

/// Writes an array chunk by chunk.
pub fn write(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: &[u8]) -> Result<()> {
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

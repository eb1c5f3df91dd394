//! Trees in the memory of a device, kept from picture to picture.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::field_arrays::structure;
use crate::gaussian_arrays::{GaussianArrays, gaussian_clouds};
use crate::kernels::{Kernels, bind};
use crate::mesh_blocks::mesh_blocks;
use crate::numbers::{N_BLOCK_PAGES, N_NODE_PAGES};
use crate::transfer::{Payload, Transfer};
use crate::unsupported::trees;
use std::sync::{Arc, Weak};
use surfel_core::bvh::BvhNode;
use surfel_core::flat::FlatGeometry;

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
                let uploaded = upload(gpu, geometry)?;
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
        let arrays = GaussianArrays::new(geometries);
        if let Some(tree) = upload_tree(gpu, &arrays.nodes, &[], &arrays.blocks)? {
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
    let mut transfer = Transfer::new(gpu);
    let payload = Payload { nodes: tree_nodes, bytes: behind_nodes };
    let nodes = pages(&mut transfer, gpu, "nodes", payload, N_NODE_PAGES)?;
    let payload = Payload { nodes: &[], bytes: tree_blocks };
    let blocks = pages(&mut transfer, gpu, "blocks", payload, N_BLOCK_PAGES)?;
    transfer.finish()?;
    Ok(Some(GpuTree { nodes, blocks }))
}

/// Uploads bytes in pages.
fn pages(
    transfer: &mut Transfer,
    gpu: &Gpu,
    label: &'static str,
    payload: Payload,
    max_pages: usize,
) -> Result<Vec<wgpu::Buffer>> {
    let max_pages = if gpu.has_pages() { max_pages } else { 1 };
    let (max_bytes, n_bytes) = (max_pages * gpu.page_bytes(), payload.len());
    if max_bytes < n_bytes {
        let (device, limit) = (gpu.info.name.clone(), "bytes in the pages of a tree");
        let (found, needed) = (max_bytes as u64, n_bytes as u64);
        return Err(Error::Limit { device, limit, found, needed });
    }
    let page = |start: usize| {
        let buffer = array(gpu, label, gpu.page_bytes().min(n_bytes - start))?;
        transfer.fill(&buffer, payload, start)?;
        Ok(buffer)
    };
    (0..n_bytes).step_by(gpu.page_bytes()).map(page).collect()
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

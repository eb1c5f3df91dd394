//! Trees in the memory of a device, kept from picture to picture.

use crate::device::Gpu;
use crate::error::{Error, Result};
use crate::field_arrays::structure;
use crate::gaussian_arrays::{gaussian_blocks, gaussian_clouds, gaussian_nodes};
use crate::kernels::{Kernels, bind};
use crate::mesh_blocks::mesh_blocks;
use crate::numbers::{N_BLOCK_PAGES, N_NODE_PAGES};
use crate::payload::{Payload, PayloadPart};
use crate::transfer::{MAX_STAGING_BYTES, Transfer};
use crate::unsupported::trees;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Weak};
use std::time::Instant;
use surfel_core::bvh::BvhNode;
use surfel_core::flat::FlatGeometry;
use surfel_core::progress::Progress;

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

    /// Returns the number of bytes of all pages.
    fn n_bytes(&self) -> u64 {
        self.nodes.iter().chain(&self.blocks).map(wgpu::Buffer::size).sum()
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
    /// The geometries by their addresses.
    geometries: BTreeMap<usize, (Weak<FlatGeometry>, GpuGeometry)>,
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
        self.n_bytes += trees.into_iter().map(GpuTree::n_bytes).sum::<u64>();
        self.secs += start.elapsed().as_secs_f64();
    }
}

impl Uploads {
    /// Uploads the geometries that are not uploaded yet, and frees those that are no longer in use. The device must have
    /// memory for them and for `other_bytes`.
    ///
    /// # Errors
    ///
    /// Fails if a geometry is too large for the device, before anything is uploaded, or once `progress` is cancelled. What
    /// was uploaded then stays.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        geometries: &[Arc<FlatGeometry>],
        other_bytes: u64,
        progress: &dyn Progress,
    ) -> surfel_core::Result<()> {
        self.make_room(gpu, geometries, other_bytes)?;
        for geometry in geometries {
            if self.get(geometry).is_none() {
                let start = Instant::now();
                let uploaded = upload(gpu, geometry, progress)?;
                self.time.add(start, uploaded.iter().flatten());
                // A weak reference keeps its address from being used again.
                let uploaded = (Arc::downgrade(geometry), uploaded);
                self.geometries.insert(address(geometry), uploaded);
            }
        }
        self.update_gaussians(gpu, geometries, progress)
    }

    /// Frees geometries that are no longer in use, and those of other pictures if these and `other_bytes` need their memory.
    ///
    /// # Errors
    ///
    /// Fails if the device has too little memory also then.
    pub fn make_room(
        &mut self,
        gpu: &Gpu,
        geometries: &[Arc<FlatGeometry>],
        other_bytes: u64,
    ) -> Result<()> {
        // A geometry that was changed has lost its weak references.
        self.geometries.retain(|_, (geometry, _)| geometry.strong_count() != 0);
        if !self.has_gaussians_of(geometries) {
            self.gaussians = None;
        }
        if self.check_memory(gpu, geometries, other_bytes).is_err() {
            let needed: BTreeSet<usize> = geometries.iter().map(address).collect();
            self.geometries.retain(|known, _| needed.contains(known));
        }
        self.check_memory(gpu, geometries, other_bytes)
    }

    /// Fails if the trees that are missing have too many pages, or if all trees and `other_bytes` take too much memory.
    pub fn check_memory(
        &self,
        gpu: &Gpu,
        geometries: &[Arc<FlatGeometry>],
        other_bytes: u64,
    ) -> Result<()> {
        let (mut missing, mut seen) = (Vec::new(), BTreeSet::new());
        for geometry in geometries {
            if self.get(geometry).is_none() && seen.insert(address(geometry)) {
                missing.extend(tree_contents(geometry));
            }
        }
        if self.gaussians.is_none() {
            missing.push(gaussian_contents(geometries));
        }
        for tree in &missing {
            check_pages(gpu, tree.nodes.len(), N_NODE_PAGES)?;
            check_pages(gpu, tree.blocks.len(), N_BLOCK_PAGES)?;
        }
        let trees = self.geometries.values().flat_map(|(_, trees)| trees.iter().flatten());
        let held = trees.chain(self.gaussians.as_ref().map(|(_, tree)| tree)).map(GpuTree::n_bytes);
        let missing: usize = missing.iter().map(TreeContents::len).sum();
        let staging = missing.min(MAX_STAGING_BYTES);
        gpu.check_memory(held.sum::<u64>() + (missing + staging) as u64 + other_bytes)
    }

    /// Uploads the trained Gaussians of all geometries in one tree, unless they are there.
    fn update_gaussians(
        &mut self,
        gpu: &Gpu,
        geometries: &[Arc<FlatGeometry>],
        progress: &dyn Progress,
    ) -> surfel_core::Result<()> {
        if self.gaussians.is_some() || gaussian_clouds(geometries).next().is_none() {
            return Ok(());
        }
        let start = Instant::now();
        if let Some(tree) = upload_tree(gpu, &gaussian_contents(geometries), progress)? {
            self.time.add(start, [&tree]);
            let clouds = gaussian_clouds(geometries).map(|(i, _)| Arc::downgrade(&geometries[i]));
            self.gaussians = Some((clouds.collect(), tree));
        }
        Ok(())
    }

    /// Returns true if the tree of Gaussians has those of these geometries.
    fn has_gaussians_of(&self, geometries: &[Arc<FlatGeometry>]) -> bool {
        let clouds: Vec<_> = gaussian_clouds(geometries).map(|(i, _)| &geometries[i]).collect();
        self.gaussians.as_ref().is_some_and(|(known, _)| {
            known.len() == clouds.len()
                && known.iter().zip(&clouds).all(|(known, cloud)| is_same(known, cloud))
        })
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
        self.geometries.get(&address(geometry)).map(|(_, trees)| trees)
    }
}

fn address(geometry: &Arc<FlatGeometry>) -> usize {
    Arc::as_ptr(geometry) as usize
}

/// Returns true if a weak reference is one to this geometry, as it was then.
pub fn is_same(known: &Weak<FlatGeometry>, geometry: &Arc<FlatGeometry>) -> bool {
    // A weak reference keeps its address from being used again.
    known.as_ptr() == Arc::as_ptr(geometry)
}

/// The contents of the arrays of a tree.
#[derive(Default)]
struct TreeContents<'a> {
    /// The nodes, and a structure behind them.
    nodes: Payload<'a>,
    blocks: Payload<'a>,
}

impl TreeContents<'_> {
    /// Returns the number of bytes.
    fn len(&self) -> usize {
        self.nodes.len() + self.blocks.len()
    }
}

/// Returns the contents of a tree with these nodes and blocks.
fn tree<'a>(nodes: &'a [BvhNode], blocks: PayloadPart<'a>) -> TreeContents<'a> {
    let nodes = PayloadPart::nodes(nodes.len(), move |i| nodes[i]);
    TreeContents { nodes: Payload(vec![nodes]), blocks: Payload(vec![blocks]) }
}

/// Returns the contents of the trees of a geometry.
fn tree_contents(geometry: &FlatGeometry) -> [TreeContents<'_>; 3] {
    match geometry {
        FlatGeometry::Cloud(cloud) => {
            let mut found = trees(cloud).map(|(_, points)| {
                tree(&points.nodes, PayloadPart::Bytes(bytemuck::cast_slice(&points.blocks)))
            });
            found[0].nodes.0.extend(structure(cloud));
            found
        }
        FlatGeometry::Mesh(mesh) => {
            let tree = tree(&mesh.triangles.nodes, mesh_blocks(mesh));
            [tree, TreeContents::default(), TreeContents::default()]
        }
    }
}

/// Returns the contents of the tree of all trained Gaussians.
fn gaussian_contents(geometries: &[Arc<FlatGeometry>]) -> TreeContents<'_> {
    TreeContents { nodes: gaussian_nodes(geometries), blocks: gaussian_blocks(geometries) }
}

fn upload(
    gpu: &Gpu,
    geometry: &FlatGeometry,
    progress: &dyn Progress,
) -> surfel_core::Result<GpuGeometry> {
    let [first, second, third] = tree_contents(geometry);
    let tree = |contents| upload_tree(gpu, &contents, progress);
    Ok([tree(first)?, tree(second)?, tree(third)?])
}

/// Uploads a tree, if it is not empty.
fn upload_tree(
    gpu: &Gpu,
    tree: &TreeContents,
    progress: &dyn Progress,
) -> surfel_core::Result<Option<GpuTree>> {
    if tree.blocks.len() == 0 {
        return Ok(None);
    }
    let mut transfer = Transfer::new(gpu, progress);
    let nodes = pages(&mut transfer, gpu, "nodes", &tree.nodes)?;
    let blocks = pages(&mut transfer, gpu, "blocks", &tree.blocks)?;
    transfer.finish()?;
    Ok(Some(GpuTree { nodes, blocks }))
}

/// Uploads bytes in pages.
fn pages(
    transfer: &mut Transfer,
    gpu: &Gpu,
    label: &'static str,
    payload: &Payload,
) -> surfel_core::Result<Vec<wgpu::Buffer>> {
    let n_bytes = payload.len();
    let page = |start: usize| {
        let buffer = array(gpu, label, gpu.page_bytes().min(n_bytes - start))?;
        transfer.fill(&buffer, payload, start)?;
        Ok(buffer)
    };
    (0..n_bytes).step_by(gpu.page_bytes()).map(page).collect()
}

/// Fails if an array has more pages than kernels read.
fn check_pages(gpu: &Gpu, n_bytes: usize, max_pages: usize) -> Result<()> {
    let max_pages = if gpu.has_pages() { max_pages } else { 1 };
    let (found, needed) = ((max_pages * gpu.page_bytes()) as u64, n_bytes as u64);
    if found < needed {
        let (device, limit) = (gpu.info.name.clone(), "bytes in the pages of a tree");
        return Err(Error::Limit { device, limit, found, needed });
    }
    Ok(())
}

/// Makes an array, if the device allows one of this size.
pub fn array(gpu: &Gpu, label: &'static str, n_bytes: usize) -> Result<wgpu::Buffer> {
    check_array(gpu, n_bytes)?;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    gpu.buffer(label, n_bytes as u64, usage)
}

/// Fails if the device allows no array of this size.
pub fn check_array(gpu: &Gpu, n_bytes: usize) -> Result<()> {
    let (needed, found) = (n_bytes as u64, gpu.info.max_array_bytes);
    if found < needed {
        let limit = "bytes in one array";
        return Err(Error::Limit { device: gpu.info.name.clone(), limit, found, needed });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    //! A geometry counts once, however often a scene has it.

    use super::*;
    use crate::test_support::{open_gpu, scene_of_points};
    use surfel_core::progress::NoProgress;
    use surfel_core::surface::SurfaceKind;

    #[test]
    fn a_geometry_that_a_scene_repeats_counts_once() {
        let Some(mut gpu) = open_gpu() else { return };
        let geometry = || Arc::clone(&scene_of_points(SurfaceKind::Disc).geometries[0]);
        let (first, second) = (geometry(), geometry());
        let trees = [&first, &second].map(|geometry| tree_contents(geometry));
        let n_bytes = trees.iter().flatten().map(TreeContents::len).sum::<usize>() as u64;
        let geometries = [&first, &second, &first, &second].map(Arc::clone);
        let mut uploads = Uploads::default();
        // Before the upload as many bytes are on their way.
        gpu.memory_limit = Some(2 * n_bytes);
        assert!(uploads.check_memory(&gpu, &geometries, 0).is_ok());
        assert!(uploads.check_memory(&gpu, &geometries, 1).is_err());
        uploads.update(&gpu, &geometries, 0, &NoProgress).unwrap();
        assert_eq!(uploads.time.n_bytes, n_bytes);
        gpu.memory_limit = Some(n_bytes);
        assert!(uploads.check_memory(&gpu, &geometries, 0).is_ok());
        // Those of other pictures make room.
        assert!(uploads.make_room(&gpu, &geometries[..1], 1).is_ok());
        assert!(uploads.get(&first).is_some() && uploads.get(&second).is_none());
    }
}

//! The kernels, compiled for a device when they are first used.

use crate::device::Gpu;
use crate::error::Result;
use crate::numbers::{N_BLOCK_PAGES, N_NODE_PAGES};
use crate::shader::{Kernel, Resources};
use std::collections::BTreeMap;
use surfel_core::progress::Progress;

/// Layouts of the arrays that kernels use, and the kernels compiled so far.
#[derive(Debug)]
pub struct Kernels {
    /// Layout of the uniforms: picture, task and tables.
    pub uniforms: wgpu::BindGroupLayout,
    /// Layout of the arrays of rays.
    pub rays: wgpu::BindGroupLayout,
    /// Layout of the arrays of a tree and its instances.
    pub tree: wgpu::BindGroupLayout,
    /// Layout of the arrays of a tree in pages and its instances.
    pub paged_tree: wgpu::BindGroupLayout,
    /// Layout of the arrays of a scene.
    pub scene: wgpu::BindGroupLayout,
    /// Layout of one array that a kernel writes: the sizes of dispatches, or the colours of pixels.
    pub output: wgpu::BindGroupLayout,
    /// Layouts of the kernels that read a tree, a tree in pages or the scene, or write an array.
    pipeline_layouts: [wgpu::PipelineLayout; 4],
    compiled: BTreeMap<(Kernel, bool), wgpu::ComputePipeline>,
}

impl Kernels {
    /// Makes the layouts.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        gpu.catch("the layouts of arrays", || {
            let (read, write) = (storage(true), storage(false));
            let uniforms = layout(gpu, &[uniform(false), uniform(true), uniform(false)]);
            let rays = layout(gpu, &[write; 7]);
            let tree = layout(gpu, &[read; 3]);
            // A tree in pages takes more arrays than some devices allow in one kernel; they refuse such trees.
            let n_pages = if gpu.has_pages() { N_NODE_PAGES + N_BLOCK_PAGES } else { 2 };
            let paged_tree = layout(gpu, &vec![read; 1 + n_pages]);
            let scene = layout(gpu, &[read; 4]);
            let output = layout(gpu, &[write]);
            let pipeline_layouts = [&tree, &paged_tree, &scene, &output].map(|resources| {
                gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: None,
                    bind_group_layouts: &[Some(&uniforms), Some(&rays), Some(resources)],
                    immediate_size: 0,
                })
            });
            let compiled = BTreeMap::new();
            Self { uniforms, rays, tree, paged_tree, scene, output, pipeline_layouts, compiled }
        })
    }

    /// Compiles kernels that are not compiled yet, each for whole trees or for trees in pages.
    ///
    /// # Errors
    ///
    /// Fails if the driver refuses one, or once `progress` is cancelled. The kernels that were compiled then stay.
    pub fn compile(
        &mut self,
        gpu: &Gpu,
        kernels: impl Iterator<Item = (Kernel, bool)>,
        progress: &dyn Progress,
    ) -> surfel_core::Result<()> {
        for (kernel, is_paged) in kernels {
            if !self.compiled.contains_key(&(kernel, is_paged)) {
                progress.check()?;
                let [tree, paged_tree, scene, output] = &self.pipeline_layouts;
                let layout = match kernel.resources() {
                    Resources::Tree if is_paged => paged_tree,
                    Resources::Tree => tree,
                    Resources::Scene => scene,
                    Resources::Dispatches | Resources::Colors => output,
                };
                let page_shift = is_paged.then_some(gpu.page_shift);
                let pipeline =
                    gpu.catch("a kernel", || compile(gpu, kernel, page_shift, layout))?;
                self.compiled.insert((kernel, is_paged), pipeline);
            }
        }
        Ok(())
    }

    /// Returns a compiled kernel.
    pub fn get(&self, kernel: Kernel, is_paged: bool) -> &wgpu::ComputePipeline {
        &self.compiled[&(kernel, is_paged)]
    }
}

fn compile(
    gpu: &Gpu,
    kernel: Kernel,
    page_shift: Option<u32>,
    layout: &wgpu::PipelineLayout,
) -> wgpu::ComputePipeline {
    let name = format!("{kernel:?}");
    let description = wgpu::ShaderModuleDescriptor {
        label: Some(&name),
        source: wgpu::ShaderSource::Wgsl(kernel.source(page_shift).into()),
    };
    // Debug builds check the bounds of all arrays in the kernels.
    let checks = match cfg!(debug_assertions) {
        true => wgpu::ShaderRuntimeChecks::checked(),
        false => wgpu::ShaderRuntimeChecks::unchecked(),
    };
    // SAFETY: the kernels are those of this crate. They stop at the lengths of queues, which fit the arrays; indices
    // of nodes and blocks come from trees that `surfel_core` builds; all loops end.
    let module = unsafe { gpu.device.create_shader_module_trusted(description, checks) };
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(&name),
        layout: Some(layout),
        module: &module,
        entry_point: Some(kernel.entry_point()),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn uniform(has_dynamic_offset: bool) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size: None,
    }
}

fn storage(read_only: bool) -> wgpu::BindingType {
    wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only },
        has_dynamic_offset: false,
        min_binding_size: None,
    }
}

fn layout(gpu: &Gpu, bindings: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
    let entry = |(binding, ty): (usize, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding: binding as u32,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: *ty,
        count: None,
    };
    let entries: Vec<_> = bindings.iter().enumerate().map(entry).collect();
    let description = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
    gpu.device.create_bind_group_layout(&description)
}

/// Binds whole buffers in the order of a layout.
pub fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    buffers: &[wgpu::BindingResource],
) -> wgpu::BindGroup {
    let mut entries = Vec::with_capacity(buffers.len());
    for (binding, resource) in buffers.iter().enumerate() {
        let (binding, resource) = (binding as u32, resource.clone());
        entries.push(wgpu::BindGroupEntry { binding, resource });
    }
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}

//! The kernels, compiled for a device when they are first used.

use crate::device::Gpu;
use crate::error::Result;
use crate::shader::Kernel;
use std::collections::BTreeMap;

/// Layouts of the arrays that kernels use, and the kernels compiled so far.
#[derive(Debug)]
pub struct Kernels {
    /// Layout of the uniforms: picture, instance or light, and the table of sRGB.
    pub uniforms: wgpu::BindGroupLayout,
    /// Layout of the arrays of rays.
    pub rays: wgpu::BindGroupLayout,
    /// Layout of the arrays of a tree.
    pub tree: wgpu::BindGroupLayout,
    /// Layout of the kernels that read no tree, and of those that do.
    pipeline_layouts: [wgpu::PipelineLayout; 2],
    compiled: BTreeMap<Kernel, wgpu::ComputePipeline>,
}

impl Kernels {
    /// Makes the layouts.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        gpu.catch("the layouts of arrays", || {
            let (read, write) = (storage(true), storage(false));
            let uniforms = layout(gpu, &[uniform(false), uniform(true), uniform(false)]);
            let rays = layout(gpu, &[write, write, write, write, read, write]);
            let tree = layout(gpu, &[read, read]);
            let pipeline = |groups: &[Option<&wgpu::BindGroupLayout>]| {
                gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: None,
                    bind_group_layouts: groups,
                    immediate_size: 0,
                })
            };
            let all = [Some(&uniforms), Some(&rays), Some(&tree)];
            let pipeline_layouts = [pipeline(&all[..2]), pipeline(&all)];
            Self { uniforms, rays, tree, pipeline_layouts, compiled: BTreeMap::new() }
        })
    }

    /// Compiles kernels that are not compiled yet.
    ///
    /// # Errors
    /// Fails if the driver refuses one.
    pub fn compile(&mut self, gpu: &Gpu, kernels: impl Iterator<Item = Kernel>) -> Result<()> {
        for kernel in kernels {
            if !self.compiled.contains_key(&kernel) {
                let layout = &self.pipeline_layouts[usize::from(kernel.reads_tree())];
                let pipeline = gpu.catch("a kernel", || compile(gpu, kernel, layout))?;
                self.compiled.insert(kernel, pipeline);
            }
        }
        Ok(())
    }

    /// Returns a compiled kernel.
    pub fn get(&self, kernel: Kernel) -> &wgpu::ComputePipeline {
        &self.compiled[&kernel]
    }
}

fn compile(gpu: &Gpu, kernel: Kernel, layout: &wgpu::PipelineLayout) -> wgpu::ComputePipeline {
    let name = format!("{kernel:?}");
    let description = wgpu::ShaderModuleDescriptor {
        label: Some(&name),
        source: wgpu::ShaderSource::Wgsl(kernel.source().into()),
    };
    // Debug builds check the bounds of all arrays in the kernels.
    let checks = match cfg!(debug_assertions) {
        true => wgpu::ShaderRuntimeChecks::checked(),
        false => wgpu::ShaderRuntimeChecks::unchecked(),
    };
    // SAFETY: the kernels are those of this crate. They stop at the number of rays, which is that of the arrays; indices
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

//! The traversal of the tree over all instances (the top-level acceleration structure).

use crate::bvh::{Child, NO_PRIMITIVE, STACK_SIZE};
use crate::flat::FlatScene;
use crate::math::{LANES, LaneMask, Lanes, Ray, set_bits};
use crate::trace::scene::box_entries::box_entry;
use crate::trace::scene::instance_filter::InstanceFilter;
use crate::trace::simd::node_boxes::{SlabRay, intersect_children};
use crate::trace::simd::{Simd, dispatch_simd};
use std::ops::Range;

/// The boxes of instances that rays enter.
#[derive(Default)]
pub struct TlasEntries {
    /// Entry distances and instances, sorted by distance for each ray, one ray after the other.
    pub entries: Vec<(f32, u32)>,
    /// Rays that enter a box, each with its range of `entries`.
    pub rays: Vec<(u32, Range<u32>)>,
}

/// Finds the accepted instances whose boxes each ray enters. `found` is empty before.
pub fn tlas_entries(
    scene: &FlatScene,
    simd: Simd,
    filter: InstanceFilter,
    rays: &[Ray],
    found: &mut TlasEntries,
) {
    dispatch_simd!(
        simd,
        tlas_entries_kernel(
            scene: &FlatScene,
            filter: InstanceFilter,
            rays: &[Ray],
            found: &mut TlasEntries
        )
    );
}

#[inline(always)]
fn tlas_entries_kernel<L: Lanes>(
    scene: &FlatScene,
    filter: InstanceFilter,
    rays: &[Ray],
    found: &mut TlasEntries,
) {
    let mut stack = [0; STACK_SIZE];
    for (ray_idx, ray) in rays.iter().enumerate() {
        let first = found.entries.len();
        traverse::<L>(scene, filter, ray, &mut stack, &mut found.entries);
        let end = found.entries.len();
        if first < end {
            found.entries[first..].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            found.rays.push((ray_idx as u32, first as u32..end as u32));
        }
    }
}

/// Appends the accepted instances whose boxes the ray enters.
#[inline(always)]
fn traverse<L: Lanes>(
    scene: &FlatScene,
    filter: InstanceFilter,
    ray: &Ray,
    stack: &mut [u32; STACK_SIZE],
    entries: &mut Vec<(f32, u32)>,
) {
    let tlas = &scene.tlas;
    let Some(root) = tlas.nodes.first() else { return };
    let slab_ray = SlabRay::new(root, ray);
    stack[0] = 0;
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &tlas.nodes[stack[size] as usize];
        let (lanes, _) = intersect_children::<L>(node, &slab_ray, ray.t_max);
        for lane in set_bits::<LANES>(lanes.bits()) {
            match node.child(lane) {
                Some(Child::Node(child)) => {
                    stack[size] = child;
                    size += 1;
                }
                Some(Child::Block(block)) => {
                    add_entries(scene, filter, ray, &tlas.blocks[block as usize], entries);
                }
                None => {}
            }
        }
    }
}

/// Appends the accepted instances of a block whose boxes the ray enters.
#[inline(always)]
fn add_entries(
    scene: &FlatScene,
    filter: InstanceFilter,
    ray: &Ray,
    block: &[u32; LANES],
    entries: &mut Vec<(f32, u32)>,
) {
    for &instance_idx in block {
        if instance_idx == NO_PRIMITIVE {
            continue;
        }
        let instance = &scene.instances[instance_idx as usize];
        if filter.accepts(instance) {
            let entry = box_entry(&instance.bounds, ray);
            if entry < f32::INFINITY {
                entries.push((entry, instance_idx));
            }
        }
    }
}

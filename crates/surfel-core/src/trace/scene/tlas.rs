//! The traversal of the tree over all instances (the top-level acceleration structure).

use crate::bvh::{Child, NO_PRIMITIVE, STACK_SIZE};
use crate::flat::FlatScene;
use crate::math::{LANES, LaneMask, PortableLanes, Ray, set_bits};
use crate::trace::scene::box_entries::box_entry;
use crate::trace::scene::instance_filter::InstanceFilter;
use crate::trace::simd::node_boxes::{SlabRay, intersect_children};

/// Appends the accepted instances whose boxes the ray enters, each with the distance at which it does.
pub fn traverse_tlas(
    scene: &FlatScene,
    filter: InstanceFilter,
    ray: &Ray,
    entries: &mut Vec<(f32, u32)>,
) {
    let tlas = &scene.tlas;
    let Some(root) = tlas.nodes.first() else { return };
    let slab_ray = SlabRay::new(root, ray);
    let mut stack = [0; STACK_SIZE];
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &tlas.nodes[stack[size] as usize];
        let (lanes, _) = intersect_children::<PortableLanes>(node, &slab_ray, ray.t_max);
        for lane in set_bits::<LANES>(lanes.bits()) {
            match node.child(lane) {
                Some(Child::Node(child)) => {
                    stack[size] = child;
                    size += 1;
                }
                Some(Child::Block(block)) => {
                    for &i in tlas.blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE) {
                        let instance = &scene.instances[i as usize];
                        if filter.accepts(instance) {
                            let entry = box_entry(&instance.bounds, ray);
                            if entry < f32::INFINITY {
                                entries.push((entry, i));
                            }
                        }
                    }
                }
                None => {}
            }
        }
    }
}

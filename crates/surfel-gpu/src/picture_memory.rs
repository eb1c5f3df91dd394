//! The memory of a device that a picture takes besides its trees.

use crate::passes::Passes;
use crate::records::{InstanceRecord, MaterialRecord};
use crate::scene_records::n_words;
use surfel_core::flat::FlatScene;

/// Returns the bytes of what a picture takes besides trees and arrays: the records of its scene, and texels.
pub fn scene_bytes(scene: &FlatScene, passes: &Passes) -> u64 {
    let records = scene.instances.len() * size_of::<InstanceRecord>()
        + scene.materials.len() * size_of::<MaterialRecord>()
        + size_of_val(passes.visits.as_slice())
        + passes.tasks.len()
        + 4 * n_words(scene);
    records as u64
}

#[cfg(test)]
mod tests {
    //! The estimate is what the device's allocator counts.

    use super::*;
    use crate::kernels::Kernels;
    use crate::scene_records::SceneRecords;
    use crate::test_support::{empty_scene, open_gpu, report_skipped};
    use crate::wavefront::{Arrays, Capacities, Contents, Wavefront, written};

    #[test]
    fn the_estimate_is_what_is_allocated() {
        let Some(gpu) = open_gpu() else { return };
        let allocated = || Some(gpu.device.generate_allocator_report()?.total_allocated_bytes);
        let (kernels, scene) = (Kernels::new(&gpu).unwrap(), empty_scene());
        let words = written(&gpu, "textures", &[0; 4], wgpu::BufferUsages::STORAGE).unwrap();
        for (has_waves, is_transmissive) in [(false, false), (true, false), (true, true)] {
            let sizes =
                Capacities { n_pixels: 1 << 16, n_entries: 1 << 18, has_waves, is_transmissive };
            let estimate = scene_bytes(&scene, &Passes::default()) + Arrays::n_bytes(sizes);
            let Some(before) = allocated() else {
                return report_skipped("the device does not report its memory");
            };
            let records = SceneRecords::empty();
            let contents = Contents { scene: &records, words: &words, tasks: &[0; 256] };
            let mut arrays = None;
            let known = Arrays::update(&mut arrays, &gpu, sizes).unwrap();
            let wavefront = Wavefront::new(&gpu, &kernels, known, contents).unwrap();
            let found = allocated().unwrap() - before;
            // Small arrays and the alignment of all are not counted.
            assert!(estimate <= found && found < estimate + (1 << 19), "{found} {estimate}");
            drop(wavefront);
            drop(arrays);
            gpu.queue.submit([]);
            gpu.wait().unwrap();
        }
    }
}

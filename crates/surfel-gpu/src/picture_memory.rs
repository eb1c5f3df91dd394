//! The memory of a device that a picture takes besides its trees.

use crate::passes::Passes;
use crate::records::{
    HitRecord, InstanceRecord, MaterialRecord, Path, Pixel, SearchState, ShadingPointRecord,
};
use crate::scene_records::n_words;
use crate::wavefront::{Capacities, MAX_READ_BYTES};
use surfel_core::flat::FlatScene;

/// Returns the bytes of what a picture takes: its arrays, the records of its scene, and texels.
pub fn picture_bytes(scene: &FlatScene, passes: &Passes, sizes: Capacities) -> u64 {
    let records = scene.instances.len() * size_of::<InstanceRecord>()
        + scene.materials.len() * size_of::<MaterialRecord>()
        + size_of_val(passes.visits.as_slice())
        + passes.tasks.len()
        + 4 * n_words(scene);
    array_bytes(sizes) + records as u64
}

/// Returns the bytes of arrays of queues and pixels, as [`Arrays`](crate::wavefront::Arrays) has them.
pub fn array_bytes(sizes: Capacities) -> u64 {
    let Capacities { n_pixels, n_entries, has_waves, is_transmissive } = sizes;
    let n_path_arrays = if has_waves { 3 } else { 2 };
    let n_hit_arrays = if is_transmissive { 2 } else { 1 };
    let of_entry = n_path_arrays * size_of::<Path>()
        + n_hit_arrays * size_of::<HitRecord>()
        + size_of::<ShadingPointRecord>()
        + size_of::<SearchState>();
    // Colours come back through two arrays in turn.
    let of_pixel = size_of::<Pixel>() + 3 * size_of::<[f32; 4]>();
    let hit_bytes = u64::from(n_entries) * size_of::<HitRecord>() as u64;
    u64::from(n_entries) * of_entry as u64
        + u64::from(n_pixels) * of_pixel as u64
        + hit_bytes.min(MAX_READ_BYTES)
}

#[cfg(test)]
mod tests {
    //! The estimate is what the device's allocator counts.

    use super::*;
    use crate::kernels::Kernels;
    use crate::scene_records::SceneRecords;
    use crate::test_support::{empty_scene, open_gpu, report_skipped};
    use crate::wavefront::{Arrays, Contents, Wavefront, written};

    #[test]
    fn the_estimate_is_what_is_allocated() {
        let Some(gpu) = open_gpu() else { return };
        let allocated = || Some(gpu.device.generate_allocator_report()?.total_allocated_bytes);
        let (kernels, scene) = (Kernels::new(&gpu).unwrap(), empty_scene());
        let words = written(&gpu, "textures", &[0; 4], wgpu::BufferUsages::STORAGE).unwrap();
        for (has_waves, is_transmissive) in [(false, false), (true, false), (true, true)] {
            let sizes =
                Capacities { n_pixels: 1 << 16, n_entries: 1 << 18, has_waves, is_transmissive };
            let estimate = picture_bytes(&scene, &Passes::default(), sizes);
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

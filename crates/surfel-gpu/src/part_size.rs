//! The number of pixels that are rendered together, by the speed of the device and the length of its queues.

use crate::device::DeviceKind;
use crate::numbers::WORKGROUP_SIZE;
use crate::shader::Kernel;
use crate::upload::is_same;
use std::collections::BTreeSet;
use std::sync::{Arc, Weak};
use std::time::Duration;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::scene::Camera;

/// Number of pixels of the first part that a GPU with memory of its own renders.
const FIRST_PART: u32 = 1 << 16;
/// Number of pixels of the first part on slower GPUs: systems take a device away that is busy for two seconds.
const FIRST_SLOW_PART: u32 = 1 << 13;
/// Number of pixels of the first part of each picture on a software device. Such a device is so slow that a part of
/// another scene's size could keep a picture from being cancelled for minutes.
const FIRST_SOFTWARE_PART: u32 = 1 << 12;
/// Time of a sample of a part above which the next part is smaller. A device that also draws a screen must not be busy
/// for long.
const MAX_SAMPLE_TIME: Duration = Duration::from_millis(200);
/// Time of a sample that a part is meant to take, by the rate of the part before.
const TARGET_SAMPLE_TIME: Duration = Duration::from_millis(100);
/// Maximum growth from one part to the next.
const MAX_GROWTH: f64 = 8.0;
/// Maximum growth on slower GPUs.
const MAX_SLOW_GROWTH: f64 = 2.0;
/// Divisor of the size of the next part after the camera has moved: its pixels may take longer.
const MOVED_CAMERA_DIVISOR: u32 = 4;
/// Number of parts whose paths fit the queues after which parts may be twice as large.
const N_FITTING_PARTS: u32 = 16;

/// The number of pixels of a part, for pictures of these geometries that these kernels render.
#[derive(Clone, Debug)]
pub struct PartSize {
    kind: DeviceKind,
    kernels: BTreeSet<Kernel>,
    /// The geometries. With others a pixel may take a hundred times as long: a part of as many pixels may then exceed
    /// the time after which the system takes the device away.
    geometries: Vec<Weak<FlatGeometry>>,
    camera: Camera,
    /// The number of pixels by the speed of the device.
    by_speed: u32,
    /// The number of pixels whose paths fit the queues.
    by_queues: u32,
    /// Number of parts with as many pixels as fit the queues, since that number changed.
    n_fitting: u32,
}

impl PartSize {
    /// Returns the size of the first part of a picture: that of the last part if the same kernels rendered the same
    /// geometries.
    pub fn first(
        kind: DeviceKind,
        known: Option<Self>,
        kernels: BTreeSet<Kernel>,
        scene: &FlatScene,
    ) -> Self {
        let FlatScene { geometries, camera, .. } = scene;
        let known = known.filter(|known| known.kernels == kernels && known.has(geometries));
        let by_speed = known.as_ref().map(|known| match known.camera == *camera {
            true => known.by_speed,
            false => (known.by_speed / MOVED_CAMERA_DIVISOR).max(WORKGROUP_SIZE),
        });
        Self {
            kind,
            kernels,
            geometries: geometries.iter().map(Arc::downgrade).collect(),
            camera: *camera,
            by_speed: first_part(kind, by_speed),
            by_queues: known.as_ref().map_or(u32::MAX, |known| known.by_queues),
            n_fitting: known.map_or(0, |known| known.n_fitting),
        }
    }

    /// Returns true if the size is that of pictures of these geometries.
    fn has(&self, geometries: &[Arc<FlatGeometry>]) -> bool {
        self.geometries.len() == geometries.len()
            && self.geometries.iter().zip(geometries).all(|(known, other)| is_same(known, other))
    }

    /// Returns the number of pixels of the next part.
    pub fn n_pixels(&self) -> u32 {
        self.by_speed.min(self.by_queues)
    }

    /// Limits the parts to come, after one whose paths did not fit the queues, to this number of pixels.
    pub fn limit(&mut self, n_pixels: u32) {
        (self.by_queues, self.n_fitting) = (n_pixels, 0);
    }

    /// Learns from a part of `n_pixels` whose samples took this time each.
    pub fn learn(&mut self, n_pixels: u32, sample_time: Duration) {
        self.by_speed = next_part(self.kind, self.by_speed, n_pixels, sample_time);
        if n_pixels == self.by_queues {
            self.n_fitting += 1;
        }
        if self.n_fitting == N_FITTING_PARTS {
            self.limit(self.by_queues.saturating_mul(2));
        }
    }
}

/// Returns true for devices that may be slow, and draw a screen.
fn is_slow(kind: DeviceKind) -> bool {
    matches!(kind, DeviceKind::Integrated | DeviceKind::Virtual | DeviceKind::Other)
}

/// Returns the number of pixels of the first part of a picture, on a device whose next part would have `known` pixels.
fn first_part(kind: DeviceKind, known: Option<u32>) -> u32 {
    match kind {
        DeviceKind::Software => FIRST_SOFTWARE_PART,
        _ => known.unwrap_or(if is_slow(kind) { FIRST_SLOW_PART } else { FIRST_PART }),
    }
}

/// Returns the number of pixels of the parts to come, which was `wanted`, after a part of `n_pixels` whose samples took
/// this time each.
fn next_part(kind: DeviceKind, wanted: u32, n_pixels: u32, sample_time: Duration) -> u32 {
    let rest = TARGET_SAMPLE_TIME.as_secs_f64() / sample_time.as_secs_f64().max(1e-9);
    if MAX_SAMPLE_TIME < sample_time {
        ((f64::from(n_pixels) * rest) as u32).max(WORKGROUP_SIZE)
    } else {
        let max_growth = if is_slow(kind) { MAX_SLOW_GROWTH } else { MAX_GROWTH };
        let growth = rest.min(max_growth).floor().max(1.0) as u32;
        // The last part of a picture is small, but says nothing against larger ones.
        wanted.max(n_pixels.saturating_mul(growth))
    }
}

#[cfg(test)]
mod tests {
    //! Parts grow while they are fast and shrink once they are slow.

    use super::*;
    use crate::test_support::{empty_scene, scene_of_points};
    use surfel_core::surface::SurfaceKind;

    fn new(kind: DeviceKind, scene: &FlatScene) -> PartSize {
        PartSize::first(kind, None, BTreeSet::from([Kernel::Shade]), scene)
    }

    /// Returns the size of the first part of a scene's pictures by these kernels, after parts of this size.
    fn first(known: &PartSize, kernels: &[Kernel], scene: &FlatScene) -> u32 {
        let kernels = kernels.iter().copied().collect();
        PartSize::first(known.kind, Some(known.clone()), kernels, scene).n_pixels()
    }

    fn next(wanted: u32, n_pixels: u32, millis: u64) -> u32 {
        next_part(DeviceKind::Discrete, wanted, n_pixels, Duration::from_millis(millis))
    }

    #[test]
    fn parts_grow_while_they_are_fast() {
        assert_eq!(next(FIRST_PART, FIRST_PART, 0), 8 * FIRST_PART);
        assert_eq!(next(FIRST_PART, FIRST_PART, 12), 8 * FIRST_PART);
        assert_eq!(next(FIRST_PART, FIRST_PART, 30), 3 * FIRST_PART);
        assert_eq!(next(FIRST_PART, FIRST_PART, 60), FIRST_PART);
        assert_eq!(next(FIRST_PART, FIRST_PART, 200), FIRST_PART);
        assert_eq!(next(u32::MAX, u32::MAX, 1), u32::MAX);
    }

    #[test]
    fn parts_shrink_once_they_are_slow() {
        assert_eq!(next(FIRST_PART, FIRST_PART, 400), FIRST_PART / 4);
        assert_eq!(next(FIRST_PART, FIRST_PART, 6400), FIRST_PART / 64);
        assert_eq!(next(FIRST_PART, FIRST_PART, 900_000), WORKGROUP_SIZE);
    }

    #[test]
    fn small_parts_at_the_end_of_pictures_count_by_their_rate() {
        assert_eq!(next(FIRST_PART, 100, 1), FIRST_PART);
        assert_eq!(next(FIRST_PART, 1000, 1000), 100);
    }

    #[test]
    fn other_kernels_and_geometries_begin_with_a_small_part() {
        let mut light = scene_of_points(SurfaceKind::Disc);
        let heavy = scene_of_points(SurfaceKind::Disc);
        let known = PartSize { by_speed: 1 << 20, ..new(DeviceKind::Discrete, &light) };
        assert_eq!(first(&known, &[Kernel::Shade], &light), 1 << 20);
        assert_eq!(first(&known, &[Kernel::NextDisc], &light), FIRST_PART);
        assert_eq!(first(&known, &[Kernel::Shade], &heavy), FIRST_PART);
        assert_eq!(first(&known, &[Kernel::Shade], &empty_scene()), FIRST_PART);
        light.geometries.extend(heavy.geometries);
        assert_eq!(first(&known, &[Kernel::Shade], &light), FIRST_PART);
    }

    #[test]
    fn a_camera_that_moved_begins_with_a_smaller_part() {
        let mut scene = scene_of_points(SurfaceKind::Disc);
        let known = PartSize { by_speed: 1 << 20, ..new(DeviceKind::Integrated, &scene) };
        scene.camera.position.x += 1.0;
        assert_eq!(first(&known, &[Kernel::Shade], &scene), 1 << 18);
    }

    #[test]
    fn slow_devices_begin_with_small_parts_that_grow_slowly() {
        for kind in [DeviceKind::Integrated, DeviceKind::Virtual, DeviceKind::Other] {
            let mut size = new(kind, &empty_scene());
            assert_eq!(size.n_pixels(), FIRST_SLOW_PART);
            size.learn(FIRST_SLOW_PART, Duration::from_millis(1));
            assert_eq!(size.n_pixels(), 2 * FIRST_SLOW_PART);
        }
    }

    #[test]
    fn parts_that_did_not_fit_the_queues_are_remembered_for_some_parts() {
        let scene = scene_of_points(SurfaceKind::Disc);
        let mut size = new(DeviceKind::Discrete, &scene);
        size.limit(FIRST_PART / 4);
        assert_eq!(first(&size, &[Kernel::Shade], &scene), FIRST_PART / 4);
        for _ in 0..N_FITTING_PARTS {
            assert_eq!(size.n_pixels(), FIRST_PART / 4);
            size.learn(100, Duration::from_millis(1));
            size.learn(FIRST_PART / 4, Duration::from_millis(1));
        }
        assert_eq!(size.n_pixels(), FIRST_PART / 2);
    }

    #[test]
    fn software_begins_each_picture_with_a_small_part() {
        assert_eq!(first_part(DeviceKind::Discrete, None), FIRST_PART);
        assert_eq!(first_part(DeviceKind::Discrete, Some(1 << 20)), 1 << 20);
        assert_eq!(first_part(DeviceKind::Software, Some(1 << 20)), FIRST_SOFTWARE_PART);
    }
}

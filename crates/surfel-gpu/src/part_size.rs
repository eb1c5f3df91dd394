//! The number of pixels that are rendered together, by the speed of the device.

use crate::device::DeviceKind;
use crate::numbers::WORKGROUP_SIZE;
use crate::shader::Kernel;
use crate::upload::is_same;
use std::collections::BTreeSet;
use std::sync::{Arc, Weak};
use std::time::Duration;
use surfel_core::flat::FlatGeometry;

/// Number of pixels of the first part that a device renders.
const FIRST_PART: u32 = 1 << 16;
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

/// The number of pixels of a part, for pictures of these geometries that these kernels render.
#[derive(Clone, Debug)]
pub struct PartSize {
    /// The kernels.
    kernels: BTreeSet<Kernel>,
    /// The geometries. With others a pixel may take a hundred times as long: a part of as many pixels may then exceed
    /// the time after which the system takes the device away.
    geometries: Vec<Weak<FlatGeometry>>,
    /// The number of pixels.
    pub n_pixels: u32,
}

impl PartSize {
    /// Returns the size of the first part of a picture: that of the last part if the same kernels rendered the same
    /// geometries.
    pub fn first(
        kind: DeviceKind,
        known: Option<Self>,
        kernels: BTreeSet<Kernel>,
        geometries: &[Arc<FlatGeometry>],
    ) -> Self {
        let known = known.filter(|known| known.kernels == kernels && known.has(geometries));
        let n_pixels = first_part(kind, known.map(|known| known.n_pixels));
        Self { kernels, geometries: geometries.iter().map(Arc::downgrade).collect(), n_pixels }
    }

    /// Returns true if the size is that of pictures of these geometries.
    fn has(&self, geometries: &[Arc<FlatGeometry>]) -> bool {
        self.geometries.len() == geometries.len()
            && self.geometries.iter().zip(geometries).all(|(known, other)| is_same(known, other))
    }
}

/// Returns the number of pixels of the first part of a picture, on a device whose last part had `known` pixels.
fn first_part(kind: DeviceKind, known: Option<u32>) -> u32 {
    match kind {
        DeviceKind::Software => FIRST_SOFTWARE_PART,
        _ => known.unwrap_or(FIRST_PART),
    }
}

/// Returns the number of pixels of the parts to come, which was `wanted`, after a part of `n_pixels` whose samples took
/// this time each.
pub fn next_part(wanted: u32, n_pixels: u32, sample_time: Duration) -> u32 {
    let rest = TARGET_SAMPLE_TIME.as_secs_f64() / sample_time.as_secs_f64().max(1e-9);
    if MAX_SAMPLE_TIME < sample_time {
        ((f64::from(n_pixels) * rest) as u32).max(WORKGROUP_SIZE)
    } else {
        let growth = rest.min(MAX_GROWTH).floor().max(1.0) as u32;
        // The last part of a picture is small, but says nothing against larger ones.
        wanted.max(n_pixels.saturating_mul(growth))
    }
}

#[cfg(test)]
mod tests {
    //! Parts grow while they are fast and shrink once they are slow.

    use super::*;
    use crate::test_support::scene_of_points;
    use surfel_core::surface::SurfaceKind;

    fn next(wanted: u32, n_pixels: u32, millis: u64) -> u32 {
        next_part(wanted, n_pixels, Duration::from_millis(millis))
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
        let shade = BTreeSet::from([Kernel::Shade]);
        let light = scene_of_points(SurfaceKind::Disc).geometries;
        let heavy = scene_of_points(SurfaceKind::Disc).geometries;
        let known = PartSize {
            kernels: shade.clone(),
            geometries: light.iter().map(Arc::downgrade).collect(),
            n_pixels: 1 << 20,
        };
        let first = |kernels: &BTreeSet<Kernel>, geometries: &[Arc<FlatGeometry>]| {
            let (known, kernels) = (Some(known.clone()), kernels.clone());
            PartSize::first(DeviceKind::Discrete, known, kernels, geometries).n_pixels
        };
        assert_eq!(first(&shade, &light), 1 << 20);
        assert_eq!(first(&BTreeSet::from([Kernel::NextDisc]), &light), FIRST_PART);
        assert_eq!(first(&shade, &heavy), FIRST_PART);
        assert_eq!(first(&shade, &[]), FIRST_PART);
        assert_eq!(first(&shade, &[light, heavy].concat()), FIRST_PART);
    }

    #[test]
    fn software_begins_each_picture_with_a_small_part() {
        assert_eq!(first_part(DeviceKind::Discrete, None), FIRST_PART);
        assert_eq!(first_part(DeviceKind::Discrete, Some(1 << 20)), 1 << 20);
        assert_eq!(first_part(DeviceKind::Software, Some(1 << 20)), FIRST_SOFTWARE_PART);
    }
}

//! The renderers that draw the same pictures, and how far they may differ.

use crate::skipped::report_skipped;
use std::sync::OnceLock;
use surfel_core::flat::FlatScene;
use surfel_core::image::{Aovs, Image};
use surfel_core::math::Vec3;
use surfel_core::progress::NoProgress;
use surfel_core::render::{CpuRenderer, Renderer, Settings};
use surfel_core::trace::Simd;
use surfel_gpu::GpuRenderer;

/// How far a picture of a GPU may differ from that of the CPU.
///
/// Both trace the same rays against the same numbers, but a GPU fuses multiplications and additions, divides and takes
/// roots with an error of some units in the last place, and has a sine of its own. A ray within such an error of the rim
/// of a disc hits it on one of them only.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// The greatest fraction of pixels whose nearest point may be another one, as between two points that are
    /// equally near.
    pub other_points: f32,
    /// The greatest fraction of pixels of the same point whose other layers differ by more than rounding: a point may lie
    /// at the end of the radius within which points are counted, and fits multiply rounding.
    pub other_layers: f32,
    /// The greatest difference of an albedo: colours by support have 8 bits, of which rounding may give the next one.
    pub albedo: f32,
    /// The greatest difference of a channel that is rounding alone: the colour of a pixel is a sum of up to a hundred
    /// terms, each rounded. Layers may differ by as much of their value.
    pub rounding: f32,
    /// The greatest fraction of pixels that differ by more. Each of a pixel's hundred rays may pass a rim.
    pub other_pixels: f32,
    /// The greatest difference of a mean over all pixels: rays that pass a rim do so on either side.
    pub mean: f32,
    /// The greatest difference in 8-bit steps from a picture of four samples a pixel: a camera ray that hits something
    /// else is a fourth of its pixel.
    pub steps: u8,
}

/// The tolerance of all scenes.
pub const TOLERANCE: Tolerance = Tolerance {
    other_points: 1e-3,
    other_layers: 5e-3,
    albedo: 1e-2,
    rounding: 1e-3,
    other_pixels: 5e-3,
    mean: 1e-4,
    steps: 64,
};

/// The difference between two pictures, in the terms of [`Tolerance`].
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    /// Fraction of pixels whose nearest point is another one; 0 without AOVs.
    pub other_points: f32,
    /// Fraction of pixels of the same point whose other layers differ; 0 without AOVs.
    pub other_layers: f32,
    /// Fraction of pixels that differ by more than rounding.
    pub other_pixels: f32,
    /// Difference of the means over all pixels.
    pub mean: f32,
}

impl Difference {
    /// Compares two pictures of one size.
    pub fn new(a: &Image, b: &Image) -> Self {
        assert_eq!((a.width, a.height), (b.width, b.height));
        let n_pixels = a.color.len() as f32;
        let pairs = || a.color.iter().zip(&b.color);
        // NaN is not equal to anything.
        let is_equal = |(a, b): (&[f32; 4], &[f32; 4])| {
            a.iter().zip(b).all(|(a, b)| (a - b).abs() <= TOLERANCE.rounding)
        };
        let channels = |pixel: &[f32; 4]| f64::from(pixel.iter().sum::<f32>());
        let sum: f64 = pairs().map(|(a, b)| channels(a) - channels(b)).sum();
        let aovs = a.aovs.as_ref().zip(b.aovs.as_ref());
        let n_other = |is_equal: fn(&Aovs, &Aovs, usize) -> bool| {
            let n =
                aovs.map_or(0, |(a, b)| (0..a.depth.len()).filter(|i| !is_equal(a, b, *i)).count());
            n as f32 / n_pixels
        };
        Self {
            other_points: n_other(has_equal_point),
            other_layers: n_other(|a, b, i| !has_equal_point(a, b, i) || has_equal_layers(a, b, i)),
            other_pixels: pairs().filter(|pair| !is_equal(*pair)).count() as f32 / n_pixels,
            mean: (sum / f64::from(4.0 * n_pixels)).abs() as f32,
        }
    }

    /// Returns true if the pictures are within the tolerance.
    pub fn is_allowed(&self) -> bool {
        self.other_points <= TOLERANCE.other_points
            && self.other_layers <= TOLERANCE.other_layers
            && self.other_pixels <= TOLERANCE.other_pixels
            && self.mean <= TOLERANCE.mean
    }
}

/// Returns true if the nearest point is the same in a pixel.
fn has_equal_point(a: &Aovs, b: &Aovs, pixel: usize) -> bool {
    (a.point_id[pixel], a.instance_id[pixel]) == (b.point_id[pixel], b.instance_id[pixel])
}

/// Returns true if the layers of a pixel are equal up to rounding.
fn has_equal_layers(a: &Aovs, b: &Aovs, pixel: usize) -> bool {
    // Infinite values have no difference.
    let is_equal =
        |a: f32, b: f32| a == b || (a - b).abs() <= TOLERANCE.rounding * a.abs().max(1.0);
    let are_equal =
        |a: Vec3, b: Vec3| a.to_array().into_iter().zip(b.to_array()).all(|(a, b)| is_equal(a, b));
    is_equal(a.depth[pixel], b.depth[pixel])
        && is_equal(a.support_distance[pixel], b.support_distance[pixel])
        && a.support_count[pixel] == b.support_count[pixel]
        && are_equal(a.normal[pixel], b.normal[pixel])
        && are_equal(a.position[pixel], b.position[pixel])
        && (a.albedo[pixel] - b.albedo[pixel]).abs().max_element() <= TOLERANCE.albedo
}

/// Returns the CPU's renderer.
pub fn cpu() -> CpuRenderer {
    CpuRenderer { simd: Simd::detect() }
}

/// Returns the renderer of this machine's first GPU, or of the one that the variable `SURFEL_DEVICE` names. Without
/// any, says so in a line that is counted.
///
/// # Panics
///
/// Panics if there are devices and none can be opened.
pub fn gpu() -> Option<&'static GpuRenderer> {
    static GPU: OnceLock<Result<GpuRenderer, surfel_gpu::Error>> = OnceLock::new();
    let open = || GpuRenderer::open(std::env::var("SURFEL_DEVICE").ok().as_deref());
    match GPU.get_or_init(open) {
        Ok(gpu) => Some(gpu),
        Err(error @ surfel_gpu::Error::NoDevice) => {
            report_skipped(&error.to_string());
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Renders a scene on a renderer.
pub fn render(renderer: &dyn Renderer, scene: &FlatScene, settings: &Settings) -> Image {
    renderer.render(scene, settings, &NoProgress).unwrap_or_else(|error| panic!("{error}")).0
}

#[cfg(test)]
mod tests {
    //! Differences are found where they are.

    use super::*;
    use surfel_core::image::Image;

    #[test]
    fn differences_count_what_differs() {
        let a = Image::with_aovs(20, 10);
        assert!(Difference::new(&a, &a).is_allowed());
        let mut b = a.clone();
        b.color[3][1] = 0.5;
        let difference = Difference::new(&a, &b);
        assert_eq!((difference.other_pixels, difference.other_points), (0.005, 0.0));
        assert!(!difference.is_allowed() && 6e-4 < difference.mean);
        let mut b = a.clone();
        b.color[3][1] = f32::NAN;
        assert!(!Difference::new(&a, &b).is_allowed());
        let mut b = a.clone();
        b.aovs.as_mut().unwrap().point_id[7] = 1;
        assert!(!Difference::new(&a, &b).is_allowed());
        let mut b = a.clone();
        b.aovs.as_mut().unwrap().albedo[7].x = 0.1;
        let difference = Difference::new(&a, &b);
        assert_eq!((difference.other_layers, difference.other_points), (0.005, 0.0));
        b.aovs.as_mut().unwrap().support_count[8] = 1;
        assert!(!Difference::new(&a, &b).is_allowed());
    }
}

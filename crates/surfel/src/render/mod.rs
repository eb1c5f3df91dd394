//! Renderers: from a flat scene to a picture.

mod cpu;
mod raster;

pub use cpu::CpuRenderer;

use crate::error::{Error, Result};
use crate::flat::FlatScene;
use crate::image::Image;
use crate::integrator::RayCounts;
use crate::progress::Progress;

/// How a picture is to be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    pub width: u32,
    pub height: u32,
    /// Camera rays a pixel.
    pub samples_per_pixel: u32,
    /// Rays toward the sky or environment, and toward suns and lamps whose shadows are soft, a pixel.
    pub light_samples: u32,
    /// Reflections and refractions of a ray, at most.
    pub max_depth: u32,
    pub seed: u64,
    /// Whether the layers beside colour and coverage are wanted.
    pub with_layers: bool,
}

impl Settings {
    /// A picture of this size with the layers that are wanted, showing nothing yet.
    fn blank(&self) -> Image {
        let new = if self.with_layers { Image::with_layers } else { Image::new };
        new(self.width, self.height)
    }
}

/// What making a picture took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderStats {
    pub rays: RayCounts,
    /// Search for the nearest surface along primary rays, seconds of all threads divided by their number.
    pub trace_secs: f64,
    /// All of the picture, from a flat scene.
    pub frame_secs: f64,
}

/// Something that makes pictures of flat scenes.
pub trait Renderer {
    fn name(&self) -> &'static str;

    fn render(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)>;
}

/// Pixels of the largest picture.
pub const MAX_PIXELS: u64 = 1 << 28;

impl Settings {
    pub fn check(&self) -> Result<()> {
        let n_pixels = u64::from(self.width) * u64::from(self.height);
        if n_pixels == 0 || MAX_PIXELS < n_pixels {
            let found = format!("{}x{}", self.width, self.height);
            return Err(Error::Setting { name: "resolution", found, expected: "1 to 2^28 pixels" });
        }
        for (name, value) in
            [("samples per pixel", self.samples_per_pixel), ("light samples", self.light_samples)]
        {
            if !(1..=65_536).contains(&value) {
                return Err(Error::Setting {
                    name,
                    found: value.to_string(),
                    expected: "1 to 65536",
                });
            }
        }
        Ok(())
    }
}

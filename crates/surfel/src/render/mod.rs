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

/// A part of the work of a picture: who looks around wants to see something soon, and to stop in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// The first row of pixels, and the one behind the last.
    pub rows: (u32, u32),
    /// The same of the camera rays of each pixel.
    pub samples: (u32, u32),
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

/// Fails for scenes that no picture can be made of.
pub fn check(scene: &FlatScene) -> Result<()> {
    raster::is_asked_for(scene).map(drop)
}

/// Something that makes pictures of flat scenes.
pub trait Renderer: Sync {
    fn name(&self) -> &'static str;

    /// The rows of a piece, as the mean of its camera rays alone.
    fn render_piece(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        piece: Piece,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)>;

    /// The whole picture.
    fn render(
        &self,
        scene: &FlatScene,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<(Image, RenderStats)> {
        self.render_piece(scene, settings, settings.whole(), progress)
    }
}

/// Pixels of the largest picture.
pub const MAX_PIXELS: u64 = 1 << 28;

impl Settings {
    /// The rows of a piece with the layers that are wanted, showing nothing yet.
    fn blank(&self, piece: Piece) -> Image {
        let new = if self.with_layers { Image::with_layers } else { Image::new };
        new(self.width, piece.n_rows())
    }
}

impl Piece {
    fn n_rows(&self) -> u32 {
        self.rows.1 - self.rows.0
    }

    fn n_samples(&self) -> u32 {
        self.samples.1 - self.samples.0
    }

    /// Fails unless it is a part, and not an empty one, of the picture.
    fn check(&self, settings: &Settings) -> Result<()> {
        let whole = settings.whole();
        let is_in = |part: (u32, u32), whole: (u32, u32)| part.0 < part.1 && part.1 <= whole.1;
        if is_in(self.rows, whole.rows) && is_in(self.samples, whole.samples) {
            return Ok(());
        }
        let found = format!("rows {:?}, samples {:?}", self.rows, self.samples);
        Err(Error::Setting { name: "piece", found, expected: "a part of the picture" })
    }
}

impl Settings {
    /// All rows and camera rays.
    pub fn whole(&self) -> Piece {
        Piece { rows: (0, self.height), samples: (0, self.samples_per_pixel) }
    }

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

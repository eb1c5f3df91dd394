//! Settings of a picture, and their limits.

use super::footprint::POINT_SIZE_RANGE;
use crate::error::{Error, Result};

/// Size and quality of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of camera rays per pixel, or the greatest where some pixels need fewer.
    pub samples_per_pixel: u32,
    /// Standard error at which a block of pixels takes no further samples, relative to the square root of its brightness:
    /// 0.01 is about one of 255 steps. 0 gives all pixels the same number. GPUs take all samples.
    pub noise_threshold: f32,
    /// Number of rays per pixel toward each light with soft shadows: sky, environment, suns and punctual
    /// lights.
    pub light_samples: u32,
    /// Maximum number of reflections and refractions along a path.
    pub max_depth: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Diameter of rasterised points in pixels.
    pub point_size: f32,
    /// True if the image gets AOVs besides colour and coverage.
    pub with_aovs: bool,
}

/// Maximum number of pixels of a picture.
pub const MAX_PIXELS: u64 = 1 << 28;
/// Maximum number of camera or light samples per pixel.
pub const MAX_SAMPLES: u32 = 1 << 16;

impl Default for Settings {
    /// Returns 1920 x 1080 pixels, 4 camera rays and 16 light samples in each pixel, 8 bounces, seed 0, points of
    /// one pixel and no AOVs.
    fn default() -> Self {
        Self {
            width: 1920,
            height: 1080,
            samples_per_pixel: 4,
            noise_threshold: 0.0,
            light_samples: 16,
            max_depth: 8,
            seed: 0,
            point_size: 1.0,
            with_aovs: false,
        }
    }
}

impl Settings {
    /// Checks that all settings are within their limits.
    ///
    /// # Errors
    ///
    /// Fails if the picture has no pixels or more than [`MAX_PIXELS`], if a number of samples is 0 or
    /// above 65,536, if the noise threshold is no number from 0 to 1, or if points are smaller than 1 or larger than 64
    /// pixels.
    pub fn check(&self) -> Result<()> {
        let n_pixels = u64::from(self.width) * u64::from(self.height);
        if n_pixels == 0 || MAX_PIXELS < n_pixels {
            let found = format!("{}x{}", self.width, self.height);
            return Err(Error::Setting { name: "resolution", found, expected: "1 to 2^28 pixels" });
        }
        for (name, value) in
            [("samples per pixel", self.samples_per_pixel), ("light samples", self.light_samples)]
        {
            if !(1..=MAX_SAMPLES).contains(&value) {
                return Err(Error::Setting {
                    name,
                    found: value.to_string(),
                    expected: "1 to 65536",
                });
            }
        }
        if !(0.0..=1.0).contains(&self.noise_threshold) {
            let found = self.noise_threshold.to_string();
            return Err(Error::Setting { name: "noise threshold", found, expected: "0 to 1" });
        }
        let (min, max) = POINT_SIZE_RANGE;
        if !(min..=max).contains(&self.point_size) {
            let found = self.point_size.to_string();
            let expected = "1 to 64 pixels";
            return Err(Error::Setting { name: "point size", found, expected });
        }
        Ok(())
    }
}

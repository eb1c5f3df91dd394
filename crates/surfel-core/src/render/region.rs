//! Regions of a picture: some of its rows and columns, and some of the samples of their pixels.

use super::settings::Settings;
use crate::error::{Error, Result};
use crate::image::Image;

/// A part of a picture's rows, columns and samples, rendered at once.
///
/// An interactive viewer renders region by region, so that it shows a result early and can stop in time; several machines
/// render regions of one picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderRegion {
    /// Range of pixel rows: the first one, and the one after the last.
    pub rows: (u32, u32),
    /// Range of pixel columns: the first one, and the one after the last.
    pub columns: (u32, u32),
    /// Range of sample indices of each pixel: the first one, and the one after the last.
    pub samples: (u32, u32),
}

impl RenderRegion {
    /// Returns the region of the whole picture.
    pub fn whole(settings: &Settings) -> Self {
        Self {
            rows: (0, settings.height),
            columns: (0, settings.width),
            samples: (0, settings.samples_per_pixel),
        }
    }

    /// Returns the number of rows.
    pub fn n_rows(&self) -> u32 {
        self.rows.1 - self.rows.0
    }

    /// Returns the number of columns.
    pub fn n_columns(&self) -> u32 {
        self.columns.1 - self.columns.0
    }

    /// Returns the number of pixels.
    pub fn n_pixels(&self) -> u64 {
        u64::from(self.n_rows()) * u64::from(self.n_columns())
    }

    /// Returns the number of samples per pixel.
    pub fn n_samples(&self) -> u32 {
        self.samples.1 - self.samples.0
    }

    /// Returns an empty image of the region's size, with AOVs if the settings ask for them.
    pub fn blank_image(&self, settings: &Settings) -> Image {
        let new = if settings.with_aovs { Image::with_aovs } else { Image::new };
        new(self.n_columns(), self.n_rows())
    }

    /// Checks that the region is a part of the picture.
    ///
    /// # Errors
    ///
    /// Fails if the region is empty or extends beyond the picture.
    pub fn check(&self, settings: &Settings) -> Result<()> {
        let whole = Self::whole(settings);
        let is_within = |part: (u32, u32), whole: (u32, u32)| part.0 < part.1 && part.1 <= whole.1;
        let parts =
            [(self.rows, whole.rows), (self.columns, whole.columns), (self.samples, whole.samples)];
        if parts.into_iter().all(|(part, whole)| is_within(part, whole)) {
            return Ok(());
        }
        let Self { rows, columns, samples } = self;
        let found = format!("rows {rows:?}, columns {columns:?}, samples {samples:?}");
        Err(Error::Setting { name: "region", found, expected: "a part of the picture" })
    }
}

//! Rendered pictures and the files that they are saved to.

use crate::description::SceneDescription;
use crate::error::Result;
use crate::overlay::Overlay;
use std::ops::Deref;
use std::path::Path;
use surfel_core::flat::FlatScene;
use surfel_core::image::Image;
use surfel_core::math::DVec3;
use surfel_core::scene::Background;
use surfel_formats::{Alpha, Georeference, ImageOptions};

/// A rendered picture: linear colours and layers, and how they become a file.
#[derive(Clone, Debug)]
pub struct RenderedImage {
    image: Image,
    options: ImageOptions,
}

impl RenderedImage {
    /// Draws the overlay onto a picture of a scene, which becomes a file as the scene's description says.
    pub(crate) fn finish(
        mut image: Image,
        overlay: &Overlay,
        (flat, description): (&FlatScene, &SceneDescription),
        georeference: Option<Georeference>,
    ) -> Self {
        overlay.draw(&mut image, &flat.camera);
        let mut options = image_options(description, flat.origin);
        options.georeference = georeference.filter(|_| description.plan.is_to_scale());
        Self { image, options }
    }

    /// Writes the picture: for display as `.png`, `.jpg`, `.webp` or `.tif`, with all layers as `.exr`. The file is
    /// replaced once it is complete. A plan to scale that looks straight down is a GeoTIFF as `.tif`, and gets a world
    /// file beside it as `.png`, `.jpg` or `.webp`.
    ///
    /// # Errors
    ///
    /// Fails for other extensions, and if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        Ok(surfel_formats::save_image(path.as_ref(), &self.image, &self.options)?)
    }

    /// Drops all layers beside colour and coverage.
    pub fn drop_aovs(&mut self) {
        self.image.aovs = None;
    }

    /// Returns the bytes of a PNG.
    ///
    /// # Errors
    ///
    /// Fails if the picture is too large for the format.
    pub fn png_bytes(&self) -> Result<Vec<u8>> {
        Ok(surfel_formats::encode_png(&self.image, &self.options)?)
    }
}

impl Deref for RenderedImage {
    type Target = Image;

    fn deref(&self) -> &Image {
        &self.image
    }
}

/// Returns how a description's pictures become files; `origin` is the zero of their positions.
pub fn image_options(description: &SceneDescription, origin: DVec3) -> ImageOptions {
    let is_opaque = description.picture.background() != Background::Transparent;
    ImageOptions {
        depth: description.picture.bit_depth(),
        alpha: if is_opaque { Alpha::Drop } else { Alpha::Keep },
        origin,
        dpi: description.plan.stated_dpi(),
        georeference: None,
    }
}

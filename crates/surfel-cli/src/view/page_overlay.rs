//! Legend, scale bar, north arrow and caption on the pictures of a page.

use std::sync::{Mutex, PoisonError};
use surfel::overlay::{self, Overlay, Style};
use surfel_core::image::Image;
use surfel_core::scene::Camera;
use surfel_web::{PictureOverlay, PicturePart};

/// The overlay of a page's pictures.
struct PageOverlay {
    overlay: Overlay,
    /// The style of the last picture, which is kept while the camera moves.
    style: Mutex<Style>,
}

/// Returns an overlay as the viewer takes it; `None` if nothing is drawn.
pub fn page_overlay(overlay: Overlay) -> Option<Box<dyn PictureOverlay>> {
    let is_empty = overlay.is_empty();
    (!is_empty).then(|| Box::new(PageOverlay { overlay, style: Mutex::default() }) as _)
}

impl PictureOverlay for PageOverlay {
    fn draw(&self, image: &mut Image, camera: &Camera) {
        let mut style = Style::default();
        self.overlay.draw_in_style(image, camera, &mut style);
        *self.style.lock().unwrap_or_else(PoisonError::into_inner) = style;
    }

    fn patches(
        &self,
        draft: &Image,
        size: (u32, u32),
        camera: &Camera,
        is_moving: bool,
    ) -> Vec<PicturePart> {
        let mut style = self.style.lock().unwrap_or_else(PoisonError::into_inner);
        if !is_moving {
            *style = Style::default();
        }
        let patches = self.overlay.patches(draft, size, camera, &mut style).into_iter();
        patches.map(|overlay::Patch { x, y, image }| PicturePart { x, y, image }).collect()
    }
}

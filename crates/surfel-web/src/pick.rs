//! What is behind a pixel.

use crate::client::Sight;
use crate::studio::{Place, Stage};
use std::sync::Arc;
use surfel::image::NO_ID;
use surfel::math::DVec3;
use surfel::progress::Progress;
use surfel::render::{Piece, Renderer, Settings};

/// The surface at a place in the page's picture, in pixels from its top left corner.
///
/// Paints the row of that pixel alone: what is found is what is seen, whatever paints it.
pub fn pick(
    renderer: &dyn Renderer,
    sight: &Sight,
    (x, y): (f64, f64),
    progress: &dyn Progress,
) -> Option<(Arc<Stage>, Place)> {
    let (stage, camera) = (sight.stage.clone()?, sight.camera?);
    let (width, height) = sight.size;
    let is_in = (0.0..f64::from(width)).contains(&x) && (0.0..f64::from(height)).contains(&y);
    if !is_in {
        return None;
    }
    let settings = Settings {
        width,
        height,
        samples_per_pixel: 1,
        light_samples: 1,
        max_depth: 0,
        with_layers: true,
        ..stage.quality
    };
    let (column, row) = (x as usize, y as u32);
    let piece = Piece { rows: (row, row + 1), samples: (0, 1) };
    let mut scene = stage.flat.clone();
    scene.camera = camera;
    let (image, _) = renderer.render_piece(&scene, &settings, piece, progress).ok()?;
    let layers = image.layers?;
    let place = Place {
        instance: layers.instance_id[column],
        id: layers.point_id[column],
        position: stage.flat.origin + DVec3::from(layers.position[column]),
        normal: layers.normal[column],
        depth: f64::from(layers.depth[column]),
    };
    (place.instance != NO_ID).then_some((stage, place))
}

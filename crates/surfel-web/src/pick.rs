//! Picking: the point of the scene behind a pixel.

use crate::scene_provider::{PickedPoint, PreparedScene, Result};
use crate::view::ViewState;
use std::sync::Arc;
use surfel_core::image::NO_ID;
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, Renderer, Settings};

/// The scene and the point behind a pixel of the page's picture, given in pixels from its top left corner; none
/// if there is no surface.
///
/// The row of that pixel is rendered, so that the result agrees with the picture for every renderer.
///
/// # Errors
///
/// Fails if rendering fails or is cancelled.
pub fn pick(
    renderer: &dyn Renderer,
    view: &ViewState,
    (x, y): (f64, f64),
    progress: &dyn Progress,
) -> Result<Option<(Arc<PreparedScene>, PickedPoint)>> {
    let Some((prepared, camera)) = view.scene.clone().zip(view.camera) else { return Ok(None) };
    let (width, height) = view.size;
    let is_inside = (0.0..f64::from(width)).contains(&x) && (0.0..f64::from(height)).contains(&y);
    if !is_inside {
        return Ok(None);
    }
    let settings = Settings {
        width,
        height,
        samples_per_pixel: 1,
        light_samples: 1,
        max_depth: 0,
        with_aovs: true,
        ..prepared.render_settings
    };
    let (column, row) = (x as usize, y as u32);
    let region =
        RenderRegion { rows: (row, row + 1), samples: (0, 1), ..RenderRegion::whole(&settings) };
    let mut scene = prepared.flat.clone();
    scene.camera = camera;
    let (image, _) = renderer.render_region(&scene, &settings, region, progress)?;
    let Some(aovs) = image.aovs else { return Ok(None) };
    let point = PickedPoint {
        instance_idx: aovs.instance_id[column],
        primitive_idx: aovs.point_id[column],
        position: prepared.flat.origin + DVec3::from(aovs.position[column]),
        normal: aovs.normal[column],
        depth: f64::from(aovs.depth[column]),
    };
    Ok((point.instance_idx != NO_ID).then_some((prepared, point)))
}

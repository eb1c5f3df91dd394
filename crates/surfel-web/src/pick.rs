//! Picking: the point of the scene behind a pixel.

use crate::scene_provider::{PickedPoint, PreparedScene};
use crate::view::ViewState;
use std::sync::Arc;
use surfel_core::image::NO_ID;
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;
use surfel_core::render::{RenderRegion, Renderer, Settings};

/// The scene and the point behind a pixel of the page's picture, given in pixels from its top left corner; none
/// if there is no surface or if rendering is cancelled.
///
/// The row of that pixel is rendered, so that the result agrees with the picture for every renderer.
pub fn pick(
    renderer: &dyn Renderer,
    view: &ViewState,
    (x, y): (f64, f64),
    progress: &dyn Progress,
) -> Option<(Arc<PreparedScene>, PickedPoint)> {
    let (prepared, camera) = (view.scene.clone()?, view.camera?);
    let (width, height) = view.size;
    let is_inside = (0.0..f64::from(width)).contains(&x) && (0.0..f64::from(height)).contains(&y);
    if !is_inside {
        return None;
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
    let (image, _) = renderer.render_region(&scene, &settings, region, progress).ok()?;
    let aovs = image.aovs?;
    let point = PickedPoint {
        instance_idx: aovs.instance_id[column],
        primitive_idx: aovs.point_id[column],
        position: prepared.flat.origin + DVec3::from(aovs.position[column]),
        normal: aovs.normal[column],
        depth: f64::from(aovs.depth[column]),
    };
    (point.instance_idx != NO_ID).then_some((prepared, point))
}

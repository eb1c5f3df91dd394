//! Visibility of points: a page's camera sees those that no surface hides.

use crate::scene_provider::{Error, Result};
use crate::view::ViewState;
use surfel_core::math::{Aabb, DVec3};
use surfel_core::trace::{InstanceFilter, Simd, scene_occlusions};

/// Maximum number of points of a message.
const MAX_POINTS: usize = 2000;
/// Length before a point in which surfaces do not hide it, because it lies on one: as a fraction of its distance from the
/// camera, or of the size of the scene if that is more.
const MARGIN: f32 = 0.01;
const MARGIN_OF_SCENE: f32 = 0.002;

/// Returns for each point, in world coordinates, whether the page's camera sees it. Points behind the camera are
/// seen.
///
/// # Errors
///
/// Fails if there are too many points, if a number is not finite, and if there is no scene yet.
pub fn visibility(view: &ViewState, points: &[[f64; 3]]) -> Result<Vec<bool>> {
    if MAX_POINTS < points.len() || points.iter().flatten().any(|number| !number.is_finite()) {
        let text = format!("visible: expected at most {MAX_POINTS} points of finite numbers");
        return Err(Error::invalid_request(text));
    }
    let Some((scene, camera)) = view.scene.as_ref().zip(view.camera) else {
        return Err(Error::invalid_request("there is nothing to show yet"));
    };
    let seen_from = camera.view(scene.flat.origin, view.size.0, view.size.1);
    let boxes = scene.flat.instances.iter().map(|instance| instance.bounds);
    let least_margin = MARGIN_OF_SCENE * boxes.fold(Aabb::EMPTY, Aabb::union).diagonal();
    let local = points.iter().map(|point| (DVec3::from(*point) - scene.flat.origin).as_vec3());
    let (rays, indices): (Vec<_>, Vec<_>) = local
        .enumerate()
        .filter_map(|(i, position)| {
            let (x, y, _) = seen_from.project(position)?;
            let mut ray = seen_from.ray(x, y);
            let distance = (position - ray.origin).dot(ray.direction);
            ray.t_max = distance - least_margin.max(MARGIN * distance);
            (0.0 < ray.t_max).then_some((ray, i))
        })
        .unzip();
    let mut hidden = vec![false; rays.len()];
    scene_occlusions(&scene.flat, Simd::detect(), InstanceFilter::All, &rays, &mut hidden);
    let mut visible = vec![true; points.len()];
    for (i, is_hidden) in indices.into_iter().zip(hidden) {
        visible[i] = !is_hidden;
    }
    Ok(visible)
}

//! Movies of a live scene, whose files are not read again.

use crate::animate::{frame_count, movie_options};
use crate::description::SceneDescription;
use crate::error::{Error, Result};
use crate::live_scene::LiveScene;
use crate::live_view::LiveView;
use crate::picture::image_options;
use crate::progress_log::CancelOnly;
use crate::resolve::camera_motion;
use std::path::Path;
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::Camera;
use surfel_formats::{Movie, MovieOptions};

/// Returns the number of frames of the movie of a description.
///
/// # Errors
///
/// Fails if nothing moves, and for movements that are not valid.
pub fn film_length(scene: &LiveScene, description: &SceneDescription) -> Result<u32> {
    let path_secs = camera_motion(description)?.map_or(0.0, |motion| motion.duration_secs());
    Ok(frame_count(description, scene.loaded().duration_secs().max(path_secs))?)
}

/// Renders the movie of a description to a file, on threads of the lowest priority: the same frames as `surfel animate`.
/// Returns their number.
///
/// # Errors
///
/// Fails for settings that do not fit the data, if nothing moves, if a frame cannot be rendered or written, and if
/// cancelled; then no file is left.
pub fn film(
    scene: &LiveScene,
    description: &SceneDescription,
    output: &Path,
    progress: &dyn Progress,
) -> Result<u32> {
    let quiet = CancelOnly(progress);
    let n_frames = film_length(scene, description)?;
    let mut view = view_at(scene, description, 0.0, &quiet)?;
    let image = image_options(description, view.flat.origin);
    let options = MovieOptions { n_frames, image, ..movie_options(description) };
    let mut movie = Movie::open(output, &options, false)?;
    let moves_objects = 0.0 < scene.loaded().duration_secs();
    progress.begin("film", u64::from(n_frames));
    for frame in 0..n_frames {
        let time_secs = f64::from(frame) / options.fps;
        if moves_objects {
            view = view_at(scene, description, time_secs, &quiet)?;
        } else {
            view.flat.camera = camera_at(&view, description, time_secs)?;
        }
        let mut picture = scene.render(&view, &quiet)?;
        let mut overlay = view.overlay();
        overlay.is_fixed = true;
        overlay.draw(&mut picture, &view.flat.camera);
        movie.add_frame(frame, &picture)?;
        progress.advance(1);
    }
    progress.end();
    movie.finish(progress).map_err(Error::from)?;
    Ok(n_frames)
}

fn view_at(
    scene: &LiveScene,
    description: &SceneDescription,
    time_secs: f64,
    progress: &dyn Progress,
) -> Result<LiveView> {
    let mut at = description.clone();
    at.output.time = Some(time_secs);
    scene.view(&at, progress)
}

/// The camera of a view at another time, if nothing else moves.
fn camera_at(view: &LiveView, description: &SceneDescription, time_secs: f64) -> Result<Camera> {
    let camera = view.flat.camera;
    let up = view.description.world.up.unwrap_or(Vec3::Z);
    let motion = camera_motion(description)?;
    Ok(motion.map_or(camera, |motion| motion.at(time_secs, camera, up)))
}

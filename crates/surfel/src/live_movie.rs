//! Movies of a live scene, whose files are not read again.

use crate::animate::{frame_count, movie_options, write_movie};
use crate::built_scene::turn;
use crate::description::SceneDescription;
use crate::error::{Error, Result};
use crate::live_scene::LiveScene;
use crate::live_view::LiveView;
use crate::picture::image_options;
use crate::progress_log::CancelOnly;
use crate::resolve::camera_motion;
use std::f64::consts::TAU;
use std::path::Path;
use surfel_core::flat::FlatScene;
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::Camera;
use surfel_formats::MovieOptions;

/// Returns the number of frames of the movie of a description.
///
/// # Errors
///
/// Fails if nothing moves, and for movements that are not valid.
pub fn movie_length(scene: &LiveScene, description: &SceneDescription) -> Result<u32> {
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
pub fn movie(
    scene: &LiveScene,
    description: &SceneDescription,
    output: &Path,
    progress: &dyn Progress,
) -> Result<u32> {
    let quiet = CancelOnly(progress);
    let n_frames = movie_length(scene, description)?;
    let mut view = view_at(scene, description, 0.0, &quiet)?;
    // One exposure is chosen for all frames.
    let mut exposed = description.clone();
    exposed.light.exposure = view.description.light.exposure;
    let image = image_options(description, view.flat.origin);
    let options = MovieOptions { n_frames, image, ..movie_options(description) };
    let moves_objects = 0.0 < scene.loaded().duration_secs();
    let FlatScene { camera, lights, punctual_lights, .. } = &view.flat;
    let (camera, lights, lamps) = (*camera, lights.clone(), punctual_lights.clone());
    let written = write_movie(output, &options, false, progress, |time_secs| {
        if moves_objects {
            view = view_at(scene, &exposed, time_secs, &quiet)?;
        } else {
            view.flat.camera = camera_at(camera, &view, description, time_secs)?;
            view.flat.lights.clone_from(&lights);
            view.flat.punctual_lights.clone_from(&lamps);
        }
        if let Some(seconds) = description.output.turntable {
            let (up, room) = (up_of(&view), view.turned_room.as_ref());
            turn(&mut view.flat, up, room, TAU * time_secs / seconds);
        }
        Ok(view.finished_frame(scene.render(&view, &quiet)?))
    });
    match written {
        // The page cannot continue a movie.
        Err(Error::Unfinished { cause, .. }) => Err(*cause),
        written => written.map(|()| n_frames),
    }
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

/// The first camera of a view at another time, if nothing else moves.
fn camera_at(
    first: Camera,
    view: &LiveView,
    description: &SceneDescription,
    time_secs: f64,
) -> Result<Camera> {
    let motion = camera_motion(description)?;
    Ok(motion.map_or(first, |motion| motion.at(time_secs, first, up_of(view))))
}

/// The up axis of a view, which its complete description has.
fn up_of(view: &LiveView) -> Vec3 {
    view.description.world.up.unwrap_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    //! The frames of movies.

    use super::*;
    use crate::animate::PlannedMovie;
    use crate::live_scene::UseCase;
    use crate::memory_files::MemoryContent;
    use std::sync::Arc;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    #[test]
    fn a_movie_of_a_turntable_has_the_frames_of_its_animation() {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, (i % 3) as f32);
        let cloud = PointCloud::from_positions((0..400).map(corner).collect());
        let mut description = SceneDescription::of_files(["memory:corner"]);
        description.memory.insert("memory:corner", MemoryContent::Points(Arc::new(cloud), None));
        (description.output.turntable, description.output.fps) = (Some(4.0), Some(1.0));
        description.picture.resolution = Some((64, 36));
        (description.picture.spp, description.picture.light_samples) = (Some(1), Some(1));
        let name = |part: &str| format!("surfel-movie-{part}-{}.gif", std::process::id());
        let [exported, animated] =
            ["exported", "animated"].map(|part| std::env::temp_dir().join(name(part)));
        let scene = LiveScene::open(&description, UseCase::Viewers, &NoProgress).unwrap();
        assert_eq!(movie(&scene, &description, &exported, &NoProgress).unwrap(), 4);
        let movie = PlannedMovie::new(&description, &NoProgress).unwrap();
        movie.render(&animated, false, &NoProgress).unwrap();
        let [of_movie, of_animation] =
            [&exported, &animated].map(|path| std::fs::read(path).unwrap());
        [exported, animated].iter().for_each(|path| std::fs::remove_file(path).unwrap());
        assert!(of_movie == of_animation);
    }
}

//! Movies.

use crate::errors::{invalid_setting, to_exception};
use crate::scene::PyScene;
use crate::threads::{on_threads, start_threads};
use crate::value::with_keys;
use crate::work;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use surfel::animate::{PlannedMovie, movie_options};
use surfel::description::Invalid;

/// Renders a movie of a scene: what moves in it, or a turn (`turntable=SECONDS`).
///
/// `output`: .mp4, .mov, .mkv, .webm or .avi (by ffmpeg), .gif, .png (an animated one), or numbered pictures as
/// frame_####.png. `frames`: a number, or `range(n)`; all that move if it is left out. `resume=True` continues an
/// interrupted run of the same movie. `progress` is called as `progress(stage, done, total)`. Other keywords are keys of
/// scene files, as `fps` and `turntable`.
///
/// Raises `InvalidSetting`, `InvalidScene`, `EncoderError`, `InaccessibleFile`.
#[pyfunction]
#[pyo3(signature = (scene, output, *, frames = None, resume = false, progress = None, **keys))]
pub fn animate(
    py: Python<'_>,
    scene: &Bound<'_, PyScene>,
    output: PathBuf,
    frames: Option<&Bound<'_, PyAny>>,
    resume: bool,
    progress: Option<&Bound<'_, PyAny>>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<()> {
    let mut description = with_keys(py, &scene.get().description(), keys)?;
    if let Some(frames) = frames {
        description.output.frames = Some(n_frames(frames)?);
    }
    description.output.output = Some(output.clone());
    surfel_formats::check_movie(&output, &movie_options(&description))
        .map_err(|error| to_exception(py, &error.into()))?;
    work::run(py, progress, |progress| {
        let threads = start_threads(&description.run)?;
        on_threads(threads.as_ref(), || {
            PlannedMovie::new(&description, progress)?.render(&output, resume, progress)
        })
    })
}

/// Reads a number of frames, or a range that begins with the first one.
fn n_frames(frames: &Bound<'_, PyAny>) -> PyResult<u32> {
    let range = |name| frames.getattr(name).and_then(|value| value.extract::<u32>());
    match (frames.extract::<u32>(), range("start"), range("stop"), range("step")) {
        (Ok(n), ..) | (_, Ok(0), Ok(n), Ok(1)) if 0 < n => Ok(n),
        _ => {
            let message = format!("found {}, expected a number or range(n)", frames.repr()?);
            Err(invalid_setting(frames.py(), Invalid::at("frames", message)))
        }
    }
}

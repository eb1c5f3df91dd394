//! Movies.

use crate::errors::{invalid_setting, to_exception};
use crate::image::{PixelIds, PyImage};
use crate::scene::{PyScene, check_is_not_empty};
use crate::threads::{on_threads, own_threads};
use crate::value::with_keys;
use crate::work;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;
use std::path::PathBuf;
use std::sync::Mutex;
use surfel::animate::{BuiltMovie, PlannedMovie, check_movie};
use surfel::description::Invalid;
use surfel::progress_log::ProgressLog;
use surfel::{Choice, RenderedImage};
use surfel_core::locks::lock_unless_cancelled;
use surfel_core::math::DVec3;
use surfel_core::progress::Progress;

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
    check_is_not_empty(py, &description)?;
    if let Some(frames) = frames {
        description.output.frames = Some(n_frames(frames)?);
    }
    description.output.output = Some(output.clone());
    check_movie(&output, &description).map_err(|error| to_exception(py, &error))?;
    work::run(py, progress, |progress| {
        let threads = own_threads(&description.run)?;
        on_threads(threads.as_ref(), || {
            PlannedMovie::new(&description, progress)?.render(&output, resume, progress)
        })
    })
}

/// The frames of a movie of a scene as it is now, one by one and in any order: pictures of the colour alone. Keywords are
/// keys of scene files, as `fps`, `frames` and `turntable` (seconds of a turn).
///
/// `movie[0]` is the first frame, `movie[-1]` the last one; `for image in movie` renders each. `progress` is called as
/// `progress(stage, done, total)` while the scene is read.
///
/// Raises `InvalidSetting` if nothing moves and neither `frames` nor `turntable` is given.
#[pyclass(frozen, module = "surfel", name = "Movie")]
pub struct PyMovie {
    movie: Mutex<BuiltMovie>,
    n_frames: u32,
    /// About how many bytes the scene takes.
    memory_estimate: u64,
    threads: Option<ThreadPool>,
    choices: Vec<Choice>,
}

#[pymethods]
impl PyMovie {
    #[new]
    #[pyo3(signature = (scene, *, progress = None, **keys))]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyScene>,
        progress: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let description = with_keys(py, &scene.get().description(), keys)?;
        check_is_not_empty(py, &description)?;
        work::run(py, progress, |progress| {
            let threads = own_threads(&description.run)?;
            let log = ProgressLog::new(progress);
            let planned = on_threads(threads.as_ref(), || PlannedMovie::new(&description, &log))?;
            let memory_estimate = planned.memory_estimate();
            let movie = on_threads(threads.as_ref(), || planned.build(&log))?;
            let n_frames = movie.n_frames();
            let (movie, choices) = (Mutex::new(movie), log.into_records().choices);
            Ok(Self { movie, n_frames, memory_estimate, threads, choices })
        })
    }

    /// The number of frames.
    fn __len__(&self) -> usize {
        self.n_frames as usize
    }

    /// Returns about how many bytes the movie takes.
    fn _memory_estimate(&self) -> u64 {
        self.memory_estimate
    }

    /// Renders a frame, from the end where `index` is negative.
    fn __getitem__(&self, py: Python<'_>, index: i64) -> PyResult<PyImage> {
        let from_end = if index < 0 { i64::from(self.n_frames) } else { 0 };
        let index = u32::try_from(index + from_end).unwrap_or(u32::MAX);
        self.rendered(py, index, None)
    }

    /// Renders one frame after the other.
    fn __iter__<'py>(movie: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let builtins = movie.py().import("builtins")?;
        let indices = builtins.call_method1("range", (movie.get().n_frames,))?;
        builtins.call_method1("map", (movie.getattr("render")?, indices))
    }

    /// Renders a frame, counted from 0: the picture that `animate` would write, without layers but the colour.
    ///
    /// Raises `IndexError` beyond the last one, `InvalidSetting` for negative numbers.
    #[pyo3(signature = (index, *, progress = None))]
    fn render(
        &self,
        py: Python<'_>,
        index: i64,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyImage> {
        if index < 0 {
            let message = format!("found {index}, expected 0 to {}", self.n_frames - 1);
            return Err(invalid_setting(py, Invalid::at("index", message)));
        }
        self.rendered(py, u32::try_from(index).unwrap_or(u32::MAX), progress)
    }

    /// Renders a frame to a file as `animate` would write it, of .exr with all layers.
    fn _save(&self, py: Python<'_>, index: u32, path: PathBuf) -> PyResult<()> {
        self.check(index)?;
        work::run(py, None, |progress| self.frame(index, progress)?.0.save(path))
    }
}

impl PyMovie {
    fn rendered(
        &self,
        py: Python<'_>,
        index: u32,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyImage> {
        self.check(index)?;
        work::run(py, progress, |progress| {
            let (mut image, origin) = self.frame(index, progress)?;
            // Movies keep no index that points had when they were read.
            image.drop_aovs();
            Ok(PyImage::new(image, origin, PixelIds::default(), &self.choices))
        })
    }

    fn check(&self, index: u32) -> PyResult<()> {
        if index < self.n_frames {
            return Ok(());
        }
        let message = format!("frame {index}: expected 0 to {}", self.n_frames - 1);
        Err(PyIndexError::new_err(message))
    }

    /// Renders a frame; returns it with the origin of its positions.
    fn frame(&self, index: u32, progress: &dyn Progress) -> surfel::Result<(RenderedImage, DVec3)> {
        let mut movie = lock_unless_cancelled(&self.movie, progress)?;
        let movie = &mut *movie;
        let image = on_threads(self.threads.as_ref(), || movie.render_frame(index, progress))?;
        Ok((image, movie.origin()))
    }
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

//! Movies, frame by frame: video by ffmpeg, animated GIF and PNG, or a picture a frame.
//!
//! Each frame is kept as a picture from the moment it is done, and the film is put together from
//! these pictures at the end. So a run that was stopped is taken up where it ended, whatever the kind.

mod format;
mod rate;
mod names;
mod plan;
mod kept;
mod apng;
mod gif;
mod video;

use std::ffi::OsStr;
use std::path::Path;

use surfel::image::Image;
use surfel::progress::Progress;

use crate::error::{Error, Result};
use crate::picture::{ImageOptions, save_image};

use kept::Kept;
use plan::Plan;

pub use format::{Container, MovieFormat};

/// What a movie is made of, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieOptions {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Frames a second, from 0.01 to 1000; at most 50 for GIF. Numbered pictures do not hold it.
    pub fps: f64,
    /// At least 1.
    pub n_frames: u32,
    /// How frames are stored. Video and GIF are always of eight bits, shown over black.
    pub image: ImageOptions,
    /// All else that a frame's content depends on, in any words: frames are taken over from an
    /// earlier run only if its fingerprint, size, number of frames, depth and alpha were the same.
    pub fingerprint: String,
}

/// A movie in the making.
///
/// Until it is finished, its frames are kept as `000001.png`, `000002.png` and so on in a folder
/// beside it, `film.mp4.frames`, with a file `settings` that says how they were made and which are
/// done. Numbered pictures are written under their own names, and that file is `.frame_####.png.surfel`.
/// Dropped unfinished, a movie leaves these for a later run, if any frame was done.
///
/// ```
/// use surfel::image::Image;
/// use surfel::progress::Silent;
/// use surfel_formats::{ImageOptions, Movie, MovieOptions};
///
/// # fn main() -> Result<(), surfel_formats::Error> {
/// let path = std::env::temp_dir().join(format!("turn-{}.gif", std::process::id()));
/// let options = MovieOptions {
///     width: 32,
///     height: 24,
///     fps: 25.0,
///     n_frames: 3,
///     image: ImageOptions::default(),
///     fingerprint: "church.laz, once around".into(),
/// };
/// let mut movie = Movie::open(&path, &options, false)?;
/// for frame in 0..options.n_frames {
///     if !movie.has(frame) {
///         movie.add(frame, &Image::new(options.width, options.height))?;
///     }
/// }
/// movie.finish(&Silent)?;
/// assert!(path.exists());
/// # std::fs::remove_file(&path).unwrap();
/// # Ok(())
/// # }
/// ```
pub struct Movie {
    plan: Plan,
    kept: Kept,
}

/// The program that makes video, as found by the system.
const FFMPEG: &str = "ffmpeg";

/// Tells early whether such a movie can be written to `path`.
///
/// Fails if the format is not known or cannot hold such frames, or if the folder does not exist;
/// for video also if ffmpeg is missing or refuses a first frame of this size. Writes nothing.
pub fn check_movie(path: &Path, options: &MovieOptions) -> Result<()> {
    check(&Plan::new(path, options)?)
}

impl Movie {
    /// Begins a movie, or with `resume` goes on with one that was begun before.
    ///
    /// Fails as [`check_movie`] does, and if the frames to resume from were made with other settings.
    /// Where none were begun, `resume` changes nothing. Without it, frames that a run left unfinished
    /// are forgotten; numbered pictures of an earlier run stay until new ones take their places.
    pub fn open(path: &Path, options: &MovieOptions, resume: bool) -> Result<Self> {
        let plan = Plan::new(path, options)?;
        check(&plan)?;
        let kept = Kept::open(&plan, resume)?;
        Ok(Self { plan, kept })
    }

    /// Whether a frame, counted from 0, is done and need not be made again.
    pub fn has(&self, frame: u32) -> bool {
        self.kept.done.contains(&frame)
    }

    pub fn n_done(&self) -> u32 {
        self.kept.done.len() as u32
    }

    /// Keeps `image` as a frame, counted from 0, in any order; one that is there already is replaced.
    ///
    /// Fails if there is no such frame, if the image has another size, or if it cannot be written.
    pub fn add(&mut self, frame: u32, image: &Image) -> Result<()> {
        let options = &self.plan.options;
        let expected = (options.width, options.height);
        if options.n_frames <= frame || (image.width, image.height) != expected {
            return Err(Error::Frames {
                file: self.plan.file(),
                found: format!("frame {frame} of {}x{} pixels", image.width, image.height),
                expected: format!(
                    "frames 0 to {} of {}x{}",
                    options.n_frames - 1,
                    expected.0,
                    expected.1
                ),
                advice: "render what was announced",
            });
        }
        save_image(&self.plan.names.path(frame), image, &options.image)?;
        self.kept.note(frame)
    }

    /// Puts the film together and removes what was kept for it.
    ///
    /// Fails if frames are missing, if one cannot be read back, if the film cannot be written, or if
    /// ffmpeg fails; an old film and the frames then stay, as they do if the work is cancelled.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<()> {
        let n_frames = self.plan.options.n_frames;
        if self.n_done() < n_frames {
            return Err(Error::Frames {
                file: self.plan.file(),
                found: format!("{} of {n_frames} frames", self.n_done()),
                expected: "all".into(),
                advice: "run again with --resume to make the others",
            });
        }
        progress.check()?;
        match self.plan.format {
            MovieFormat::Video(container) => {
                video::write(&self.plan, container, OsStr::new(FFMPEG), progress)?;
            }
            MovieFormat::Gif => gif::write(&self.plan, progress)?,
            MovieFormat::Apng => apng::write(&self.plan, progress)?,
            MovieFormat::Pictures => {}
        }
        self.kept.done.clear();
        Ok(())
    }
}

fn check(plan: &Plan) -> Result<()> {
    match plan.format {
        MovieFormat::Video(container) => video::check(plan, container, OsStr::new(FFMPEG)),
        _ => Ok(()),
    }
}

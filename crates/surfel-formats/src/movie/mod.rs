//! Movies, written frame by frame: video through ffmpeg, animated GIF and PNG, or an image sequence.
//!
//! Each finished frame is stored as an image, and the movie is encoded from these images at the end. An
//! interrupted run can therefore be resumed, whatever the format.

mod options;
mod format;
mod frame_rate;
mod frame_names;
mod spec;
mod frame_log;
mod apng;
mod gif;
mod ffmpeg;
mod video;

use std::ffi::OsStr;
use std::io::Write;
use std::path::Path;
use surfel_core::words::counted;

use surfel_core::image::Image;
use surfel_core::progress::Progress;

use crate::error::{Error, Result};
use crate::file::{write_error, write_file};
use crate::image_file::save_image;

use format::MovieFormat;
use frame_log::FrameLog;
use spec::MovieSpec;

pub use options::MovieOptions;

/// A movie that is being written.
///
/// Until [`Movie::finish`], the frames are stored as `000001.png`, `000002.png` and so on in a folder next to
/// the movie, `turn.mp4.frames`, with a file `settings` that records the settings and the finished frames. An
/// image sequence is written under its final names, and that file is `.frame_####.png.surfel`. A movie that
/// is dropped unfinished leaves these files for a later run if at least one frame is done.
///
/// ```
/// use surfel_core::image::Image;
/// use surfel_core::progress::NoProgress;
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
///     fingerprint: "church.laz, turntable".into(),
/// };
/// let mut movie = Movie::open(&path, &options, false)?;
/// for frame in 0..options.n_frames {
///     if !movie.has_frame(frame) {
///         movie.add_frame(frame, &Image::new(options.width, options.height))?;
///     }
/// }
/// movie.finish(&NoProgress)?;
/// assert!(path.exists());
/// # std::fs::remove_file(&path).unwrap();
/// # Ok(())
/// # }
/// ```
pub struct Movie {
    spec: MovieSpec,
    log: FrameLog,
}

/// Checks that a movie with these options can be written to `path`, without writing anything.
///
/// # Errors
///
/// Fails if the format is unknown or does not support such frames, or if the folder does not exist; for video
/// also if ffmpeg is missing or rejects a test frame of this size.
pub fn check_movie(path: &Path, options: &MovieOptions) -> Result<()> {
    check_encoder(&MovieSpec::new(path, options)?)
}

impl Movie {
    /// Starts a movie. With `resume` it continues one that an earlier run left unfinished, if there is one.
    ///
    /// If `resume` is false, unfinished frames of an earlier run are discarded; an older image sequence stays
    /// until new images replace it.
    ///
    /// # Errors
    ///
    /// Fails like [`check_movie`], and if the frames to resume from were made with other settings.
    pub fn open(path: &Path, options: &MovieOptions, resume: bool) -> Result<Self> {
        let spec = MovieSpec::new(path, options)?;
        check_encoder(&spec)?;
        let log = FrameLog::open(&spec, resume)?;
        Ok(Self { spec, log })
    }

    /// Returns true if the frame is already done. Frames are counted from 0.
    pub fn has_frame(&self, frame: u32) -> bool {
        self.log.done.contains(&frame)
    }

    /// Returns the number of finished frames.
    pub fn n_done(&self) -> u32 {
        self.log.done.len() as u32
    }

    /// Stores `image` as a frame, counted from 0. Frames may come in any order and replace earlier versions.
    ///
    /// # Errors
    ///
    /// Fails if the index or the size of the image does not match the options, or if a file cannot be
    /// written.
    pub fn add_frame(&mut self, frame: u32, image: &Image) -> Result<()> {
        let options = &self.spec.options;
        let expected = (options.width, options.height);
        if options.n_frames <= frame || (image.width, image.height) != expected {
            return Err(Error::InvalidFrames {
                file: self.spec.file(),
                found: format!("frame {frame} of {}x{} pixels", image.width, image.height),
                expected: format!(
                    "frames 0 to {} of {}x{}",
                    options.n_frames - 1,
                    expected.0,
                    expected.1
                ),
                advice: "render the announced size and number of frames",
            });
        }
        save_image(&self.spec.names.path(frame), image, &options.image)?;
        self.log.record(frame)
    }

    /// Stores the bytes of a file as a frame, counted from 0. The file has the format that
    /// [`frame_format`](Self::frame_format) names.
    ///
    /// # Errors
    ///
    /// Fails if there is no such frame, or if the file cannot be written.
    pub fn add_encoded_frame(&mut self, frame: u32, bytes: &[u8]) -> Result<()> {
        let n_frames = self.spec.options.n_frames;
        if n_frames <= frame {
            return Err(Error::InvalidFrames {
                file: self.spec.file(),
                found: format!("frame {frame}"),
                expected: format!("frames 0 to {}", n_frames - 1),
                advice: "render the announced number of frames",
            });
        }
        let path = self.spec.names.path(frame);
        write_file(&path, |writer| {
            writer.write_all(bytes).map_err(|cause| write_error(&path, cause))
        })?;
        self.log.record(frame)
    }

    /// Returns the extension of the files of frames, without a dot.
    pub fn frame_format(&self) -> String {
        let path = self.spec.names.path(0);
        path.extension().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Encodes the movie and removes its temporary files.
    ///
    /// # Errors
    ///
    /// Fails if frames are missing or cannot be read back, if the movie cannot be written, if ffmpeg fails, or
    /// if `progress` cancels. The stored frames and an existing file at the path then stay.
    pub fn finish(mut self, progress: &dyn Progress) -> Result<()> {
        let n_frames = self.spec.options.n_frames;
        if self.n_done() < n_frames {
            return Err(Error::InvalidFrames {
                file: self.spec.file(),
                found: format!("{} of {}", self.n_done(), counted(n_frames, "frame")),
                expected: "all".into(),
                advice: "make the others [resume]",
            });
        }
        progress.check()?;
        match self.spec.format {
            MovieFormat::Video(container) => {
                video::write(&self.spec, container, OsStr::new(ffmpeg::PROGRAM), progress)?;
            }
            MovieFormat::Gif => gif::write(&self.spec, progress)?,
            MovieFormat::Apng => apng::write(&self.spec, progress)?,
            MovieFormat::ImageSequence => {}
        }
        self.log.done.clear();
        Ok(())
    }
}

/// Checks that ffmpeg accepts the movie, if its format needs ffmpeg.
fn check_encoder(spec: &MovieSpec) -> Result<()> {
    match spec.format {
        MovieFormat::Video(container) => video::check(spec, container, OsStr::new(ffmpeg::PROGRAM)),
        _ => Ok(()),
    }
}

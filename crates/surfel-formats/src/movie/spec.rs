//! A validated movie: its format, names and timing, derived from its path and options.

use std::path::{Path, PathBuf};

use surfel_core::render::MAX_PIXELS;

use crate::error::{Error, Result};
use crate::file::check_output_path;
use crate::image_file::{Alpha, BitDepth, ImageOptions, check_image_size, png};

use super::format::MovieFormat;
use super::frame_names::FrameNames;
use super::frame_rate::FrameRate;
use super::options::MovieOptions;

/// Everything that is known about a movie before its first frame.
pub(super) struct MovieSpec {
    /// File of the movie.
    pub path: PathBuf,
    /// Format of the movie.
    pub format: MovieFormat,
    /// The options of the caller, with the image encoding that the format requires.
    pub options: MovieOptions,
    /// Frames per second.
    pub rate: FrameRate,
    /// Names of the frames.
    pub names: FrameNames,
}

impl MovieSpec {
    /// Validates `options` for the format that `path` selects.
    ///
    /// # Errors
    ///
    /// Fails if the format is unknown or does not support such frames, or if the folder does not exist.
    pub fn new(path: &Path, options: &MovieOptions) -> Result<Self> {
        let format = MovieFormat::from_path(path)?;
        check_output_path(path)?;
        let unsupported = |found: String, advice| {
            let file = path.display().to_string();
            Err(Error::Unsupported { file, action: "write", found, advice })
        };
        let mut options = options.clone();
        let size = (options.width, options.height);
        let n_pixels = u64::from(size.0) * u64::from(size.1);
        if !(1..=MAX_PIXELS).contains(&n_pixels) {
            let advice = "choose a size of at least 1x1, and of at most 2^28 pixels";
            return unsupported(format!("frames of {}x{} pixels", size.0, size.1), advice);
        }
        if format == MovieFormat::Gif && u32::from(u16::MAX) < size.0.max(size.1) {
            let advice = "choose for GIF a size of at most 65535x65535";
            return unsupported(format!("frames of {}x{} pixels", size.0, size.1), advice);
        }
        if format == MovieFormat::ImageSequence {
            check_image_size(path, size.0, size.1)?;
        }
        if options.n_frames == 0 {
            return unsupported("a movie of no frames".into(), "choose at least one");
        }
        let fps = options.fps;
        let Some(rate) = FrameRate::new(fps) else {
            return unsupported(format!("{fps} frames a second"), "choose from 0.01 to 1000");
        };
        if format == MovieFormat::Gif && 50.0 < fps {
            // Players take a delay below two hundredths for a mistake and use ten hundredths instead.
            let advice = "players show a GIF at most 50 times a second; choose no more";
            return unsupported(format!("{fps} frames a second"), advice);
        }
        if matches!(format, MovieFormat::Video(_) | MovieFormat::Gif) {
            let (depth, alpha) = (BitDepth::Eight, Alpha::Drop);
            options.image = ImageOptions { depth, alpha, ..options.image };
        }
        let names = match format {
            MovieFormat::ImageSequence => match FrameNames::from_pattern(path) {
                Some(names) => names,
                None => return unsupported("a name that is not Unicode".into(), "choose another"),
            },
            _ => FrameNames::in_frames_folder(path),
        };
        Ok(Self { path: path.into(), format, options, rate, names })
    }

    /// Returns the path of the movie for messages.
    pub fn file(&self) -> String {
        self.path.display().to_string()
    }

    /// Returns the width and height of a frame in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.options.width, self.options.height)
    }

    /// Returns one line that is equal for two runs exactly if they may share frames.
    pub fn settings(&self) -> String {
        let MovieOptions { width, height, n_frames, image, fingerprint, .. } = &self.options;
        let depth = match image.depth {
            BitDepth::Eight => 8,
            BitDepth::Sixteen => 16,
        };
        let alpha = match image.alpha {
            Alpha::Keep => "with alpha",
            Alpha::Drop => "without alpha",
        };
        let fingerprint = fingerprint.replace('\\', "\\\\").replace('\n', "\\n");
        format!("{n_frames} frames of {width}x{height}, {depth} bits {alpha}; {fingerprint}")
    }

    /// Reads the samples of a frame back from its PNG image.
    ///
    /// # Errors
    ///
    /// Fails if the image cannot be read or has another size or encoding.
    pub fn read_frame(&self, frame: u32) -> Result<Vec<u8>> {
        let path = self.names.path(frame);
        png::read(&path, self.size(), &self.options.image).map_err(|found| Error::InvalidFrames {
            file: path.display().to_string(),
            found,
            expected: "the image of a frame as surfel wrote it".into(),
            advice: "remove this file and continue from the others [resume]",
        })
    }
}

//! What is to be made: all that follows from a movie's name and options.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::picture::{Alpha, BitDepth, ImageOptions, png};
use crate::save::check_place;

use super::MovieOptions;
use super::format::MovieFormat;
use super::names::FrameNames;
use super::rate::Rate;

pub(super) struct Plan {
    pub path: PathBuf,
    pub format: MovieFormat,
    /// As asked for, but the pictures are stored as the format needs them.
    pub options: MovieOptions,
    pub rate: Rate,
    pub names: FrameNames,
}

impl Plan {
    /// Fails if the format is not known or cannot hold such frames, or if the folder does not exist.
    pub fn new(path: &Path, options: &MovieOptions) -> Result<Self> {
        let format = MovieFormat::of(path)?;
        check_place(path)?;
        let refused = |found: String, advice| {
            let file = path.display().to_string();
            Err(Error::Unsupported { file, action: "write", found, advice })
        };
        let mut options = options.clone();
        let size = (options.width, options.height);
        let longest_side = if format == MovieFormat::Gif { u16::MAX.into() } else { u32::MAX >> 1 };
        if size.0.min(size.1) == 0 || longest_side < size.0.max(size.1) {
            let advice = "choose a size of at least 1x1, for GIF of at most 65535x65535";
            return refused(format!("frames of {}x{} pixels", size.0, size.1), advice);
        }
        if options.n_frames == 0 {
            return refused("a movie of no frames".into(), "choose at least one");
        }
        let fps = options.fps;
        let Some(rate) = Rate::new(fps) else {
            return refused(format!("{fps} frames a second"), "choose from 0.01 to 1000");
        };
        if format == MovieFormat::Gif && 50.0 < fps {
            // A shorter delay than two hundredths is taken for a mistake, and shown as ten.
            let advice = "players show a GIF at most 50 times a second; choose no more";
            return refused(format!("{fps} frames a second"), advice);
        }
        if matches!(format, MovieFormat::Video(_) | MovieFormat::Gif) {
            let (depth, alpha) = (BitDepth::Eight, Alpha::Drop);
            options.image = ImageOptions { depth, alpha, ..options.image };
        }
        let names = match format {
            MovieFormat::Pictures => match FrameNames::numbered(path) {
                Some(names) => names,
                None => return refused("a name that is not Unicode".into(), "choose another"),
            },
            _ => FrameNames::beside(path),
        };
        Ok(Self { path: path.into(), format, options, rate, names })
    }

    /// The movie's name, for messages.
    pub fn file(&self) -> String {
        self.path.display().to_string()
    }

    /// Pixels along the width and the height.
    pub fn size(&self) -> (u32, u32) {
        (self.options.width, self.options.height)
    }

    /// What frames of two runs must have in common, in one line.
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

    /// The samples of a frame, read back from its picture.
    pub fn read_frame(&self, frame: u32) -> Result<Vec<u8>> {
        let path = self.names.path(frame);
        png::read(&path, self.size(), &self.options.image).map_err(|found| Error::Frames {
            file: path.display().to_string(),
            found,
            expected: "the picture of a frame as surfel wrote it".into(),
            advice: "remove this file and run again with --resume",
        })
    }
}

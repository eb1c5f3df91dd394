//! Movie formats, derived from file names.

use std::path::Path;

use crate::error::Result;
use crate::file::{extension, unsupported_extension};

/// A kind of movie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MovieFormat {
    /// A video that the program ffmpeg encodes. Its sides are even: an odd side repeats its last column or
    /// row.
    Video(VideoContainer),
    /// An animated GIF with 256 colours per frame that loops forever.
    Gif,
    /// A lossless animated PNG that loops forever.
    Apng,
    /// One PNG or EXR file per frame, numbered from 1.
    ImageSequence,
}

/// A video file format with the codec used in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VideoContainer {
    /// MP4 with H.264.
    Mp4,
    /// QuickTime with H.264.
    Mov,
    /// Matroska with H.264.
    Mkv,
    /// WebM with VP9.
    Webm,
    /// AVI with MPEG-4 part 2, because players do not expect H.264 in AVI.
    Avi,
}

const SUPPORTED: &str = "surfel writes movies as .mp4, .mov, .mkv, .webm and .avi (by ffmpeg), .gif, \
    .png (animated), and as numbered images, frame_####.png or frame_####.exr";

impl MovieFormat {
    /// Returns the format for the extension of `path`. A .png or .exr file whose name contains `#` is an
    /// image sequence.
    ///
    /// # Errors
    ///
    /// Fails if no movie format has this extension.
    pub fn from_path(path: &Path) -> Result<Self> {
        let is_numbered = path.file_name().is_some_and(|name| name.to_string_lossy().contains('#'));
        Ok(match extension(path).as_str() {
            "mp4" => Self::Video(VideoContainer::Mp4),
            "mov" => Self::Video(VideoContainer::Mov),
            "mkv" => Self::Video(VideoContainer::Mkv),
            "webm" => Self::Video(VideoContainer::Webm),
            "avi" => Self::Video(VideoContainer::Avi),
            "gif" => Self::Gif,
            "png" | "exr" if is_numbered => Self::ImageSequence,
            "png" => Self::Apng,
            _ => return Err(unsupported_extension(path, SUPPORTED)),
        })
    }
}

#[cfg(test)]
mod tests {
    //! Tests of the choice of a format by file name.

    use super::*;

    #[test]
    fn extensions_are_case_insensitive_and_number_signs_only_count_for_images() {
        let format = |name: &str| MovieFormat::from_path(Path::new(name)).unwrap();
        assert_eq!(format("a.MP4"), MovieFormat::Video(VideoContainer::Mp4));
        assert_eq!(format("a#1.mp4"), format("a.MP4"));
        assert_eq!(format("a.png"), MovieFormat::Apng);
        assert_eq!(format("a#.png"), MovieFormat::ImageSequence);
    }
}

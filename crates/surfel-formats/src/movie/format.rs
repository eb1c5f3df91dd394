//! The kinds of movies, as told by their names.

use std::path::Path;

use crate::error::Result;
use crate::save::{extension, unsupported};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovieFormat {
    /// Made by the program ffmpeg. Sides are even: an odd one repeats its last column or row.
    Video(Container),
    /// 256 colours a frame; repeats forever.
    Gif,
    /// An animated PNG without loss; repeats forever.
    Apng,
    /// A PNG or EXR file a frame, numbered from 1.
    Pictures,
}

/// The file format of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// H.264.
    Mp4,
    /// H.264.
    Mov,
    /// H.264.
    Mkv,
    /// VP9.
    Webm,
    /// MPEG-4 part 2, since players do not expect H.264 in it.
    Avi,
}

const MOVIES: &str = "surfel writes movies as .mp4, .mov, .mkv, .webm and .avi (by ffmpeg), .gif, \
    .png (animated), and as numbered pictures, frame_####.png or frame_####.exr";

impl MovieFormat {
    /// The format that a name asks for: by its extension, or numbered pictures if the name of a .png
    /// or .exr file has a run of `#`, one for each digit.
    pub fn of(path: &Path) -> Result<Self> {
        let is_numbered = path.file_name().is_some_and(|name| name.to_string_lossy().contains('#'));
        Ok(match extension(path).as_str() {
            "mp4" => Self::Video(Container::Mp4),
            "mov" => Self::Video(Container::Mov),
            "mkv" => Self::Video(Container::Mkv),
            "webm" => Self::Video(Container::Webm),
            "avi" => Self::Video(Container::Avi),
            "gif" => Self::Gif,
            "png" | "exr" if is_numbered => Self::Pictures,
            "png" => Self::Apng,
            _ => return Err(unsupported(path, MOVIES)),
        })
    }
}

//! Settings of a movie.

use crate::image_file::ImageOptions;

/// Size, timing and encoding of a movie.
#[derive(Clone, Debug, PartialEq)]
pub struct MovieOptions {
    /// Width of each frame in pixels.
    pub width: u32,
    /// Height of each frame in pixels.
    pub height: u32,
    /// Frames per second, from 0.01 to 1000; at most 50 for GIF. Image sequences do not store it.
    pub fps: f64,
    /// Number of frames, at least 1.
    pub n_frames: u32,
    /// Encoding of the frames. Video and GIF always use eight bits and composite over black.
    pub image: ImageOptions,
    /// A text that identifies everything else the content of the frames depends on. A resumed run reuses
    /// frames only if this text, the size, the number of frames, the depth and the alpha mode are equal.
    pub fingerprint: String,
}

//! Binary messages to a page: a header of twenty bytes, then a picture file. docs/server.md has the layout.

/// The quality of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// A small picture with one sample a pixel, while the view changes.
    Draft,
    /// A picture of full size with some of its samples.
    Refined,
    /// A picture of full size with all samples.
    Finished,
}

/// An encoded file, and the place in pixels that it takes in the page's picture.
pub struct PlacedFile {
    /// Column of the left edge.
    pub x: u16,
    /// Row of the upper edge.
    pub y: u16,
    /// Width of the place.
    pub width: u16,
    /// Height of the place.
    pub height: u16,
    /// The JPEG or PNG file.
    pub file: Vec<u8>,
}

/// An encoded picture, and facts about how it was rendered.
pub struct Frame {
    /// The quality of the picture.
    pub quality: Quality,
    /// Width in pixels.
    pub width: u16,
    /// Height in pixels.
    pub height: u16,
    /// Number of camera rays a pixel so far.
    pub samples: u32,
    /// Number of camera rays a pixel of the finished picture.
    pub of_samples: u32,
    /// The file of the whole picture, then those of parts that lie over it.
    pub files: Vec<PlacedFile>,
    /// Time spent tracing, in seconds.
    pub trace_secs: f64,
    /// Time spent encoding, in seconds.
    pub encode_secs: f64,
    /// Million rays a second.
    pub mrays_per_s: f64,
}

/// First byte of a message with a JPEG file.
const JPEG: u8 = 1;
/// First byte of a message with a PNG file.
const PNG: u8 = 2;
/// First byte of a message with a saved picture.
const SAVED: u8 = 3;

impl Frame {
    /// The message with this picture: `number` counts pictures, `scene_number` is that of the scene it shows,
    /// `seq` that of the last message that took effect.
    pub fn message(&self, number: u32, scene_number: u16, seq: u32) -> Vec<u8> {
        let is_finished = self.quality == Quality::Finished;
        let n_bytes: usize = self.files.iter().map(|placed| 12 + placed.file.len()).sum();
        let mut message = Vec::with_capacity(20 + n_bytes);
        message.extend([if is_finished { PNG } else { JPEG }, u8::from(is_finished)]);
        message.extend(scene_number.to_le_bytes());
        message.extend(number.to_le_bytes());
        message.extend(seq.to_le_bytes());
        let samples = [self.samples, self.of_samples].map(|n| n.min(0xffff) as u16);
        for number in [self.width, self.height, samples[0], samples[1]] {
            message.extend(number.to_le_bytes());
        }
        for PlacedFile { x, y, width, height, file } in &self.files {
            [x, y, width, height].iter().for_each(|number| message.extend(number.to_le_bytes()));
            message.extend((file.len() as u32).to_le_bytes());
            message.extend(file);
        }
        message
    }
}

/// The message with a saved picture, which answers the request `id`.
pub fn saved_message(id: u32, (width, height): (u16, u16), file: &[u8]) -> Vec<u8> {
    let mut message = vec![SAVED, 1, 0, 0];
    message.extend(id.to_le_bytes());
    message.extend([0; 4]);
    for number in [width, height, 0, 0] {
        message.extend(number.to_le_bytes());
    }
    message.extend(file);
    message
}

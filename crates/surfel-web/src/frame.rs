//! A picture on its way to a page: twenty bytes that say what it is, then the file.

use crate::canvas::Quality;

pub struct Frame {
    pub quality: Quality,
    pub width: u16,
    pub height: u16,
    /// Camera rays a pixel, of so many that the finished picture has.
    pub samples: u32,
    pub of_samples: u32,
    pub file: Vec<u8>,
    pub trace_secs: f64,
    pub encode_secs: f64,
    pub mrays_per_s: f64,
}

/// First byte of a binary message.
const JPEG: u8 = 1;
const PNG: u8 = 2;
const SAVED: u8 = 3;

impl Frame {
    /// With the number of the picture, of what it shows and of the last message it obeys.
    pub fn message(&self, number: u32, stage_number: u16, input: u32) -> Vec<u8> {
        let is_finished = self.quality == Quality::Finished;
        let mut message = Vec::with_capacity(20 + self.file.len());
        message.extend([if is_finished { PNG } else { JPEG }, u8::from(is_finished)]);
        message.extend(stage_number.to_le_bytes());
        message.extend(number.to_le_bytes());
        message.extend(input.to_le_bytes());
        let samples = [self.samples, self.of_samples].map(|n| n.min(0xffff) as u16);
        for number in [self.width, self.height, samples[0], samples[1]] {
            message.extend(number.to_le_bytes());
        }
        message.extend(&self.file);
        message
    }
}

/// A picture to keep, for the request of this number.
pub fn saved(id: u32, (width, height): (u16, u16), file: &[u8]) -> Vec<u8> {
    let mut message = vec![SAVED, 1, 0, 0];
    message.extend(id.to_le_bytes());
    message.extend([0; 4]);
    for number in [width, height, 0, 0] {
        message.extend(number.to_le_bytes());
    }
    message.extend(file);
    message
}

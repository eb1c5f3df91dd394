//! Animated GIF writer with a palette of 256 colours per frame.

use gif::{Encoder, EncodingError, Frame, Repeat};
use rayon::prelude::*;
use surfel_core::progress::Progress;

use crate::error::Result;
use crate::file::{write_error, write_file};
use crate::image_file::encoder_error;

use super::spec::MovieSpec;

/// Approximate number of samples that the palette of a large frame is fitted to; a small frame uses all its
/// pixels.
const N_PALETTE_SAMPLES: usize = 100_000;

/// Writes a GIF from the finished frames.
pub(super) fn write(spec: &MovieSpec, progress: &dyn Progress) -> Result<()> {
    let n_frames = spec.options.n_frames;
    progress.begin(&format!("write {}", spec.file()), n_frames.into());
    let failed = |error: EncodingError| match error {
        EncodingError::Io(cause) => write_error(&spec.path, cause),
        refusal => encoder_error(&spec.path, refusal),
    };
    write_file(&spec.path, |writer| {
        let (width, height) = size(spec);
        let mut encoder = Encoder::new(writer, width, height, &[]).map_err(failed)?;
        encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
        // Finding palettes dominates the run time, so frames are encoded in parallel, one per thread.
        let batch_size = rayon::current_num_threads() as u32;
        for first in (0..n_frames).step_by(batch_size as usize) {
            let batch = first..n_frames.min(first.saturating_add(batch_size));
            let encode = |frame| {
                progress.check()?;
                encode(spec, frame)
            };
            let batch = batch.into_par_iter().map(encode).collect::<Result<Vec<_>>>()?;
            for frame in &batch {
                encoder.write_lzw_pre_encoded_frame(frame).map_err(failed)?;
                progress.advance(1);
            }
        }
        encoder.into_inner().map_err(failed)?;
        Ok(())
    })
}

fn encode(spec: &MovieSpec, frame_idx: u32) -> Result<Frame<'static>> {
    let (width, height) = size(spec);
    let samples = spec.read_frame(frame_idx)?;
    // The palette is fitted to every n-th pixel; the `gif` crate accepts n up to 30.
    let speed = (samples.len() / 3 / N_PALETTE_SAMPLES).clamp(1, 30) as i32;
    let mut frame = Frame::from_rgb_speed(width, height, &samples, speed);
    // The difference of rounded start times keeps rounding errors from accumulating.
    frame.delay = (spec.rate.start_cs(frame_idx + 1) - spec.rate.start_cs(frame_idx)) as u16;
    frame.make_lzw_pre_encoded();
    Ok(frame)
}

/// The size as 16-bit numbers; [`MovieSpec::new`] rejects larger sizes.
fn size(spec: &MovieSpec) -> (u16, u16) {
    (spec.options.width as u16, spec.options.height as u16)
}

//! Animated GIF: a palette of 256 colours a frame.

use std::io;

use gif::{Encoder, EncodingError, Frame, Repeat};
use rayon::prelude::*;
use surfel::progress::Progress;

use crate::atomic::{write_failed, write_file};
use crate::error::Result;

use super::plan::Plan;

/// A palette is learnt from every pixel of a small frame, and from about so many of a large one.
const N_PALETTE_SAMPLES: usize = 100_000;

pub(super) fn write(plan: &Plan, progress: &dyn Progress) -> Result<()> {
    let n_frames = plan.options.n_frames;
    progress.begin(&format!("write {}", plan.file()), n_frames.into());
    let failed = |error: EncodingError| match error {
        EncodingError::Io(cause) => write_failed(&plan.path, cause),
        other => write_failed(&plan.path, io::Error::other(other.to_string())),
    };
    write_file(&plan.path, |writer| {
        let (width, height) = size(plan);
        let mut encoder = Encoder::new(writer, width, height, &[]).map_err(failed)?;
        encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
        // Palettes take the time, so threads find them; no more frames are held than there are threads.
        let n_batch = rayon::current_num_threads() as u32;
        for first in (0..n_frames).step_by(n_batch as usize) {
            let batch = first..n_frames.min(first.saturating_add(n_batch));
            let encode = |frame| {
                progress.check()?;
                encode(plan, frame)
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

fn encode(plan: &Plan, number: u32) -> Result<Frame<'static>> {
    let (width, height) = size(plan);
    let samples = plan.read_frame(number)?;
    // Learns from one pixel of so many; the crate takes up to 30.
    let speed = (samples.len() / 3 / N_PALETTE_SAMPLES).clamp(1, 30) as i32;
    let mut frame = Frame::from_rgb_speed(width, height, &samples, speed);
    // From rounded times, so that the rounding does not add up.
    frame.delay = (plan.rate.start_cs(number + 1) - plan.rate.start_cs(number)) as u16;
    frame.make_lzw_pre_encoded();
    Ok(frame)
}

/// No side is longer than the format allows: the plan refuses such.
fn size(plan: &Plan) -> (u16, u16) {
    (plan.options.width as u16, plan.options.height as u16)
}

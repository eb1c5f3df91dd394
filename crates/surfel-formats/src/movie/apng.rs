//! Animated PNG: every frame whole and without loss.

use surfel::progress::Progress;

use crate::atomic::{write_failed, write_file};
use crate::error::Result;
use crate::picture::png;

use super::plan::Plan;

pub(super) fn write(plan: &Plan, progress: &dyn Progress) -> Result<()> {
    let n_frames = plan.options.n_frames;
    progress.begin(&format!("write {}", plan.file()), n_frames.into());
    let failed = |error: ::png::EncodingError| write_failed(&plan.path, error.into());
    write_file(&plan.path, |writer| {
        let mut encoder = png::encoder(writer, plan.size(), &plan.options.image);
        // Played 0 times: forever.
        encoder.set_animated(n_frames, 0).map_err(failed)?;
        encoder.set_frame_delay(plan.rate.seconds, plan.rate.frames).map_err(failed)?;
        encoder.validate_sequence(true);
        let mut writer = encoder.write_header().map_err(failed)?;
        for frame in 0..n_frames {
            progress.check()?;
            writer.write_image_data(&plan.read_frame(frame)?).map_err(failed)?;
            progress.advance(1);
        }
        writer.finish().map_err(failed)
    })
}

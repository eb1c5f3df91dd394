//! Animated PNG writer: every frame is stored whole and lossless.

use surfel_core::progress::Progress;

use crate::error::Result;
use crate::file::write_file;
use crate::image_file::png;

use super::spec::MovieSpec;

/// Writes an animated PNG from the finished frames.
pub(super) fn write(spec: &MovieSpec, progress: &dyn Progress) -> Result<()> {
    let n_frames = spec.options.n_frames;
    progress.begin(&format!("write {}", spec.file()), n_frames.into());
    let failed = |error| png::png_error(&spec.path, error);
    write_file(&spec.path, |writer| {
        let mut encoder = png::encoder(writer, spec.size(), &spec.options.image);
        // 0 plays means an endless loop.
        encoder.set_animated(n_frames, 0).map_err(failed)?;
        encoder.set_frame_delay(spec.rate.seconds, spec.rate.frames).map_err(failed)?;
        encoder.validate_sequence(true);
        let mut writer = encoder.write_header().map_err(failed)?;
        for frame in 0..n_frames {
            progress.check()?;
            writer.write_image_data(&spec.read_frame(frame)?).map_err(failed)?;
            progress.advance(1);
        }
        writer.finish().map_err(failed)
    })
}

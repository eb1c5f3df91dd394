//! Encodes points to bytes in parallel and writes them in order; the names, steps and notes that writers share.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;
use surfel_core::points::{PointCloud, have_8_bits};
use surfel_core::progress::Progress;

use super::column_role::ColumnRole;
use crate::error::Result;

/// Number of points that a task encodes; the usual size of a LAZ chunk.
pub(crate) const POINTS_PER_CHUNK: usize = 50_000;
/// Number of chunks that are in memory at a time.
const CHUNKS_PER_BATCH: usize = 16;

/// Encodes points 0 to `n_points` in chunks by `encode`, and passes the bytes to `sink` in order.
pub(crate) fn encode_points(
    n_points: usize,
    encode: impl Fn(Range<usize>) -> Result<Vec<u8>> + Sync,
    progress: &dyn Progress,
    mut sink: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let chunks: Vec<Range<usize>> = (0..n_points)
        .step_by(POINTS_PER_CHUNK)
        .map(|start| start..n_points.min(start + POINTS_PER_CHUNK))
        .collect();
    for batch in chunks.chunks(CHUNKS_PER_BATCH) {
        let encoded: Result<Vec<Vec<u8>>> = batch
            .par_iter()
            .map(|chunk| {
                progress.check()?;
                encode(chunk.clone())
            })
            .collect();
        for (bytes, chunk) in encoded?.iter().zip(batch) {
            sink(bytes)?;
            progress.advance(chunk.len() as u64);
        }
    }
    Ok(())
}

/// Notes that a format of 8 bits rounds colours of 16. Trained splats keep theirs in columns of their own.
pub(crate) fn note_rounded_colors(path: &Path, cloud: &PointCloud, progress: &dyn Progress) {
    let is_rounded = cloud.colors.as_deref().is_some_and(|colors| !have_8_bits(colors));
    if is_rounded && !cloud.has_gaussians() {
        progress.note(&format!("{}: colours of 16 bits are rounded to 8", path.display()));
    }
}

/// Returns a scalar's name as one word that no reader takes for another column.
pub(crate) fn scalar_word(name: &str) -> String {
    let is_separator =
        |c: char| c.is_whitespace() || c.is_control() || matches!(c, ',' | ';' | '"');
    let name: String = name.chars().map(|c| if is_separator(c) { '_' } else { c }).collect();
    if name.is_empty() || ColumnRole::from_name(&name).is_some() || ColumnRole::is_alpha(&name) {
        return format!("column_{name}");
    }
    name
}

/// Returns the largest power of ten that is at most the distance between f32 numbers of magnitude `extent`.
pub(crate) fn decimal_step(extent: f64) -> f64 {
    let spacing = extent.max(f64::MIN_POSITIVE) * 0.5_f64.powi(23);
    10.0_f64.powf(spacing.log10().floor())
}

//! Points as bytes, encoded in parallel and written in order.

use std::ops::Range;

use rayon::prelude::*;
use surfel::progress::Progress;

use crate::error::Result;

/// Points a task encodes; the usual size of a LAZ chunk.
pub(crate) const POINTS_PER_PART: usize = 50_000;
const PARTS_PER_BATCH: usize = 16;

/// Hands `sink` what `encode` makes of each part of points 0 to `n_points`, in order.
pub(crate) fn encode_points(
    n_points: usize,
    encode: impl Fn(Range<usize>) -> Result<Vec<u8>> + Sync,
    progress: &dyn Progress,
    mut sink: impl FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let parts: Vec<Range<usize>> = (0..n_points)
        .step_by(POINTS_PER_PART)
        .map(|start| start..n_points.min(start + POINTS_PER_PART))
        .collect();
    for batch in parts.chunks(PARTS_PER_BATCH) {
        let encoded: Result<Vec<Vec<u8>>> = batch
            .par_iter()
            .map(|part| {
                progress.check()?;
                encode(part.clone())
            })
            .collect();
        for (bytes, part) in encoded?.iter().zip(batch) {
            sink(bytes)?;
            progress.advance(part.len() as u64);
        }
    }
    Ok(())
}

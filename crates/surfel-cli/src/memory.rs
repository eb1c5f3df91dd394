//! What memory a picture takes, and the limit that the user may set.

use crate::args::Global;
use anyhow::bail;
use std::path::PathBuf;
use surfel::flat::PointBlock;
use surfel::math::LANES;
use surfel::points::Select;
use surfel_formats::Source;

/// What is known of a picture before it is made.
pub struct Plan {
    pub n_points: u64,
    pub n_selected: u64,
    pub n_pixels: u64,
}

/// Position, normal, radius, colour and intensity as they are loaded or made.
const COLUMNS: u64 = 12 + 12 + 4 + 6 + 4;
/// A pixel with all its layers.
const PIXEL: u64 = 16 + 52;
/// Bytes of an average line of text, where a file does not tell how many there are.
const LINE: u64 = 30;

impl Plan {
    /// From the headers of files, without reading their points.
    pub fn new(
        sources: &[Source],
        files: &[PathBuf],
        select: Option<Select>,
        n_pixels: u64,
    ) -> Self {
        let by_size = |file: &PathBuf| std::fs::metadata(file).map_or(0, |data| data.len() / LINE);
        let n_points =
            |(source, file): (&Source, &PathBuf)| source.n_points.unwrap_or_else(|| by_size(file));
        let n_points = sources.iter().zip(files).map(n_points).sum();
        Self { n_points, n_selected: selected(n_points, select), n_pixels }
    }

    /// Columns, flat form and what building it takes beside, picture.
    fn bytes(&self) -> [u64; 3] {
        let flat = (size_of::<PointBlock>() / LANES + size_of::<u32>()) as u64 + 5;
        let columns = self.n_points.saturating_mul(COLUMNS);
        [columns, self.n_selected.saturating_mul(flat) / 2 * 5, self.n_pixels * PIXEL]
    }

    pub fn check(&self, global: &Global) -> anyhow::Result<()> {
        let Some(limit) = global.memory_limit else { return Ok(()) };
        let [columns, flat, picture] = self.bytes();
        let all = columns.saturating_add(flat).saturating_add(picture);
        if limit < all {
            bail!(
                "{} points need about {} of memory ({} columns, {} tree, {} picture), and \
                 --memory-limit is {}; take fewer points with --select random:{} or raise the limit",
                self.n_points,
                readable(all),
                readable(columns),
                readable(flat),
                readable(picture),
                readable(limit),
                (self.n_points / 4).max(1),
            );
        }
        Ok(())
    }
}

fn selected(n_points: u64, select: Option<Select>) -> u64 {
    match select {
        Some(Select::First(count) | Select::Random(count)) => n_points.min(count as u64),
        Some(Select::Stride(stride)) => (n_points as f64 / stride.max(1.0)) as u64,
        Some(Select::Spacing(_)) | None => n_points,
    }
}

/// Bytes in the largest unit that leaves a number above one.
pub fn readable(bytes: u64) -> String {
    let units = ["B", "KB", "MB", "GB", "TB"];
    let power = (bytes.max(1).ilog2() / 10).min(4);
    let value = bytes as f64 / 1024f64.powi(power as i32);
    let digits = usize::from(0 < power);
    format!("{value:.digits$} {}", units[power as usize])
}

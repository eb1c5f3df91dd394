//! Reads the points of a file that a filter keeps.

use surfel_core::progress::Progress;

use crate::error::Result;
use crate::file::Input;
use crate::format::ReadPoints;
use crate::options::{LoadOptions, Loaded};

/// Reads points with `read`, which keeps those that the filter of `options` keeps, and says how many these are. Columns
/// that the filter alone needs are dropped afterwards.
pub(crate) fn read_filtered(
    read: ReadPoints,
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let Some(filter) = &options.filter else { return read(input, options, progress) };
    let columns = options.columns.with_names(&filter.columns());
    let Loaded { mut cloud, mut info } =
        read(input, &LoadOptions { columns, ..options.clone() }, progress)?;
    let n_kept = cloud.len() as u64;
    let n_points = info.n_points.replace(n_kept).unwrap_or(n_kept);
    progress.note(&format!("{}: {n_kept} of {n_points} points meet {filter}", input.name));
    options.columns.drop_others(&mut cloud);
    Ok(Loaded { cloud, info })
}

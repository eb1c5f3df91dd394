//! Reads the points of a file that a filter keeps.

use surfel_core::progress::Progress;

use crate::error::{Error, Result};
use crate::file::Input;
use crate::format::{ReadPoints, detect};
use crate::options::{LoadOptions, Loaded};
use crate::table::{ColumnRole, keep_matching, note_kept, shrink};

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
    let loaded = read(input, &LoadOptions { columns, ..options.clone() }, progress);
    let Loaded { mut cloud, mut info } = loaded.map_err(|error| with_all_columns(error, input))?;
    let n_kept = cloud.len() as u64;
    let n_points = info.n_points.replace(n_kept).unwrap_or(n_kept);
    note_kept(input, n_kept, n_points, filter, progress);
    options.columns.drop_others(&mut cloud);
    Ok(Loaded { cloud, info })
}

/// Drops the points that the filter of `options` does not keep, and the columns that `options` do not choose, from a
/// cloud that was read whole.
pub(crate) fn filter_loaded(
    input: &Input,
    Loaded { mut cloud, mut info }: Loaded,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    if let Some(filter) = &options.filter {
        let n_points = cloud.len() as u64;
        keep_matching(&mut cloud, 0, Some(filter))?;
        shrink(&mut cloud);
        let n_kept = cloud.len() as u64;
        info.n_points = Some(n_kept);
        note_kept(input, n_kept, n_points, filter, progress);
    }
    options.columns.drop_others(&mut cloud);
    Ok(Loaded { cloud, info })
}

/// Returns the error of a filter that names no column, with all columns that the header lists rather than those that were
/// read.
fn with_all_columns(error: Error, input: &Input) -> Error {
    let Error::Core(surfel_core::Error::UnknownName { kind, found, .. }) = &error else {
        return error;
    };
    let columns = detect(input).and_then(|format| (format.inspect)(input));
    let columns = columns.map(|info| info.columns).unwrap_or_default();
    if columns.is_empty() {
        return error;
    }
    let names: Vec<&str> = columns.iter().map(String::as_str).collect();
    let roles = ColumnRole::from_names(&names);
    let known: Vec<&str> = roles.iter().map(ColumnRole::name).collect();
    let (kind, found, known) = (*kind, found.clone(), known.join(", "));
    Error::Core(surfel_core::Error::UnknownName { kind, found, known })
}

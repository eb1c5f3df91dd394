//! BIN: bare records of seven little-endian f32 a point (position, radius, normal), a format of ray tracing
//! benchmarks.

use surfel_core::progress::Progress;

use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::table::{
    ColumnField, ColumnRole, Field, NumberType, RecordLayout, Tolerance, origin_of_records,
    read_records,
};

/// Columns of each record, an f32 each.
const COLUMNS: [ColumnRole; 7] = [
    ColumnRole::Position(0),
    ColumnRole::Position(1),
    ColumnRole::Position(2),
    ColumnRole::Radius,
    ColumnRole::Normal(0),
    ColumnRole::Normal(1),
    ColumnRole::Normal(2),
];
const STRIDE: usize = 4 * COLUMNS.len();

/// Reads the number of points from the length of the file.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    check_length(input)?;
    Ok(FileInfo {
        format: "BIN, records of 7 f32".into(),
        n_points: Some((input.len() / STRIDE) as u64),
        columns: COLUMNS.iter().map(|role| role.name().into()).collect(),
        ..FileInfo::default()
    })
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let info = inspect(input)?;
    let fields = COLUMNS.into_iter().enumerate();
    let columns =
        fields.map(|(i, role)| ColumnField { role, field: Field::new(4 * i, NumberType::F32) });
    let layout = RecordLayout::new(STRIDE, false, columns.collect(), &options.columns)
        .expect("the first three columns are x, y and z");
    let origin = options
        .origin
        .unwrap_or_else(|| origin_of_records(input, &layout, Tolerance::F32_COORDINATES));
    progress.begin(&format!("read {}", input.name), (input.len() / STRIDE) as u64);
    let cloud = read_records(input, input, &layout, origin, options.filter.as_ref(), progress)?;
    Ok(Loaded { cloud, info })
}

/// Checks that the file holds whole records, which is the only sign that it is not damaged or of another format.
fn check_length(input: &Input) -> Result<()> {
    let rest = input.len() % STRIDE;
    if rest == 0 {
        return Ok(());
    }
    Err(input.malformed(
        Location::Byte((input.len() - rest) as u64),
        format!("a record of {rest} bytes"),
        format!("{STRIDE}: x y z radius nx ny nz as little-endian f32"),
        "copy the file again from its source, or convert it if it has other records",
    ))
}

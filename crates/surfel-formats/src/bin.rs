//! BIN: bare records of seven little-endian f32 a point, position, radius and normal, as ray tracing
//! benchmarks pass clouds around.

use surfel::progress::Progress;

use crate::error::{Place, Result};
use crate::input::Input;
use crate::options::{LoadOptions, Loaded, Source};
use crate::record::{ColumnField, Field, Kind, Layout};
use crate::records::{Tolerance, origin_of_records, read_records};
use crate::role::Role;

/// What each record holds, an f32 each.
const COLUMNS: [Role; 7] = [
    Role::Position(0),
    Role::Position(1),
    Role::Position(2),
    Role::Radius,
    Role::Normal(0),
    Role::Normal(1),
    Role::Normal(2),
];
const STRIDE: usize = 4 * COLUMNS.len();

pub(crate) fn inspect(input: &Input) -> Result<Source> {
    check_length(input)?;
    Ok(Source {
        format: "BIN, records of 7 f32".into(),
        n_points: Some((input.len() / STRIDE) as u64),
        columns: COLUMNS.iter().map(|role| role.name().into()).collect(),
        ..Source::default()
    })
}

pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let source = inspect(input)?;
    let fields = COLUMNS.into_iter().enumerate();
    let columns = fields.map(|(i, role)| ColumnField { role, field: Field::new(4 * i, Kind::F32) });
    let layout = Layout::new(STRIDE, false, columns.collect(), &options.columns)
        .expect("x, y and z are the first three");
    let origin =
        options.origin.unwrap_or_else(|| origin_of_records(input, &layout, Tolerance::SINGLE));
    progress.begin(&format!("read {}", input.name), (input.len() / STRIDE) as u64);
    let cloud = read_records(input, input, &layout, origin, progress)?;
    Ok(Loaded { cloud, source })
}

/// The length is all that tells a damaged file, or one of another kind, from a whole one.
fn check_length(input: &Input) -> Result<()> {
    let rest = input.len() % STRIDE;
    if rest == 0 {
        return Ok(());
    }
    Err(input.malformed(
        Place::Byte((input.len() - rest) as u64),
        format!("a record of {rest} bytes"),
        format!("{STRIDE}: x y z radius nx ny nz as little-endian f32"),
        "copy the file again from its source, or convert it if its records are others",
    ))
}

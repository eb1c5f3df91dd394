//! Where the columns stand in the records of each point format, extra bytes included.

use super::header::{Header, RECORD_LENGTHS, read_f64, text};
use crate::input::Input;
use crate::record::{ColumnField, Field, Kind};
use crate::role::Role;

pub(super) const EXTRA_BYTES_USER_ID: &str = "LASF_Spec";
pub(super) const EXTRA_BYTES_RECORD_ID: u16 = 4;
/// Bytes of the description of one extra column.
pub(super) const DESCRIPTION: usize = 192;
/// Degrees a step of the scan angle, from point format 6 on.
pub(super) const SCAN_ANGLE_STEP: f64 = 0.006;

/// The columns of the file; an extra one that repeats a standard one is there for its better values.
pub(super) fn columns(input: &Input, header: &Header) -> Vec<ColumnField> {
    let extras = extra_columns(input, header);
    let mut columns = standard_columns(header);
    columns.retain(|column| extras.iter().all(|extra| extra.role != column.role));
    columns.extend(extras);
    columns
}

/// Where a point's withheld flag stands: byte and mask.
pub(super) fn withheld_flag(point_format: u8) -> (usize, u8) {
    if point_format < 6 { (15, 0x80) } else { (15, 0x04) }
}

fn standard_columns(header: &Header) -> Vec<ColumnField> {
    let mut columns = Vec::new();
    let mut add = |role: Role, field: Field| columns.push(ColumnField { role, field });
    let scalar = |name: &str| Role::Scalar(name.into());
    let bits = |byte, lowest, n| Field { bits: Some((lowest, n)), ..Field::new(byte, Kind::U8) };
    for axis in 0..3 {
        let coordinate = Field::new(4 * axis, Kind::I32);
        let (scale, offset) = (header.scale[axis], header.offset[axis]);
        add(Role::Position(axis), Field { scale, offset, ..coordinate });
    }
    add(Role::Intensity, Field::new(12, Kind::U16));
    let format = header.point_format;
    if format < 6 {
        add(scalar("return_number"), bits(14, 0, 3));
        add(scalar("number_of_returns"), bits(14, 3, 3));
        // The upper three bits are flags.
        add(Role::Classification, bits(15, 0, 5));
        add(scalar("scan_angle"), Field::new(16, Kind::I8));
        add(scalar("user_data"), Field::new(17, Kind::U8));
        add(scalar("point_source_id"), Field::new(18, Kind::U16));
    } else {
        add(scalar("return_number"), bits(14, 0, 4));
        add(scalar("number_of_returns"), bits(14, 4, 4));
        add(Role::Classification, Field::new(16, Kind::U8));
        add(scalar("user_data"), Field::new(17, Kind::U8));
        let angle = Field::new(18, Kind::I16);
        add(scalar("scan_angle"), Field { scale: SCAN_ANGLE_STEP, ..angle });
        add(scalar("point_source_id"), Field::new(20, Kind::U16));
    }
    let gps_time = match format {
        1 | 3 | 4 | 5 => Some(20),
        6..=10 => Some(22),
        _ => None,
    };
    if let Some(byte) = gps_time {
        add(scalar("gps_time"), Field::new(byte, Kind::F64));
    }
    let color = match format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    };
    for channel in 0..3 {
        if let Some(byte) = color {
            add(Role::Color(channel), Field::new(byte + 2 * channel, Kind::U16));
        }
    }
    if matches!(format, 8 | 10) {
        add(scalar("nir"), Field::new(36, Kind::U16));
    }
    columns
}

fn extra_columns(input: &Input, header: &Header) -> Vec<ColumnField> {
    let descriptions = header.record(input, EXTRA_BYTES_USER_ID, EXTRA_BYTES_RECORD_ID);
    let mut byte = RECORD_LENGTHS[usize::from(header.point_format)];
    let mut columns = Vec::new();
    for description in descriptions.into_iter().flat_map(|all| all.chunks_exact(DESCRIPTION)) {
        let (data_type, options) = (description[2], description[3]);
        let Some((kind, n_values)) = extra_kind(data_type) else {
            // Type 0 is a number of bytes without meaning.
            byte += usize::from(options);
            continue;
        };
        let name = text(&description[4..36]);
        for value in 0..n_values {
            if header.record_length < byte + kind.size() {
                return columns;
            }
            let has_scale = options & 0x08 != 0;
            let has_offset = options & 0x10 != 0;
            let field = Field {
                scale: if has_scale { read_f64(description, 112 + 8 * value) } else { 1.0 },
                offset: if has_offset { read_f64(description, 136 + 8 * value) } else { 0.0 },
                ..Field::new(byte, kind)
            };
            let name = if n_values == 1 { name.clone() } else { format!("{name}[{value}]") };
            let role = match Role::of_name(&name) {
                Some(role @ (Role::Normal(_) | Role::Radius | Role::Intensity)) => role,
                _ => Role::Scalar(name),
            };
            columns.push(ColumnField { role, field });
            byte += kind.size();
        }
    }
    columns
}

/// The kind and number of the values of an extra column; types above 10 are the retired pairs and triples.
fn extra_kind(data_type: u8) -> Option<(Kind, usize)> {
    const KINDS: [Kind; 10] = [
        Kind::U8,
        Kind::I8,
        Kind::U16,
        Kind::I16,
        Kind::U32,
        Kind::I32,
        Kind::U64,
        Kind::I64,
        Kind::F32,
        Kind::F64,
    ];
    let index = usize::from(data_type).checked_sub(1)?;
    (index < 30).then(|| (KINDS[index % 10], index / 10 + 1))
}

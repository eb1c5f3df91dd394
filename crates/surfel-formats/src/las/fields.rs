//! The fields of the columns in the records of each point format, extra bytes included.

use surfel_core::points::{WITHHELD, plain_name};

use super::header::{Header, RECORD_LENGTHS, read_f64, text};
use crate::file::Input;
use crate::table::{ColumnField, ColumnRole, Field, NumberType};

/// User id of the record that describes the extra bytes.
pub(super) const EXTRA_BYTES_USER_ID: &str = "LASF_Spec";
/// Id of the record that describes the extra bytes.
pub(super) const EXTRA_BYTES_RECORD_ID: u16 = 4;
/// Bytes of the description of one extra column.
pub(super) const DESCRIPTION_SIZE: usize = 192;
/// Bits of the options of an extra column: a value stands for a missing one, and there is a scale and an offset.
const HAS_NO_DATA: u8 = 0x01;
const HAS_SCALE: u8 = 0x08;
const HAS_OFFSET: u8 = 0x10;
/// Unit of the scan angle in degrees, from point format 6 on.
pub(super) const SCAN_ANGLE_STEP: f64 = 0.006;

/// Returns the columns of the file. An extra column takes precedence over a standard one of the same role, since it is
/// written for its better values.
pub(super) fn columns(input: &Input, header: &Header) -> Vec<ColumnField> {
    let extras = extra_columns(input, header);
    let mut columns = standard_columns(header);
    columns.retain(|column| extras.iter().all(|extra| extra.role != column.role));
    columns.extend(extras);
    columns
}

/// Returns the names of the flags of a point with the byte of each, its lowest bit and its number of bits.
pub(super) fn flag_fields(is_extended: bool) -> &'static [(&'static str, usize, u32, u32)] {
    match is_extended {
        true => &[
            ("synthetic", 15, 0, 1),
            ("key_point", 15, 1, 1),
            (WITHHELD, 15, 2, 1),
            ("overlap", 15, 3, 1),
            ("scanner_channel", 15, 4, 2),
            ("scan_direction_flag", 15, 6, 1),
            ("edge_of_flight_line", 15, 7, 1),
        ],
        false => &[
            ("scan_direction_flag", 14, 6, 1),
            ("edge_of_flight_line", 14, 7, 1),
            ("synthetic", 15, 5, 1),
            ("key_point", 15, 6, 1),
            (WITHHELD, 15, 7, 1),
        ],
    }
}

/// Returns the columns of the point format.
fn standard_columns(header: &Header) -> Vec<ColumnField> {
    let mut columns = Vec::new();
    let mut add = |role: ColumnRole, field: Field| columns.push(ColumnField { role, field });
    let scalar = |name: &str| ColumnRole::Scalar(name.into());
    let bits =
        |byte, lowest, n| Field { bits: Some((lowest, n)), ..Field::new(byte, NumberType::U8) };
    for axis in 0..3 {
        let coordinate = Field::new(4 * axis, NumberType::I32);
        let (scale, offset) = (header.scale[axis], header.offset[axis]);
        add(ColumnRole::Position(axis), Field { scale, offset, ..coordinate });
    }
    add(ColumnRole::Intensity, Field::new(12, NumberType::U16));
    let format = header.point_format;
    if format < 6 {
        add(scalar("return_number"), bits(14, 0, 3));
        add(scalar("number_of_returns"), bits(14, 3, 3));
        // The upper three bits are flags.
        add(ColumnRole::Classification, bits(15, 0, 5));
        add(scalar("scan_angle"), Field::new(16, NumberType::I8));
        add(scalar("user_data"), Field::new(17, NumberType::U8));
        add(scalar("point_source_id"), Field::new(18, NumberType::U16));
    } else {
        add(scalar("return_number"), bits(14, 0, 4));
        add(scalar("number_of_returns"), bits(14, 4, 4));
        add(ColumnRole::Classification, Field::new(16, NumberType::U8));
        add(scalar("user_data"), Field::new(17, NumberType::U8));
        let angle = Field::new(18, NumberType::I16);
        add(scalar("scan_angle"), Field { scale: SCAN_ANGLE_STEP, ..angle });
        add(scalar("point_source_id"), Field::new(20, NumberType::U16));
    }
    for &(name, byte, lowest, n_bits) in flag_fields(6 <= format) {
        add(scalar(name), bits(byte, lowest, n_bits));
    }
    let gps_time = match format {
        1 | 3 | 4 | 5 => Some(20),
        6..=10 => Some(22),
        _ => None,
    };
    if let Some(byte) = gps_time {
        add(scalar("gps_time"), Field::new(byte, NumberType::F64));
    }
    let color = match format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    };
    for channel in 0..3 {
        if let Some(byte) = color {
            add(ColumnRole::Color(channel), Field::new(byte + 2 * channel, NumberType::U16));
        }
    }
    if matches!(format, 8 | 10) {
        add(scalar("nir"), Field::new(36, NumberType::U16));
    }
    columns
}

/// A value in the extra bytes as its description states it.
pub(super) struct ExtraField {
    /// Name of the column; values of pairs and triples have a number behind it.
    pub name: String,
    /// Field of the value, whose byte counts from the first extra byte.
    pub field: Field,
    /// The description as one of a single value, without its least and greatest value.
    pub description: [u8; DESCRIPTION_SIZE],
}

/// Returns the columns in the extra bytes.
fn extra_columns(input: &Input, header: &Header) -> Vec<ColumnField> {
    let fields = extra_fields(&extra_descriptions(input, header));
    let n_extra_bytes = header.n_extra_bytes();
    let is_inside =
        |extra: &ExtraField| extra.field.byte + extra.field.number_type.size() <= n_extra_bytes;
    let columns = fields.into_iter().take_while(is_inside).map(|extra| {
        let role = match ColumnRole::from_name(&extra.name) {
            Some(role @ (ColumnRole::Normal(_) | ColumnRole::Radius)) => role,
            // Synonyms, as a calibrated reflectance, stand beside the intensity.
            Some(role @ ColumnRole::Intensity) if plain_name(&extra.name) == role.name() => role,
            _ => ColumnRole::Scalar(extra.name),
        };
        let byte = RECORD_LENGTHS[usize::from(header.point_format)] + extra.field.byte;
        ColumnField { role, field: Field { byte, ..extra.field } }
    });
    columns.collect()
}

/// Returns the descriptions of the extra bytes. Some programs write a record for each column.
pub(super) fn extra_descriptions(input: &Input, header: &Header) -> Vec<u8> {
    let records = header.records.iter().filter(|record| {
        (record.user_id.as_str(), record.record_id) == (EXTRA_BYTES_USER_ID, EXTRA_BYTES_RECORD_ID)
    });
    records.flat_map(|record| &input[record.data.clone()]).copied().collect()
}

/// Returns the values in the extra bytes from the data of the record that describes them (LAS 1.4 R15, table 24).
pub(super) fn extra_fields(descriptions: &[u8]) -> Vec<ExtraField> {
    let mut fields = Vec::new();
    let mut byte = 0;
    for description in descriptions.chunks_exact(DESCRIPTION_SIZE) {
        let (data_type, options) = (description[2], description[3]);
        let Some((number_type, n_values)) = extra_type(data_type) else {
            // Type 0 marks bytes without a meaning, whose number the options hold.
            byte += usize::from(options);
            continue;
        };
        let name = text(&description[4..36]);
        for value in 0..n_values {
            let has_scale = options & HAS_SCALE != 0;
            let has_offset = options & HAS_OFFSET != 0;
            let field = Field {
                scale: if has_scale { read_f64(description, 112 + 8 * value) } else { 1.0 },
                offset: if has_offset { read_f64(description, 136 + 8 * value) } else { 0.0 },
                ..Field::new(byte, number_type)
            };
            let has_no_data = options & HAS_NO_DATA != 0 && field.has_float_column();
            let no_data = has_no_data.then(|| no_data(description, number_type, value));
            let field = Field { no_data, ..field };
            let name = if n_values == 1 { name.clone() } else { format!("{name}[{value}]") };
            let description = single_description(description, &name, value);
            fields.push(ExtraField { name, field, description });
            byte += number_type.size();
        }
    }
    fields
}

/// Returns the number that stands for a missing one in the column `value` of a description, which has it in the widest
/// type of its kind.
fn no_data(description: &[u8], number_type: NumberType, value: usize) -> f64 {
    let bytes = description[40 + 8 * value..].first_chunk().copied().unwrap_or_default();
    match number_type {
        NumberType::U8 | NumberType::U16 | NumberType::U32 | NumberType::U64 => {
            u64::from_le_bytes(bytes) as f64
        }
        NumberType::I8 | NumberType::I16 | NumberType::I32 | NumberType::I64 => {
            i64::from_le_bytes(bytes) as f64
        }
        NumberType::F32 | NumberType::F64 => f64::from_le_bytes(bytes),
    }
}

/// Returns the description of one of the values that `description` describes. Its least and greatest value are left out,
/// as they may differ among other points.
fn single_description(description: &[u8], name: &str, value: usize) -> [u8; DESCRIPTION_SIZE] {
    let mut single = [0; DESCRIPTION_SIZE];
    single[2] = (description[2] - 1) % 10 + 1;
    single[3] = description[3] & (HAS_NO_DATA | HAS_SCALE | HAS_OFFSET);
    put_name(&mut single, name);
    // The value that stands for a missing one, the scale and the offset have 8 bytes for each value.
    for start in [40, 112, 136] {
        let from = start + 8 * value;
        single[start..start + 8].copy_from_slice(&description[from..from + 8]);
    }
    single[160..].copy_from_slice(&description[160..]);
    single
}

/// Writes the name of an extra column into its description, as far as there is room.
pub(super) fn put_name(description: &mut [u8; DESCRIPTION_SIZE], name: &str) {
    let mut length = name.len().min(32);
    // The name is cut between characters.
    while !name.is_char_boundary(length) {
        length -= 1;
    }
    description[4..4 + length].copy_from_slice(&name.as_bytes()[..length]);
}

/// Returns the type and the number of the values of an extra column; types above 10 are the deprecated pairs and
/// triples.
fn extra_type(data_type: u8) -> Option<(NumberType, usize)> {
    const TYPES: [NumberType; 10] = [
        NumberType::U8,
        NumberType::I8,
        NumberType::U16,
        NumberType::I16,
        NumberType::U32,
        NumberType::I32,
        NumberType::U64,
        NumberType::I64,
        NumberType::F32,
        NumberType::F64,
    ];
    let index = usize::from(data_type).checked_sub(1)?;
    (index < 30).then(|| (TYPES[index % 10], index / 10 + 1))
}

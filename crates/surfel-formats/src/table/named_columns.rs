//! Columns of binary and ascii records whose fields have names.

use surfel_core::points::plain_name;
use surfel_core::progress::Progress;

use super::color_range::{ColorRange, is_byte};
use super::column_choice::ColumnChoice;
use super::column_role::ColumnRole;
use super::layout::{ColumnField, Field, NumberType, all_records};

/// Returns columns with roles by their names, and with the scale of colours. Each field has a name.
///
/// The range of floating-point colours also depends on the values in `sample`, the first records. A column named
/// `classification` holds classes if all values in `sample` can be classes, and all in `records`, which may be more, can be classes or are
/// missing. Opacity is left out unless `choice` names it. Once the work is cancelled, the columns are of no use.
pub(crate) fn named_columns<'a>(
    fields: impl Iterator<Item = (&'a str, Field)>,
    stride: usize,
    big_endian: bool,
    sample: &[u8],
    records: &[u8],
    choice: &ColumnChoice,
    progress: &dyn Progress,
) -> Vec<ColumnField> {
    let keeps_alpha = choice.names("alpha");
    let fields: Vec<(&str, Field)> =
        fields.filter(|(name, _)| keeps_alpha || !ColumnRole::is_alpha(name)).collect();
    let is_color = |(name, _): &&(&str, Field)| {
        matches!(ColumnRole::from_name(name), Some(ColumnRole::Color(_)))
    };
    let colors = || fields.iter().filter(is_color);
    let float_range = ColorRange::from_floats(colors().flat_map(|(_, field)| {
        sample.chunks_exact(stride).map(|record| field.value(record, big_endian))
    }));
    // Some programs write colours of 8 bits as numbers of 16.
    let words = colors().map(|(_, field)| field);
    let words: Vec<&Field> = words.filter(|field| field.file_type == NumberType::U16).collect();
    let is_8_bits =
        |record: &[u8]| words.iter().all(|field| field.value(record, big_endian) <= 255.0);
    let word_range = match words.is_empty() || all_records(records, stride, is_8_bits, progress) {
        true => ColorRange::Bits8,
        false => ColorRange::Bits16,
    };
    let names: Vec<&str> = fields.iter().map(|(name, _)| *name).collect();
    let mut columns: Vec<ColumnField> = Vec::new();
    for (mut role, (name, mut field)) in ColumnRole::from_names(&names).into_iter().zip(fields) {
        let number_type = field.file_type;
        let holds_classes = || {
            let mut sample = sample.chunks_exact(stride);
            sample.all(|record| is_byte(field.value(record, big_endian)))
                && field.holds_classes(records, stride, big_endian, progress)
        };
        // A column `class` of such files holds labels, of which 7 is not noise.
        let holds_asprs_classes =
            || plain_name(name).ends_with("classification") && holds_classes();
        if role == ColumnRole::Classification && !holds_asprs_classes() {
            role = ColumnRole::Scalar(name.into());
        }
        let range = match number_type {
            NumberType::F32 | NumberType::F64 => float_range,
            NumberType::U16 => word_range,
            _ => ColorRange::Bits8,
        };
        if let ColumnRole::Color(_) = role {
            field.scale = range.scale();
        } else if ColumnRole::is_alpha(name) {
            role = ColumnRole::Scalar("alpha".into());
            field.scale = range.scale() / 65535.0;
        }
        columns.push(ColumnField { role, field });
    }
    columns
}

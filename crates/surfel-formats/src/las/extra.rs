//! Writes columns without a field in LAS as extra bytes, in the types and units of the file that they come from.

use rayon::prelude::*;
use surfel_core::points::{PointCloud, Values};

use super::fields::{DESCRIPTION_SIZE, ExtraField, put_name};
use crate::table::{Field, NumberType};

/// A column in the extra bytes.
pub(super) struct ExtraColumn<'a> {
    values: ExtraValues<'a>,
    /// Description of the column for the file (LAS 1.4 R15, table 24).
    pub description: [u8; DESCRIPTION_SIZE],
    field: Field,
}

/// The values of an extra column.
#[derive(Clone, Copy)]
pub(super) enum ExtraValues<'a> {
    /// Component of the normals on an axis.
    Normal(usize),
    /// Radii or intensities.
    F32(&'a [f32]),
    /// Scalar column.
    Scalar(&'a Values),
}

impl<'a> ExtraColumn<'a> {
    /// The column of these values, as the field of the same name in `source` if it holds them without loss.
    pub fn new(
        name: &str,
        values: ExtraValues<'a>,
        cloud: &PointCloud,
        source: &[ExtraField],
    ) -> Self {
        let same = source.iter().find(|field| field.name.eq_ignore_ascii_case(name));
        if let Some(ExtraField { field, description, .. }) = same
            && holds(field, values, cloud)
        {
            return Self { values, description: *description, field: *field };
        }
        let mut description = [0; DESCRIPTION_SIZE];
        let (data_type, number_type) = match values {
            ExtraValues::Scalar(Values::U8(_)) => (1, NumberType::U8),
            ExtraValues::Scalar(Values::U16(_)) => (3, NumberType::U16),
            ExtraValues::Scalar(Values::I32(_)) => (6, NumberType::I32),
            ExtraValues::Scalar(Values::F64(_)) => (10, NumberType::F64),
            _ => (9, NumberType::F32),
        };
        description[2] = data_type;
        if let Some(same) = same {
            description[160..].copy_from_slice(&same.description[160..]);
        }
        put_name(&mut description, name);
        Self { values, description, field: Field::new(0, number_type) }
    }

    /// Returns the bytes of a value.
    pub fn size(&self) -> usize {
        self.field.number_type.size()
    }

    /// Appends the value of a point to `bytes`.
    pub fn encode(&self, cloud: &PointCloud, point_idx: usize, bytes: &mut Vec<u8>) {
        let value = self.values.get(cloud, point_idx);
        let (stored, size) = stored(&self.field, value);
        bytes.extend(&stored[..size]);
    }
}

impl ExtraValues<'_> {
    fn get(self, cloud: &PointCloud, i: usize) -> f64 {
        match self {
            Self::Normal(axis) => {
                cloud.normals.as_ref().map_or(0.0, |normals| normals[i][axis].into())
            }
            Self::F32(values) => values[i].into(),
            Self::Scalar(values) => values.get(i),
        }
    }

    /// Returns true if the values are f32 in the cloud.
    fn is_f32(self) -> bool {
        !matches!(self, Self::Scalar(values) if !matches!(values, Values::F32(_)))
    }
}

/// Returns true if reading what is stored in `field` gives the values back.
fn holds(field: &Field, values: ExtraValues, cloud: &PointCloud) -> bool {
    let field = Field { byte: 0, ..*field };
    let is_f32 = values.is_f32();
    (0..cloud.len()).into_par_iter().all(|i| {
        let value = values.get(cloud, i);
        let (stored, size) = stored(&field, value);
        let read = field.value(&stored[..size], false);
        let is_equal = if is_f32 { read as f32 == value as f32 } else { read == value };
        is_equal || read.is_nan() && value.is_nan()
    })
}

/// Returns the bytes of a value in `field`, and their number.
fn stored(field: &Field, value: f64) -> ([u8; 8], usize) {
    let number = match field.no_data {
        Some(no_data) if value.is_nan() => no_data,
        _ => (value - field.offset) / field.scale,
    };
    let mut bytes = [0; 8];
    macro_rules! put {
        ($number:expr) => {{
            let stored = $number.to_le_bytes();
            bytes[..stored.len()].copy_from_slice(&stored);
            (bytes, stored.len())
        }};
    }
    // The casts clamp, and turn NaN to 0.
    match field.number_type {
        NumberType::U8 => put!(number.round() as u8),
        NumberType::I8 => put!(number.round() as i8),
        NumberType::U16 => put!(number.round() as u16),
        NumberType::I16 => put!(number.round() as i16),
        NumberType::U32 => put!(number.round() as u32),
        NumberType::I32 => put!(number.round() as i32),
        NumberType::U64 => put!(number.round() as u64),
        NumberType::I64 => put!(number.round() as i64),
        NumberType::F32 => put!((number as f32)),
        NumberType::F64 => put!(number),
    }
}

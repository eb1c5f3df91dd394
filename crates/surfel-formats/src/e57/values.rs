//! The values of a field: floats, or integers of any number of bits that follow one another without gaps.

use e57::RecordDataType;

use super::pages::Pages;
use super::streams::Stream;
use crate::table::NumberType;

/// The encoding of a field's values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Single,
    Double,
    /// Integers of `n_bits` above `min`, which mean `integer * scale + offset`.
    Integer {
        n_bits: u32,
        min: i64,
        scale: f64,
        offset: f64,
    },
}

impl Encoding {
    /// The encoding of values of a type.
    pub fn new(data_type: &RecordDataType) -> Self {
        let integer = |min: i64, max: i64, scale, offset| {
            let n_bits = 64 - max.wrapping_sub(min).leading_zeros();
            Self::Integer { n_bits, min, scale, offset }
        };
        match *data_type {
            RecordDataType::Single { .. } => Self::Single,
            RecordDataType::Double { .. } => Self::Double,
            RecordDataType::Integer { min, max } => integer(min, max, 1.0, 0.0),
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                integer(min, max, scale, offset)
            }
        }
    }

    /// Returns the bits of a value; 0 if all values are the same.
    pub fn n_bits(&self) -> u64 {
        match self {
            Self::Single => 32,
            Self::Double => 64,
            Self::Integer { n_bits, .. } => u64::from(*n_bits),
        }
    }

    /// Returns the narrowest type that holds the values.
    pub fn number_type(&self) -> NumberType {
        match *self {
            Self::Single => NumberType::F32,
            Self::Integer { n_bits, min, scale: 1.0, offset: 0.0 } => match (min, n_bits) {
                (0, ..=8) => NumberType::U8,
                (0, ..=16) => NumberType::U16,
                (0, ..=31) => NumberType::I32,
                _ => NumberType::F64,
            },
            Self::Integer { n_bits: ..=24, .. } => NumberType::F32,
            Self::Double | Self::Integer { .. } => NumberType::F64,
        }
    }

    /// Decodes the values from `first` on; the stream must have them.
    pub fn decode(&self, stream: &Stream, pages: Pages, first: u64, out: &mut [f64]) {
        let first_bit = first * self.n_bits();
        let end_bit = first_bit + out.len() as u64 * self.n_bits();
        let n_bytes = (end_bit.div_ceil(8) - first_bit / 8) as usize;
        // Values are taken from 16 bytes at a time.
        let mut bytes = vec![0; n_bytes + 16];
        if 0 < n_bytes {
            stream.copy(pages, first_bit / 8, &mut bytes[..n_bytes]);
        }
        match *self {
            Self::Single => {
                let values = bytes.as_chunks().0;
                out.iter_mut().zip(values).for_each(|(v, b)| *v = f32::from_le_bytes(*b).into());
            }
            Self::Double => {
                let values = bytes.as_chunks().0;
                out.iter_mut().zip(values).for_each(|(v, b)| *v = f64::from_le_bytes(*b));
            }
            Self::Integer { n_bits: 0, min, scale, offset } => {
                out.fill(min as f64 * scale + offset)
            }
            Self::Integer { n_bits, min, scale, offset } => {
                let mask = u64::MAX >> (64 - n_bits);
                let mut bit = (first_bit % 8) as usize;
                for value in out {
                    let window = bytes[bit / 8..].first_chunk().expect("the buffer is padded");
                    let raw = (u128::from_le_bytes(*window) >> (bit % 8)) as u64 & mask;
                    *value = min.wrapping_add(raw as i64) as f64 * scale + offset;
                    bit += n_bits as usize;
                }
            }
        }
    }
}

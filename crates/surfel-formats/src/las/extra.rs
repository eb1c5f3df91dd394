//! Columns that LAS has no field for, written as extra bytes.

use surfel::points::{PointCloud, Values};

use super::fields::DESCRIPTION;

/// A column in the extra bytes.
pub(super) struct Extra<'a> {
    pub name: String,
    pub column: ExtraColumn<'a>,
}

pub(super) enum ExtraColumn<'a> {
    Normal(usize),
    F32(&'a [f32]),
    Scalar(&'a Values),
}

impl Extra<'_> {
    /// Bytes of a value.
    pub fn size(&self) -> usize {
        match self.column {
            ExtraColumn::Normal(_) | ExtraColumn::F32(_) => 4,
            ExtraColumn::Scalar(Values::U8(_)) => 1,
            ExtraColumn::Scalar(Values::U16(_)) => 2,
            ExtraColumn::Scalar(Values::I32(_) | Values::F32(_)) => 4,
            ExtraColumn::Scalar(Values::F64(_)) => 8,
        }
    }

    /// What the file says of the column (LAS 1.4 R15, table 24).
    pub fn description(&self) -> [u8; DESCRIPTION] {
        let mut description = [0; DESCRIPTION];
        description[2] = match self.column {
            ExtraColumn::Scalar(Values::U8(_)) => 1,
            ExtraColumn::Scalar(Values::U16(_)) => 3,
            ExtraColumn::Scalar(Values::I32(_)) => 6,
            ExtraColumn::Scalar(Values::F64(_)) => 10,
            _ => 9,
        };
        let mut length = self.name.len().min(32);
        // A name is not cut inside a letter.
        while !self.name.is_char_boundary(length) {
            length -= 1;
        }
        description[4..4 + length].copy_from_slice(&self.name.as_bytes()[..length]);
        description
    }

    pub fn encode(&self, cloud: &PointCloud, point_idx: usize, bytes: &mut Vec<u8>) {
        let i = point_idx;
        match self.column {
            ExtraColumn::Normal(axis) => {
                let normal = cloud.normals.as_ref().map_or(0.0, |normals| normals[i][axis]);
                bytes.extend(normal.to_le_bytes());
            }
            ExtraColumn::F32(v) => bytes.extend(v[i].to_le_bytes()),
            ExtraColumn::Scalar(Values::U8(v)) => bytes.push(v[i]),
            ExtraColumn::Scalar(Values::U16(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraColumn::Scalar(Values::I32(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraColumn::Scalar(Values::F32(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraColumn::Scalar(Values::F64(v)) => bytes.extend(v[i].to_le_bytes()),
        }
    }
}

//! Writes columns without a field in LAS as extra bytes.

use surfel_core::points::{PointCloud, Values};

use super::fields::DESCRIPTION_SIZE;

/// A column in the extra bytes.
pub(super) struct ExtraColumn<'a> {
    /// Name of the dimension.
    pub name: String,
    /// Values of the dimension.
    pub values: ExtraValues<'a>,
}

/// The values of an extra column.
pub(super) enum ExtraValues<'a> {
    /// Component of the normals on an axis.
    Normal(usize),
    /// Radii or intensities.
    F32(&'a [f32]),
    /// Scalar column.
    Scalar(&'a Values),
}

impl ExtraColumn<'_> {
    /// Returns the bytes of a value.
    pub fn size(&self) -> usize {
        match self.values {
            ExtraValues::Normal(_) | ExtraValues::F32(_) => 4,
            ExtraValues::Scalar(Values::U8(_)) => 1,
            ExtraValues::Scalar(Values::U16(_)) => 2,
            ExtraValues::Scalar(Values::I32(_) | Values::F32(_)) => 4,
            ExtraValues::Scalar(Values::F64(_)) => 8,
        }
    }

    /// Returns the description of the column for the file (LAS 1.4 R15, table 24).
    pub fn description(&self) -> [u8; DESCRIPTION_SIZE] {
        let mut description = [0; DESCRIPTION_SIZE];
        description[2] = match self.values {
            ExtraValues::Scalar(Values::U8(_)) => 1,
            ExtraValues::Scalar(Values::U16(_)) => 3,
            ExtraValues::Scalar(Values::I32(_)) => 6,
            ExtraValues::Scalar(Values::F64(_)) => 10,
            _ => 9,
        };
        let mut length = self.name.len().min(32);
        // The name is cut between characters.
        while !self.name.is_char_boundary(length) {
            length -= 1;
        }
        description[4..4 + length].copy_from_slice(&self.name.as_bytes()[..length]);
        description
    }

    /// Appends the value of a point to `bytes`.
    pub fn encode(&self, cloud: &PointCloud, point_idx: usize, bytes: &mut Vec<u8>) {
        let i = point_idx;
        match self.values {
            ExtraValues::Normal(axis) => {
                let normal = cloud.normals.as_ref().map_or(0.0, |normals| normals[i][axis]);
                bytes.extend(normal.to_le_bytes());
            }
            ExtraValues::F32(v) => bytes.extend(v[i].to_le_bytes()),
            ExtraValues::Scalar(Values::U8(v)) => bytes.push(v[i]),
            ExtraValues::Scalar(Values::U16(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraValues::Scalar(Values::I32(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraValues::Scalar(Values::F32(v)) => bytes.extend(v[i].to_le_bytes()),
            ExtraValues::Scalar(Values::F64(v)) => bytes.extend(v[i].to_le_bytes()),
        }
    }
}

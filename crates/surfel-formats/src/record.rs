//! Records of fixed length, as PLY, LAS and parsed text all come down to, decoded into columns.

use surfel::math::{DVec3, Vec3};
use surfel::points::{PointCloud, Scalar, Values};

use crate::block::{Block, ValuesMut};
use crate::options::ColumnChoice;
use crate::role::Role;

/// A number as it stands in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// Where a number stands and how it becomes a value: `((bits >> shift) & mask) * scale + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    pub byte: usize,
    pub kind: Kind,
    /// Lowest bit and number of bits of an unsigned field that shares its byte.
    pub bits: Option<(u32, u32)>,
    pub scale: f64,
    pub offset: f64,
}

/// A column of the file that becomes one of the cloud.
#[derive(Clone, Debug)]
pub(crate) struct ColumnField {
    pub role: Role,
    pub field: Field,
}

/// How the records of a file become the columns of a cloud.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub stride: usize,
    pub big_endian: bool,
    pub position: [Field; 3],
    normal: Option<[Field; 3]>,
    color: Option<[Field; 3]>,
    radius: Option<Field>,
    intensity: Option<Field>,
    classification: Option<Field>,
    scalars: Vec<(String, Field)>,
}

impl Kind {
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

impl Field {
    pub fn new(byte: usize, kind: Kind) -> Self {
        Self { byte, kind, bits: None, scale: 1.0, offset: 0.0 }
    }

    /// The field's value in the record that `record` starts with.
    pub fn value(&self, record: &[u8], big_endian: bool) -> f64 {
        let mut value = 0.0;
        self.for_each(record, record.len(), big_endian, |_, v| value = v);
        value
    }

    /// Hands `take` the index and value of the field in each record.
    fn for_each(
        &self,
        records: &[u8],
        stride: usize,
        big_endian: bool,
        mut take: impl FnMut(usize, f64),
    ) {
        // The kind is looked at once, not once a record: each arm is a loop of its own.
        macro_rules! each {
            ($number:ty) => {
                for (i, record) in records.chunks_exact(stride).enumerate() {
                    let bytes = record[self.byte..].first_chunk().copied().unwrap_or_default();
                    let number = if big_endian {
                        <$number>::from_be_bytes(bytes)
                    } else {
                        <$number>::from_le_bytes(bytes)
                    };
                    take(i, number as f64 * self.scale + self.offset);
                }
            };
        }
        if let Some((lowest, n_bits)) = self.bits {
            for (i, record) in records.chunks_exact(stride).enumerate() {
                take(i, f64::from((record[self.byte] >> lowest) & ((1u16 << n_bits) - 1) as u8));
            }
            return;
        }
        match self.kind {
            Kind::I8 => each!(i8),
            Kind::U8 => each!(u8),
            Kind::I16 => each!(i16),
            Kind::U16 => each!(u16),
            Kind::I32 => each!(i32),
            Kind::U32 => each!(u32),
            Kind::I64 => each!(i64),
            Kind::U64 => each!(u64),
            Kind::F32 => each!(f32),
            Kind::F64 => each!(f64),
        }
    }

    /// An empty column of the narrowest type that holds the field's values.
    fn empty_values(&self) -> Values {
        let is_scaled = self.scale != 1.0 || self.offset != 0.0;
        match self.kind {
            Kind::F64 | Kind::U32 | Kind::I64 | Kind::U64 => Values::F64(Vec::new()),
            Kind::I32 if is_scaled => Values::F64(Vec::new()),
            Kind::F32 => Values::F32(Vec::new()),
            _ if is_scaled => Values::F32(Vec::new()),
            Kind::U8 => Values::U8(Vec::new()),
            Kind::U16 => Values::U16(Vec::new()),
            Kind::I8 | Kind::I16 | Kind::I32 => Values::I32(Vec::new()),
        }
    }
}

impl Layout {
    /// The layout of records with these columns, of which `choice` are kept; `None` without x, y and z.
    ///
    /// Colours are expected scaled to 0..65535. Of two columns with one role the first has it.
    pub fn new(
        stride: usize,
        big_endian: bool,
        columns: Vec<ColumnField>,
        choice: &ColumnChoice,
    ) -> Option<Self> {
        let find = |role: Role| {
            columns.iter().find(|column| column.role == role).map(|column| column.field)
        };
        let triple = |role: fn(usize) -> Role| {
            choice
                .wants(&role(0))
                .then(|| Some([find(role(0))?, find(role(1))?, find(role(2))?]))
                .flatten()
        };
        let single = |role: Role| choice.wants(&role).then(|| find(role)).flatten();
        let mut scalars: Vec<(String, Field)> = Vec::new();
        for column in &columns {
            if let Role::Scalar(name) = &column.role
                && choice.wants(&column.role)
                && !scalars.iter().any(|(other, _)| other.eq_ignore_ascii_case(name))
            {
                scalars.push((name.clone(), column.field));
            }
        }
        Some(Self {
            stride,
            big_endian,
            position: triple(Role::Position)?,
            normal: triple(Role::Normal),
            color: triple(Role::Color),
            radius: single(Role::Radius),
            intensity: single(Role::Intensity),
            classification: single(Role::Classification),
            scalars,
        })
    }

    /// A cloud of no points that has the layout's columns.
    pub fn empty_cloud(&self, origin: DVec3) -> PointCloud {
        PointCloud {
            origin,
            positions: Vec::new(),
            normals: self.normal.map(|_| Vec::new()),
            radii: self.radius.map(|_| Vec::new()),
            colors: self.color.map(|_| Vec::new()),
            intensity: self.intensity.map(|_| Vec::new()),
            classification: self.classification.map(|_| Vec::new()),
            scalars: self
                .scalars
                .iter()
                .map(|(name, field)| Scalar { name: name.clone(), values: field.empty_values() })
                .collect(),
        }
    }

    /// World position of a single record.
    pub fn world_position(&self, record: &[u8]) -> DVec3 {
        DVec3::from_array(self.position.map(|field| field.value(record, self.big_endian)))
    }

    /// Fills `block` from as many records.
    pub fn decode(&self, records: &[u8], origin: DVec3, block: &mut Block) {
        for axis in 0..3 {
            self.each(&self.position[axis], records, |i, v| {
                block.positions[i][axis] = (v - origin[axis]) as f32;
            });
        }
        if let (Some(fields), Some(normals)) = (&self.normal, &mut block.normals) {
            for (axis, field) in fields.iter().enumerate() {
                self.each(field, records, |i, v| normals[i][axis] = v as f32);
            }
            normals.iter_mut().for_each(|normal| *normal = unit(*normal));
        }
        if let (Some(fields), Some(colors)) = (&self.color, &mut block.colors) {
            for (channel, field) in fields.iter().enumerate() {
                // The cast takes what lies outside to the nearest end, and NaN to black.
                self.each(field, records, |i, v| colors[i][channel] = (v + 0.5) as u16);
            }
        }
        if let (Some(field), Some(radii)) = (&self.radius, &mut block.radii) {
            self.each(field, records, |i, v| radii[i] = v as f32);
        }
        if let (Some(field), Some(intensity)) = (&self.intensity, &mut block.intensity) {
            self.each(field, records, |i, v| intensity[i] = v as f32);
        }
        if let (Some(field), Some(classes)) = (&self.classification, &mut block.classification) {
            self.each(field, records, |i, v| classes[i] = v as u8);
        }
        for ((_, field), values) in self.scalars.iter().zip(&mut block.scalars) {
            match values {
                ValuesMut::U8(out) => self.each(field, records, |i, v| out[i] = v as u8),
                ValuesMut::U16(out) => self.each(field, records, |i, v| out[i] = v as u16),
                ValuesMut::I32(out) => self.each(field, records, |i, v| out[i] = v as i32),
                ValuesMut::F32(out) => self.each(field, records, |i, v| out[i] = v as f32),
                ValuesMut::F64(out) => self.each(field, records, |i, v| out[i] = v),
            }
        }
    }

    fn each(&self, field: &Field, records: &[u8], take: impl FnMut(usize, f64)) {
        field.for_each(records, self.stride, self.big_endian, take);
    }
}

/// `normal` at unit length; one that has no direction stays as it is.
fn unit(normal: Vec3) -> Vec3 {
    let length = normal.length();
    // Dividing a vector that is unit already would change its last bits.
    if (length - 1.0).abs() < 1e-6 || !(0.0 < length && length < f32::INFINITY) {
        return normal;
    }
    normal / length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_scales_and_byte_orders_are_honoured() {
        let record = [0b1010_0110, 0x01, 0x02];
        let bits = Field { bits: Some((5, 3)), ..Field::new(0, Kind::U8) };
        assert_eq!(bits.value(&record, false), 5.0);
        let number = Field { scale: 0.5, offset: 1.0, ..Field::new(1, Kind::U16) };
        assert_eq!(number.value(&record, true), 130.0);
        assert_eq!(number.value(&record, false), 257.5);
    }
}

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
        let mut value = [0.0];
        self.fill(record, record.len(), big_endian, &mut value, |slot, v| *slot = v);
        value[0]
    }

    /// Has `set` put the field's value in each record into the same place of `out`.
    fn fill<T>(
        &self,
        records: &[u8],
        stride: usize,
        big_endian: bool,
        out: &mut [T],
        set: impl Fn(&mut T, f64),
    ) {
        let records = records.chunks_exact(stride).zip(out);
        if let Some((lowest, n_bits)) = self.bits {
            let mask = ((1u16 << n_bits) - 1) as u8;
            for (record, slot) in records {
                set(slot, f64::from((record[self.byte] >> lowest) & mask));
            }
            return;
        }
        // The kind is looked at once, not once a record: each arm is a loop of its own.
        macro_rules! fill {
            ($number:ty) => {
                for (record, slot) in records {
                    let bytes = record[self.byte..].first_chunk().copied().unwrap_or_default();
                    let number = if big_endian {
                        <$number>::from_be_bytes(bytes)
                    } else {
                        <$number>::from_le_bytes(bytes)
                    };
                    set(slot, number as f64 * self.scale + self.offset);
                }
            };
        }
        match self.kind {
            Kind::I8 => fill!(i8),
            Kind::U8 => fill!(u8),
            Kind::I16 => fill!(i16),
            Kind::U16 => fill!(u16),
            Kind::I32 => fill!(i32),
            Kind::U32 => fill!(u32),
            Kind::I64 => fill!(i64),
            Kind::U64 => fill!(u64),
            Kind::F32 => fill!(f32),
            Kind::F64 => fill!(f64),
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
            ..PointCloud::default()
        }
    }

    /// World position of a single record.
    pub fn world_position(&self, record: &[u8]) -> DVec3 {
        DVec3::from_array(self.position.map(|field| field.value(record, self.big_endian)))
    }

    /// Fills `block` from as many records.
    pub fn decode(&self, records: &[u8], origin: DVec3, block: &mut Block) {
        for axis in 0..3 {
            let zero = origin[axis];
            let set = |position: &mut Vec3, v: f64| position[axis] = (v - zero) as f32;
            self.fill(&self.position[axis], records, block.positions, set);
        }
        if let (Some(fields), Some(normals)) = (&self.normal, &mut block.normals) {
            for (axis, field) in fields.iter().enumerate() {
                self.fill(field, records, normals, |normal, v| normal[axis] = v as f32);
            }
            normals.iter_mut().for_each(|normal| *normal = unit(*normal));
        }
        if let (Some(fields), Some(colors)) = (&self.color, &mut block.colors) {
            for (channel, field) in fields.iter().enumerate() {
                // The cast takes what lies outside to the nearest end, and NaN to black.
                self.fill(field, records, colors, |color, v| color[channel] = (v + 0.5) as u16);
            }
        }
        if let (Some(field), Some(radii)) = (&self.radius, &mut block.radii) {
            self.fill(field, records, radii, |radius, v| *radius = v as f32);
        }
        if let (Some(field), Some(intensity)) = (&self.intensity, &mut block.intensity) {
            self.fill(field, records, intensity, |slot, v| *slot = v as f32);
        }
        if let (Some(field), Some(classes)) = (&self.classification, &mut block.classification) {
            self.fill(field, records, classes, |class, v| *class = v as u8);
        }
        for ((_, field), values) in self.scalars.iter().zip(&mut block.scalars) {
            match values {
                ValuesMut::U8(out) => self.fill(field, records, out, |slot, v| *slot = v as u8),
                ValuesMut::U16(out) => self.fill(field, records, out, |slot, v| *slot = v as u16),
                ValuesMut::I32(out) => self.fill(field, records, out, |slot, v| *slot = v as i32),
                ValuesMut::F32(out) => self.fill(field, records, out, |slot, v| *slot = v as f32),
                ValuesMut::F64(out) => self.fill(field, records, out, |slot, v| *slot = v),
            }
        }
    }

    fn fill<T>(&self, field: &Field, records: &[u8], out: &mut [T], set: impl Fn(&mut T, f64)) {
        field.fill(records, self.stride, self.big_endian, out, set);
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

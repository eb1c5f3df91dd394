//! The layout of records of fixed length, which PLY, LAS and parsed text share, and their decoding into columns.

use rayon::prelude::*;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::{NoProgress, Progress};

use super::color_range::is_byte;
use super::column_choice::ColumnChoice;
use super::column_role::ColumnRole;
use super::column_slices::{ColumnSlices, ValuesMut};

/// The type of a number in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberType {
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

/// A number in a record, and its conversion to a value: `((bits >> shift) & mask) * scale + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    /// Byte of the record at which the number begins.
    pub byte: usize,
    /// Type of the number in the record.
    pub number_type: NumberType,
    /// Type of the number in the file, which differs from that in a record that was parsed. Scalar columns have the
    /// narrowest type that holds it.
    pub file_type: NumberType,
    /// Lowest bit and number of bits of an unsigned field that shares its byte with others.
    pub bits: Option<(u32, u32)>,
    /// Factor of the number.
    pub scale: f64,
    /// Summand after the factor.
    pub offset: f64,
    /// Number in the record that stands for a missing value, which is read as NaN. Only columns of floats can hold it.
    pub no_data: Option<f64>,
}

/// A column of a file: its role in the cloud, and its field in the records.
#[derive(Clone, Debug)]
pub(crate) struct ColumnField {
    /// Meaning of the column.
    pub role: ColumnRole,
    /// The column's field in a record.
    pub field: Field,
}

/// The fields of a file's records that become columns of a cloud.
#[derive(Clone, Debug)]
pub(crate) struct RecordLayout {
    /// Bytes from one record to the next.
    pub stride: usize,
    /// True if numbers have their most significant byte first.
    pub big_endian: bool,
    /// Fields of x, y and z.
    pub position: [Field; 3],
    normal: Option<[Field; 3]>,
    color: Option<[Field; 3]>,
    radius: Option<Field>,
    intensity: Option<Field>,
    classification: Option<Field>,
    scalars: Vec<(String, Field)>,
}

impl NumberType {
    /// Returns the size in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Returns true for floats.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

impl Field {
    /// An unscaled number at `byte`.
    pub fn new(byte: usize, number_type: NumberType) -> Self {
        let (scale, offset) = (1.0, 0.0);
        Self { byte, number_type, file_type: number_type, bits: None, scale, offset, no_data: None }
    }

    /// A number of `file_type` that was parsed to f64 at `byte`.
    pub fn parsed(byte: usize, file_type: NumberType) -> Self {
        Self { file_type, ..Self::new(byte, NumberType::F64) }
    }

    /// Returns the byte of a record at which the field ends.
    pub fn end(&self) -> usize {
        self.byte + self.number_type.size()
    }

    /// Returns the field's value in the record that `record` starts with.
    pub fn value(&self, record: &[u8], big_endian: bool) -> f64 {
        let mut value = [0.0];
        self.fill(record, record.len(), big_endian, &mut value, |slot, v| *slot = v);
        value[0]
    }

    /// Returns true if the column of the field has floats, which may be NaN.
    pub fn has_float_column(&self) -> bool {
        matches!(self.empty_values(), Values::F32(_) | Values::F64(_))
    }

    /// Returns true if all values in `records` can be classes or are missing; false once the work is cancelled.
    pub fn holds_classes(
        &self,
        records: &[u8],
        stride: usize,
        big_endian: bool,
        progress: &dyn Progress,
    ) -> bool {
        let is_class = |record: &[u8]| {
            let value = self.value(record, big_endian);
            is_byte(value) || value.is_nan()
        };
        self.file_type == NumberType::U8 || all_records(records, stride, is_class, progress)
    }

    /// Calls `set` with each element of `out` and the field's value in the record of the same index.
    fn fill<T>(
        &self,
        records: &[u8],
        stride: usize,
        big_endian: bool,
        out: &mut [T],
        set: impl Fn(&mut T, f64),
    ) {
        // A value that is no number equals no other.
        let missing = self.no_data.map_or(f64::NAN, |number| number * self.scale + self.offset);
        let set = |slot: &mut T, value: f64| {
            set(slot, if value == missing { f64::NAN } else { value });
        };
        let records = records.chunks_exact(stride).zip(out);
        if let Some((lowest, n_bits)) = self.bits {
            let mask = ((1u16 << n_bits) - 1) as u8;
            for (record, slot) in records {
                set(slot, f64::from((record[self.byte] >> lowest) & mask));
            }
            return;
        }
        // Each arm is a loop of its own, so that the type is examined once, not once a record.
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
        match self.number_type {
            NumberType::I8 => fill!(i8),
            NumberType::U8 => fill!(u8),
            NumberType::I16 => fill!(i16),
            NumberType::U16 => fill!(u16),
            NumberType::I32 => fill!(i32),
            NumberType::U32 => fill!(u32),
            NumberType::I64 => fill!(i64),
            NumberType::U64 => fill!(u64),
            NumberType::F32 => fill!(f32),
            NumberType::F64 => fill!(f64),
        }
    }

    /// Returns an empty column of the narrowest type that holds the field's values.
    fn empty_values(&self) -> Values {
        let is_scaled = self.scale != 1.0 || self.offset != 0.0;
        match self.file_type {
            NumberType::F64 | NumberType::U32 | NumberType::I64 | NumberType::U64 => {
                Values::F64(Vec::new())
            }
            NumberType::I32 if is_scaled => Values::F64(Vec::new()),
            NumberType::F32 => Values::F32(Vec::new()),
            _ if is_scaled => Values::F32(Vec::new()),
            NumberType::U8 => Values::U8(Vec::new()),
            NumberType::U16 => Values::U16(Vec::new()),
            NumberType::I8 | NumberType::I16 | NumberType::I32 => Values::I32(Vec::new()),
        }
    }
}

impl RecordLayout {
    /// The layout of records with these columns, of which those of `choice` are kept; `None` without x, y and z.
    ///
    /// Colours must be scaled to 0..65535. If two columns have one role, the first is used.
    pub fn new(
        stride: usize,
        big_endian: bool,
        columns: Vec<ColumnField>,
        choice: &ColumnChoice,
    ) -> Option<Self> {
        let find = |role: ColumnRole| {
            columns.iter().find(|column| column.role == role).map(|column| column.field)
        };
        let triple = |role: fn(usize) -> ColumnRole| {
            choice
                .wants(&role(0))
                .then(|| Some([find(role(0))?, find(role(1))?, find(role(2))?]))
                .flatten()
        };
        let single = |role: ColumnRole| choice.wants(&role).then(|| find(role)).flatten();
        let mut scalars: Vec<(String, Field)> = Vec::new();
        for column in &columns {
            if let ColumnRole::Scalar(name) = &column.role
                && choice.wants(&column.role)
                && !scalars.iter().any(|(other, _)| other.eq_ignore_ascii_case(name))
            {
                scalars.push((name.clone(), column.field));
            }
        }
        Some(Self {
            stride,
            big_endian,
            position: triple(ColumnRole::Position)?,
            normal: triple(ColumnRole::Normal),
            color: triple(ColumnRole::Color),
            radius: single(ColumnRole::Radius),
            intensity: single(ColumnRole::Intensity),
            classification: single(ColumnRole::Classification),
            scalars,
        })
    }

    /// Returns a cloud without points that has the layout's columns.
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

    /// Makes the classes of `cloud` a scalar column, in which they are not clamped to bytes, if a batch of further
    /// records has a value that is no class.
    pub fn demote_classes(&mut self, batch: &[Vec<u8>], cloud: &mut PointCloud) {
        let Some(field) = self.classification else { return };
        let (stride, big_endian) = (self.stride, self.big_endian);
        // A batch is small enough to be looked through to its end.
        let holds_classes =
            |records: &Vec<u8>| field.holds_classes(records, stride, big_endian, &NoProgress);
        if batch.iter().all(holds_classes) {
            return;
        }
        self.classification = None;
        let classes = cloud.classification.take().unwrap_or_default().into_iter();
        let values = match field.empty_values() {
            Values::U8(_) => Values::U8(classes.collect()),
            Values::U16(_) => Values::U16(classes.map(u16::from).collect()),
            Values::I32(_) => Values::I32(classes.map(i32::from).collect()),
            Values::F32(_) => Values::F32(classes.map(f32::from).collect()),
            Values::F64(_) => Values::F64(classes.map(f64::from).collect()),
        };
        let name = "classification".to_owned();
        self.scalars.push((name.clone(), field));
        cloud.scalars.push(Scalar { name, values });
    }

    /// Returns the world position of a single record.
    pub fn world_position(&self, record: &[u8]) -> DVec3 {
        DVec3::from_array(self.position.map(|field| field.value(record, self.big_endian)))
    }

    /// Decodes records into `slices`, which has as many points; positions are relative to `origin`.
    pub fn decode(&self, records: &[u8], origin: DVec3, slices: &mut ColumnSlices) {
        for axis in 0..3 {
            let zero = origin[axis];
            let set = |position: &mut Vec3, v: f64| position[axis] = (v - zero) as f32;
            self.fill(&self.position[axis], records, slices.positions, set);
        }
        if let (Some(fields), Some(normals)) = (&self.normal, &mut slices.normals) {
            for (axis, field) in fields.iter().enumerate() {
                self.fill(field, records, normals, |normal, v| normal[axis] = v as f32);
            }
            normals.iter_mut().for_each(|normal| *normal = rounded_to_unit(*normal));
        }
        if let (Some(fields), Some(colors)) = (&self.color, &mut slices.colors) {
            for (channel, field) in fields.iter().enumerate() {
                // The cast clamps, and turns NaN to black.
                self.fill(field, records, colors, |color, v| color[channel] = (v + 0.5) as u16);
            }
        }
        if let (Some(field), Some(radii)) = (&self.radius, &mut slices.radii) {
            self.fill(field, records, radii, |radius, v| *radius = v as f32);
        }
        if let (Some(field), Some(intensity)) = (&self.intensity, &mut slices.intensity) {
            self.fill(field, records, intensity, |slot, v| *slot = v as f32);
        }
        if let (Some(field), Some(classes)) = (&self.classification, &mut slices.classification) {
            self.fill(field, records, classes, |class, v| *class = v as u8);
        }
        for ((_, field), values) in self.scalars.iter().zip(&mut slices.scalars) {
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

/// Returns true if `holds` is true for all records, which threads look through; false once the work is cancelled.
pub(super) fn all_records(
    records: &[u8],
    stride: usize,
    holds: impl Fn(&[u8]) -> bool + Sync,
    progress: &dyn Progress,
) -> bool {
    const RECORDS_PER_TASK: usize = 1 << 14;
    records
        .par_chunks(RECORDS_PER_TASK * stride)
        .all(|records| !progress.is_cancelled() && records.chunks_exact(stride).all(&holds))
}

/// Returns a normal that has unit length but for rounding at unit length. Other lengths may be radii.
fn rounded_to_unit(normal: Vec3) -> Vec3 {
    /// Greatest error of a length that is rounding, as of normals with two decimals.
    const MAX_ROUNDING: f32 = 0.01;
    let error = (normal.length() - 1.0).abs();
    // Division would change the last bits of a vector that is normalized already.
    if (1e-6..MAX_ROUNDING).contains(&error) { normal / normal.length() } else { normal }
}

#[cfg(test)]
mod tests {
    //! Values of binary fields of all types, bit widths, scales and byte orders.

    use super::*;

    #[test]
    fn field_values_respect_bits_scale_and_byte_order() {
        let record = [0b1010_0110, 0x01, 0x02];
        let bits = Field { bits: Some((5, 3)), ..Field::new(0, NumberType::U8) };
        assert_eq!(bits.value(&record, false), 5.0);
        let number = Field { scale: 0.5, offset: 1.0, ..Field::new(1, NumberType::U16) };
        assert_eq!(number.value(&record, true), 130.0);
        assert_eq!(number.value(&record, false), 257.5);
        let missing = Field { no_data: Some(513.0), ..number };
        assert!(missing.value(&record, false).is_nan());
        assert_eq!(missing.value(&record, true), 130.0);
    }
}

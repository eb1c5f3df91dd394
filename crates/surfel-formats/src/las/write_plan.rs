//! Maps a cloud's columns to the records of a LAS file: version, point format, scales and extra bytes.

use std::ops::Range;

use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, Values};

use super::crs::projection_records;
use super::extra::{ExtraColumn, ExtraValues};
use super::fields::{SCAN_ANGLE_STEP, extra_fields, flag_fields};
use super::point_format::PointFields;
use crate::options::{LasProfile, SaveOptions};
use crate::table::decimal_step;

/// Minor version of LAS 1 of clouds that come from no LAS file.
const DEFAULT_MINOR_VERSION: u8 = 4;

/// The layout of a cloud's records in a file.
pub(super) struct WritePlan<'a> {
    /// Minor version of LAS 1.
    pub minor_version: u8,
    /// Fields of the point format.
    pub fields: PointFields,
    /// Line that says what differs from the version and the point format of the source, and why.
    pub change: Option<String>,
    /// Global encoding of the source.
    pub global_encoding: Option<u16>,
    /// Unit of integer coordinates.
    pub scale: DVec3,
    /// World coordinates of the integer coordinates 0.
    pub offset: DVec3,
    /// Columns that standard fields hold.
    pub standard: StandardColumns<'a>,
    /// Columns in the extra bytes.
    pub extras: Vec<ExtraColumn<'a>>,
    /// Records of the coordinate system, by their ids.
    pub projection: Vec<(u16, Vec<u8>)>,
}

/// The columns that standard fields hold.
#[derive(Default)]
pub(super) struct StandardColumns<'a> {
    pub intensity: Option<&'a [f32]>,
    pub return_number: Option<&'a Values>,
    number_of_returns: Option<&'a Values>,
    user_data: Option<&'a Values>,
    scan_angle: Option<&'a Values>,
    point_source_id: Option<&'a Values>,
    pub gps_time: Option<&'a Values>,
    nir: Option<&'a Values>,
    flags: Vec<(&'a str, &'a Values)>,
}

impl<'a> WritePlan<'a> {
    /// Chooses fields that hold the cloud's columns without loss, those of the source if these do.
    pub fn new(cloud: &'a PointCloud, options: &SaveOptions) -> Self {
        let source = options.las.as_ref();
        let has_nir = source.is_some_and(|las| PointFields::of_format(las.point_format).has_nir);
        let extra_fields = extra_fields(source.map_or(&[], |las| &las.extra_bytes));
        let (standard, extras) = assign_columns(cloud, cloud.colors.is_some() || has_nir);
        let extras = extras
            .into_iter()
            .map(|(name, values)| ExtraColumn::new(&name, values, cloud, &extra_fields))
            .collect();
        let (fields, reasons) = choose_fields(cloud, cloud.len() as u64, &standard, source);
        let minor_version =
            fields.minor_version(source.map_or(DEFAULT_MINOR_VERSION, |las| las.minor_version));
        let (scale, offset) = choose_steps(cloud, options);
        Self {
            minor_version,
            fields,
            change: source.and_then(|las| describe_change(las, minor_version, fields, &reasons)),
            global_encoding: source.map(|las| las.global_encoding),
            scale,
            offset,
            standard,
            extras,
            projection: projection_records(options, fields.is_extended),
        }
    }

    /// Returns the bytes of the extra columns of a point.
    pub fn n_extra_bytes(&self) -> usize {
        self.extras.iter().map(ExtraColumn::size).sum()
    }

    /// Encodes the records of these points.
    pub fn encode(&self, cloud: &PointCloud, points: Range<usize>) -> Vec<u8> {
        let flags = self.flag_columns();
        let mut bytes = Vec::new();
        for i in points {
            for coordinate in self.quantized(cloud, i) {
                bytes.extend(coordinate.to_le_bytes());
            }
            bytes.extend((self.standard.intensity.map_or(0, |v| v[i] as u16)).to_le_bytes());
            self.encode_return(cloud, i, &flags, &mut bytes);
            if self.fields.has_gps_time {
                bytes.extend(value(self.standard.gps_time, i, 0.0).to_le_bytes());
            }
            if self.fields.has_color {
                let color = cloud.colors.as_ref().map_or([0; 3], |colors| colors[i]);
                bytes.extend(color.iter().flat_map(|channel| channel.to_le_bytes()));
            }
            if self.fields.has_nir {
                bytes.extend((value(self.standard.nir, i, 0.0) as u16).to_le_bytes());
            }
            for extra in &self.extras {
                extra.encode(cloud, i, &mut bytes);
            }
        }
        bytes
    }

    /// Appends the fields between intensity and time, which differ in order and width.
    fn encode_return(
        &self,
        cloud: &PointCloud,
        i: usize,
        flags: &[FlagColumn],
        bytes: &mut Vec<u8>,
    ) {
        let standard = &self.standard;
        let return_number = value(standard.return_number, i, 1.0) as u8;
        let number_of_returns = value(standard.number_of_returns, i, 1.0) as u8;
        let class = cloud.classification.as_ref().map_or(0, |column| column[i]);
        let user_data = value(standard.user_data, i, 0.0) as u8;
        let angle = value(standard.scan_angle, i, 0.0);
        let [of_returns, of_class] = flag_bytes(flags, i);
        if self.fields.is_extended {
            let returns = return_number | number_of_returns << 4;
            bytes.extend([returns, of_class, class, user_data]);
            bytes.extend(((angle / SCAN_ANGLE_STEP).round() as i16).to_le_bytes());
        } else {
            let angle = (angle as i8).to_le_bytes()[0];
            let returns = return_number | number_of_returns << 3;
            bytes.extend([returns | of_returns, class | of_class, angle, user_data]);
        }
        bytes.extend((value(standard.point_source_id, i, 0.0) as u16).to_le_bytes());
    }

    /// Returns the flags that the point format has.
    fn flag_columns(&self) -> Vec<FlagColumn<'a>> {
        let fields = flag_fields(self.fields.is_extended);
        let columns = self.standard.flags.iter().filter_map(|&(name, values)| {
            let (_, byte, lowest_bit, _) = fields.iter().find(|(field, ..)| *field == name)?;
            Some(FlagColumn { byte: byte - 14, lowest_bit: *lowest_bit, values })
        });
        columns.collect()
    }

    /// Returns the integer coordinates of a point.
    fn quantized(&self, cloud: &PointCloud, point_idx: usize) -> [i32; 3] {
        let steps = (cloud.world_position(point_idx) - self.offset) / self.scale;
        steps.to_array().map(|step| step.round() as i32)
    }
}

/// The values of a flag and their place in a record.
struct FlagColumn<'a> {
    /// 0 for the byte of the returns, 1 for the one behind it.
    byte: usize,
    lowest_bit: u32,
    values: &'a Values,
}

/// Returns the flags of a point in the byte of its returns and the one behind it.
fn flag_bytes(flags: &[FlagColumn], point_idx: usize) -> [u8; 2] {
    let mut bytes = [0; 2];
    for flag in flags {
        bytes[flag.byte] |= (flag.values.get(point_idx) as u8) << flag.lowest_bit;
    }
    bytes
}

/// Returns the value of a point, or `missing` without the column.
fn value(column: Option<&Values>, point_idx: usize, missing: f64) -> f64 {
    column.map_or(missing, |values| values.get(point_idx))
}

/// Returns the columns that standard fields hold, and the names and values of all others. `has_nir` is true if near
/// infrared has a standard field.
fn assign_columns(
    cloud: &PointCloud,
    has_nir: bool,
) -> (StandardColumns<'_>, Vec<(String, ExtraValues<'_>)>) {
    let mut standard = StandardColumns::default();
    let mut extras = Vec::new();
    for axis in 0..3 {
        if cloud.normals.is_some() {
            let name = ["NormalX", "NormalY", "NormalZ"][axis].to_owned();
            extras.push((name, ExtraValues::Normal(axis)));
        }
    }
    if let Some(radii) = &cloud.radii {
        extras.push(("Radius".into(), ExtraValues::F32(radii)));
    }
    if let Some(intensity) = &cloud.intensity {
        if intensity.iter().all(|v| v.fract() == 0.0 && (0.0..=65535.0).contains(v)) {
            standard.intensity = Some(intensity);
        } else {
            extras.push(("Intensity".into(), ExtraValues::F32(intensity)));
        }
    }
    for scalar in &cloud.scalars {
        let values = &scalar.values;
        let whole = |largest: f64| {
            all(values, |v| v.fract() == 0.0 && (0.0..=largest).contains(&v)).then_some(values)
        };
        let name = scalar.name.to_lowercase();
        let flag = flag_fields(true).iter().find(|(flag, ..)| *flag == name);
        if let Some((flag, _, _, n_bits)) = flag
            && let Some(values) = whole(((1 << n_bits) - 1).into())
        {
            standard.flags.push((flag, values));
            continue;
        }
        let field = match name.as_str() {
            "return_number" => (&mut standard.return_number, whole(15.0)),
            "number_of_returns" => (&mut standard.number_of_returns, whole(15.0)),
            "user_data" => (&mut standard.user_data, whole(255.0)),
            "point_source_id" => (&mut standard.point_source_id, whole(65535.0)),
            "gps_time" => (&mut standard.gps_time, Some(values)),
            "nir" if has_nir => (&mut standard.nir, whole(65535.0)),
            "scan_angle" => {
                let fits = all(values, |v| v.abs() <= 180.0);
                (&mut standard.scan_angle, fits.then_some(values))
            }
            _ => (&mut None, None),
        };
        if let (column @ None, Some(values)) = field {
            *column = Some(values);
        } else {
            extras.push((scalar.name.clone(), ExtraValues::Scalar(values)));
        }
    }
    (standard, extras)
}

/// Returns the fields of the point format for this number of points, and what they have that the source does not.
fn choose_fields(
    cloud: &PointCloud,
    n_points: u64,
    standard: &StandardColumns,
    source: Option<&LasProfile>,
) -> (PointFields, Vec<&'static str>) {
    let needed = PointFields {
        is_extended: source.is_none(),
        has_gps_time: standard.gps_time.is_some(),
        has_color: cloud.colors.is_some(),
        has_nir: standard.nir.is_some(),
    };
    let given = source.map_or(needed, |las| PointFields::of_format(las.point_format));
    let mut fields = given.union(needed);
    let mut reasons = Vec::new();
    let mut add = |reason, is_new| {
        if is_new {
            reasons.push(reason)
        }
    };
    add("GPS times", fields.has_gps_time && !given.has_gps_time);
    add("colours", fields.has_color && !given.has_color);
    add("near infrared", fields.has_nir && !given.has_nir);
    if !fields.is_extended {
        let exceeds = |column: Option<&Values>, fits: fn(f64) -> bool| {
            column.is_some_and(|values| !all(values, fits))
        };
        let is_short = |v: f64| v <= 7.0;
        let returns = [standard.return_number, standard.number_of_returns];
        let limits = [
            ("more than 4294967295 points", u64::from(u32::MAX) < n_points),
            ("more than 7 returns", returns.iter().any(|column| exceeds(*column, is_short))),
            ("classes above 31", cloud.classification.iter().flatten().any(|class| 31 < *class)),
            (
                "scan angles finer than a degree",
                exceeds(standard.scan_angle, |v| v.fract() == 0.0 && v.abs() <= 127.0),
            ),
            ("flags of overlap or scanner channels", has_extended_flags(standard)),
            ("near infrared", fields.has_nir),
        ];
        fields.is_extended = limits.iter().any(|(_, is_exceeded)| *is_exceeded);
        limits[..5].iter().for_each(|(reason, is_exceeded)| add(reason, *is_exceeded));
    }
    // Extended formats have times in any case.
    fields.has_gps_time |= fields.is_extended;
    (fields, reasons)
}

/// Returns true if flags are set that only extended formats have.
fn has_extended_flags(standard: &StandardColumns) -> bool {
    let legacy = flag_fields(false);
    let is_lost = |name: &str| legacy.iter().all(|(field, ..)| *field != name);
    standard.flags.iter().any(|(name, values)| is_lost(name) && !all(values, |v| v == 0.0))
}

/// Says what differs from the version and the point format of the source, and why; none if nothing does.
fn describe_change(
    source: &LasProfile,
    minor_version: u8,
    fields: PointFields,
    reasons: &[&'static str],
) -> Option<String> {
    let mut reasons = reasons.to_vec();
    if matches!(source.point_format, 4 | 5 | 9 | 10) {
        reasons.push("waveforms are not kept");
    }
    if 4 < source.minor_version {
        reasons.push("surfel writes LAS up to 1.4");
    }
    let format = fields.format();
    let is_same = (minor_version, format) == (source.minor_version, source.point_format);
    (!is_same).then(|| {
        format!(
            "written as LAS 1.{minor_version}, point format {format}, not as LAS 1.{}, point format {}: {}",
            source.minor_version,
            source.point_format,
            reasons.join(", ")
        )
    })
}

/// Returns true if `holds` is true for all values.
pub(super) fn all(values: &Values, holds: impl Fn(f64) -> bool) -> bool {
    (0..values.len()).all(|i| holds(values.get(i)))
}

/// Returns the unit and the zero of integer coordinates: those of the source if all points are in their reach.
fn choose_steps(cloud: &PointCloud, options: &SaveOptions) -> (DVec3, DVec3) {
    let bounds = cloud.bounds();
    let extent_about = |zero: DVec3| match cloud.is_empty() {
        true => DVec3::ZERO,
        false => {
            let shift = cloud.origin - zero;
            let [low, high] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3() + shift);
            low.abs().max(high.abs())
        }
    };
    if let (Some(las), Some(step)) = (&options.las, options.resolution) {
        let reach = step * f64::from(i32::MAX);
        let is_step = DVec3::ZERO.cmplt(step).all() && step.is_finite();
        if is_step && las.offset.is_finite() && extent_about(las.offset).cmple(reach).all() {
            return (step, las.offset);
        }
    }
    (choose_scale(extent_about(cloud.origin), options.resolution), cloud.origin)
}

/// Returns units of integer coordinates that lose nothing visible of f32 positions whose magnitude is up to `extent`.
fn choose_scale(extent: DVec3, resolution: Option<DVec3>) -> DVec3 {
    let step = |axis: usize| {
        let fine = decimal_step(extent[axis]).clamp(1e-9, 1e-3);
        let stated = resolution.map(|resolution| resolution[axis]);
        let mut step = stated.filter(|step| 0.0 < *step && step.is_finite()).unwrap_or(fine);
        // Coordinates are i32 multiples of the step.
        while f64::from(i32::MAX) < extent[axis] / step {
            step *= 10.0;
        }
        step
    };
    DVec3::new(step(0), step(1), step(2))
}

#[cfg(test)]
mod tests {
    //! The point format of clouds that are too large for a test.

    use super::*;

    #[test]
    fn more_points_than_legacy_formats_count_need_an_extended_one() {
        let cloud = PointCloud::default();
        let (standard, _) = assign_columns(&cloud, false);
        let source = LasProfile { minor_version: 2, point_format: 0, ..LasProfile::default() };
        let chosen = |n_points| choose_fields(&cloud, n_points, &standard, Some(&source));
        assert_eq!(chosen(0xffff_ffff).0.format(), 0);
        let (fields, reasons) = chosen(0x1_0000_0000);
        assert_eq!((fields.format(), fields.minor_version(2)), (6, 4));
        let line = describe_change(&source, 4, fields, &reasons).unwrap();
        let expected = "written as LAS 1.4, point format 6, not as LAS 1.2, point format 0: \
            more than 4294967295 points";
        assert_eq!(line, expected);
    }
}

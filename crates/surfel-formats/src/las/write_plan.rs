//! Maps a cloud's columns to LAS 1.4 records: point format, scales, extra bytes, and the header that describes them.

use std::ops::Range;

use laz::LazVlr;
use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, Values};

use super::crs;
use super::extra::{ExtraColumn, ExtraValues};
use super::fields::{
    DESCRIPTION_SIZE, EXTRA_BYTES_RECORD_ID, EXTRA_BYTES_USER_ID, SCAN_ANGLE_STEP,
};
use super::header::{RECORD_LENGTHS, VLR_HEADER_SIZE};
use crate::options::SaveOptions;
use crate::table::decimal_step;

/// Bytes of the fixed part of a LAS 1.4 header.
const HEADER_SIZE: usize = 375;
/// Maximum number of extra columns, whose descriptions must fit in the 65,535 bytes of a record.
pub(super) const MAX_EXTRA_COLUMNS: usize = 65535 / DESCRIPTION_SIZE;
/// Upper limit of GPS week times; larger times are "adjusted standard" times.
const SECONDS_PER_WEEK: f64 = 604_800.0;

/// The layout of a cloud's records in a file.
pub(super) struct WritePlan<'a> {
    /// Point data record format.
    pub point_format: u8,
    /// True if the file can hold the coordinate system of the options.
    pub has_coordinate_system: bool,
    scale: DVec3,
    offset: DVec3,
    standard: StandardColumns<'a>,
    extras: Vec<ExtraColumn<'a>>,
    system: Option<CoordinateSystem>,
}

/// The columns that standard fields hold.
#[derive(Default)]
struct StandardColumns<'a> {
    intensity: Option<&'a [f32]>,
    return_number: Option<&'a Values>,
    number_of_returns: Option<&'a Values>,
    user_data: Option<&'a Values>,
    scan_angle: Option<&'a Values>,
    point_source_id: Option<&'a Values>,
    gps_time: Option<&'a Values>,
    nir: Option<&'a Values>,
}

/// A coordinate system that LAS can hold.
enum CoordinateSystem {
    /// Well-known text.
    Wkt(String),
    /// EPSG code.
    Epsg(u16),
}

impl<'a> WritePlan<'a> {
    /// Chooses fields that hold the cloud's columns without loss.
    pub fn new(cloud: &'a PointCloud, options: &SaveOptions) -> Self {
        let mut standard = StandardColumns::default();
        let mut extras = Vec::new();
        for axis in 0..3 {
            if cloud.normals.is_some() {
                let name = ["NormalX", "NormalY", "NormalZ"][axis].into();
                extras.push(ExtraColumn { name, values: ExtraValues::Normal(axis) });
            }
        }
        if let Some(radii) = &cloud.radii {
            extras.push(ExtraColumn { name: "Radius".into(), values: ExtraValues::F32(radii) });
        }
        if let Some(intensity) = &cloud.intensity {
            if intensity.iter().all(|v| v.fract() == 0.0 && (0.0..=65535.0).contains(v)) {
                standard.intensity = Some(intensity);
            } else {
                extras.push(ExtraColumn {
                    name: "Intensity".into(),
                    values: ExtraValues::F32(intensity),
                });
            }
        }
        for scalar in &cloud.scalars {
            let values = &scalar.values;
            let whole = |largest: f64| {
                all(values, |v| v.fract() == 0.0 && (0.0..=largest).contains(&v)).then_some(values)
            };
            let field = match scalar.name.to_lowercase().as_str() {
                "return_number" => (&mut standard.return_number, whole(15.0)),
                "number_of_returns" => (&mut standard.number_of_returns, whole(15.0)),
                "user_data" => (&mut standard.user_data, whole(255.0)),
                "point_source_id" => (&mut standard.point_source_id, whole(65535.0)),
                "gps_time" => (&mut standard.gps_time, Some(values)),
                "nir" if cloud.colors.is_some() => (&mut standard.nir, whole(65535.0)),
                "scan_angle" => {
                    let fits = all(values, |v| v.abs() <= 180.0);
                    (&mut standard.scan_angle, fits.then_some(values))
                }
                _ => (&mut None, None),
            };
            if let (column @ None, Some(values)) = field {
                *column = Some(values);
            } else {
                extras.push(ExtraColumn {
                    name: scalar.name.clone(),
                    values: ExtraValues::Scalar(values),
                });
            }
        }
        let bounds = cloud.bounds();
        let extent = if cloud.is_empty() {
            DVec3::ZERO
        } else {
            bounds.min.abs().max(bounds.max.abs()).as_dvec3()
        };
        let system = options.coordinate_system.as_deref().and_then(CoordinateSystem::parse);
        Self {
            point_format: match (&cloud.colors, standard.nir) {
                (None, _) => 6,
                (Some(_), None) => 7,
                (Some(_), Some(_)) => 8,
            },
            has_coordinate_system: system.is_some(),
            scale: choose_scale(extent, options.resolution),
            offset: cloud.origin,
            standard,
            extras,
            system,
        }
    }

    /// Returns the number of extra columns.
    pub fn n_extra_columns(&self) -> usize {
        self.extras.len()
    }

    /// Returns the bytes of the extra columns of a point.
    pub fn n_extra_bytes(&self) -> usize {
        self.extras.iter().map(ExtraColumn::size).sum()
    }

    /// Returns the bytes before the points; `laszip` is the record that describes the compression.
    pub fn header(&self, cloud: &PointCloud, laszip: Option<&[u8]>) -> Vec<u8> {
        let mut records = Vec::new();
        let mut n_records = 0u32;
        let mut add = |user_id: &str, record_id: u16, data: &[u8]| {
            push_vlr(&mut records, user_id, record_id, data);
            n_records += 1;
        };
        match &self.system {
            Some(CoordinateSystem::Wkt(wkt)) => {
                add(crs::USER_ID, crs::WKT, &[wkt.as_bytes(), &[0]].concat())
            }
            Some(CoordinateSystem::Epsg(code)) => {
                add(crs::USER_ID, crs::GEO_KEYS, &geo_keys(*code))
            }
            None => {}
        }
        if !self.extras.is_empty() {
            let descriptions: Vec<u8> =
                self.extras.iter().flat_map(ExtraColumn::description).collect();
            add(EXTRA_BYTES_USER_ID, EXTRA_BYTES_RECORD_ID, &descriptions);
        }
        if let Some(data) = laszip {
            add(LazVlr::USER_ID, LazVlr::RECORD_ID, data);
        }

        let is_wkt = matches!(self.system, Some(CoordinateSystem::Wkt(_)));
        let is_standard_time =
            self.standard.gps_time.is_some_and(|time| !all(time, |v| v <= SECONDS_PER_WEEK));
        let encoding = u16::from(is_standard_time) | u16::from(is_wkt) << 4;
        let record_length = RECORD_LENGTHS[usize::from(self.point_format)] + self.n_extra_bytes();
        let n_points = cloud.len() as u64;

        let mut header = vec![0; HEADER_SIZE];
        let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, b"LASF");
        put(6, &encoding.to_le_bytes());
        put(24, &[1, 4]);
        put(26, b"OTHER");
        put(58, b"surfel");
        put(94, &(HEADER_SIZE as u16).to_le_bytes());
        put(96, &((HEADER_SIZE + records.len()) as u32).to_le_bytes());
        put(100, &n_records.to_le_bytes());
        put(104, &[self.point_format | if laszip.is_some() { 0x80 } else { 0 }]);
        put(105, &(record_length as u16).to_le_bytes());
        let (lowest, highest) = self.bounds(cloud);
        for axis in 0..3 {
            put(131 + 8 * axis, &self.scale[axis].to_le_bytes());
            put(155 + 8 * axis, &self.offset[axis].to_le_bytes());
            put(179 + 16 * axis, &highest[axis].to_le_bytes());
            put(187 + 16 * axis, &lowest[axis].to_le_bytes());
        }
        put(247, &n_points.to_le_bytes());
        for (i, count) in self.counts_by_return(n_points).iter().enumerate() {
            put(255 + 8 * i, &count.to_le_bytes());
        }
        header.extend(records);
        header
    }

    /// Encodes the records of these points.
    pub fn encode(&self, cloud: &PointCloud, points: Range<usize>) -> Vec<u8> {
        let mut bytes = Vec::new();
        let whole = |column: Option<&Values>, i: usize| column.map(|values| values.get(i));
        for i in points {
            for coordinate in self.quantized(cloud, i) {
                bytes.extend(coordinate.to_le_bytes());
            }
            let standard = &self.standard;
            bytes.extend((standard.intensity.map_or(0, |v| v[i] as u16)).to_le_bytes());
            let return_number = whole(standard.return_number, i).unwrap_or(1.0) as u8;
            let number_of_returns = whole(standard.number_of_returns, i).unwrap_or(1.0) as u8;
            bytes.extend([return_number | number_of_returns << 4, 0]);
            bytes.push(cloud.classification.as_ref().map_or(0, |column| column[i]));
            bytes.push(whole(standard.user_data, i).unwrap_or(0.0) as u8);
            let angle = whole(standard.scan_angle, i).unwrap_or(0.0) / SCAN_ANGLE_STEP;
            bytes.extend((angle.round() as i16).to_le_bytes());
            let source_id = whole(standard.point_source_id, i).unwrap_or(0.0) as u16;
            bytes.extend(source_id.to_le_bytes());
            bytes.extend(whole(standard.gps_time, i).unwrap_or(0.0).to_le_bytes());
            if let Some(colors) = &cloud.colors {
                bytes.extend(colors[i].iter().flat_map(|channel| channel.to_le_bytes()));
            }
            if let Some(nir) = whole(standard.nir, i) {
                bytes.extend((nir as u16).to_le_bytes());
            }
            for extra in &self.extras {
                extra.encode(cloud, i, &mut bytes);
            }
        }
        bytes
    }

    /// Returns the integer coordinates of a point.
    fn quantized(&self, cloud: &PointCloud, point_idx: usize) -> [i32; 3] {
        let steps = (cloud.world_position(point_idx) - self.offset) / self.scale;
        steps.to_array().map(|step| step.round() as i32)
    }

    /// Returns the bounds of the points after quantization.
    fn bounds(&self, cloud: &PointCloud) -> (DVec3, DVec3) {
        if cloud.is_empty() {
            return (DVec3::ZERO, DVec3::ZERO);
        }
        let bounds = cloud.bounds();
        let stored = |position: surfel_core::math::Vec3| {
            (position.as_dvec3() / self.scale).round() * self.scale + self.offset
        };
        (stored(bounds.min), stored(bounds.max))
    }

    /// Returns the number of points of each return.
    fn counts_by_return(&self, n_points: u64) -> [u64; 15] {
        let mut counts = [0; 15];
        let Some(returns) = self.standard.return_number else {
            counts[0] = n_points;
            return counts;
        };
        for i in 0..returns.len() {
            // Return 0 is invalid, but occurs in scans.
            if let Some(count) = (returns.get(i) as usize).checked_sub(1) {
                counts[count] += 1;
            }
        }
        counts
    }
}

impl CoordinateSystem {
    /// Parses WKT, or "EPSG:" and the code of a horizontal system; a vertical code after `+` is ignored.
    fn parse(text: &str) -> Option<Self> {
        if let Some(codes) = text.strip_prefix("EPSG:") {
            return codes.split('+').next()?.parse().ok().map(Self::Epsg);
        }
        // A record holds 65,535 bytes, the last of them zero.
        (text.contains('[') && text.len() < 65535).then(|| Self::Wkt(text.into()))
    }
}

/// Returns true if `holds` is true for all values.
fn all(values: &Values, holds: impl Fn(f64) -> bool) -> bool {
    (0..values.len()).all(|i| holds(values.get(i)))
}

/// Returns a GeoTIFF key directory that names the coordinate system.
fn geo_keys(code: u16) -> Vec<u8> {
    // EPSG codes from 4000 to 4999 are geodetic systems, all others projected ones.
    let is_geodetic = (4000..5000).contains(&code);
    let key = if is_geodetic { crs::GEODETIC } else { crs::PROJECTED };
    let model_type = if is_geodetic { 2 } else { 1 };
    let entries = [[1, 1, 0, 2], [1024, 0, 1, model_type], [key, 0, 1, code]];
    entries.as_flattened().iter().flat_map(|v: &u16| v.to_le_bytes()).collect()
}

/// Appends a variable length record.
fn push_vlr(records: &mut Vec<u8>, user_id: &str, record_id: u16, data: &[u8]) {
    let mut header = [0; VLR_HEADER_SIZE];
    header[2..2 + user_id.len()].copy_from_slice(user_id.as_bytes());
    header[18..20].copy_from_slice(&record_id.to_le_bytes());
    header[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    records.extend(header);
    records.extend(data);
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

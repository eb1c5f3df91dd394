//! The header of a LAS file and its variable length records.

use laz::LazVlr;
use surfel_core::math::DVec3;
use surfel_core::points::PointCloud;

use super::crs;
use super::fields::{DESCRIPTION_SIZE, EXTRA_BYTES_RECORD_ID, EXTRA_BYTES_USER_ID};
use super::header::{RECORD_LENGTHS, VLR_HEADER_SIZE};
use super::write_plan::{WritePlan, all};

/// Maximum number of extra columns, whose descriptions must fit in the 65,535 bytes of a record.
pub(super) const MAX_EXTRA_COLUMNS: usize = crs::MAX_RECORD_SIZE / DESCRIPTION_SIZE;
/// Upper limit of GPS week times; larger times are "adjusted standard" times.
const SECONDS_PER_WEEK: f64 = 604_800.0;

/// Bit of the global encoding: GPS times are adjusted standard times.
const STANDARD_TIME: u16 = 0x01;
/// Bit of the global encoding: return numbers are synthetic.
const SYNTHETIC_RETURNS: u16 = 0x08;
/// Bit of the global encoding: the coordinate system is WKT.
const IS_WKT: u16 = 0x10;

/// Returns the bytes before the points; `laszip` is the record that describes the compression.
pub(super) fn header_bytes(plan: &WritePlan, cloud: &PointCloud, laszip: Option<&[u8]>) -> Vec<u8> {
    let (n_records, mut records) = variable_length_records(plan, laszip);
    if plan.minor_version == 0 {
        // The signature before the points that LAS 1.0 asks for.
        records.extend([0xdd, 0xcc]);
    }
    let format = plan.fields.format();
    let record_length = RECORD_LENGTHS[usize::from(format)] + plan.n_extra_bytes();
    let header_size = match plan.minor_version {
        0..3 => 227,
        3 => 235,
        _ => 375,
    };
    let mut header = vec![0; header_size];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"LASF");
    put(6, &global_encoding(plan).to_le_bytes());
    put(24, &[1, plan.minor_version]);
    put(26, b"OTHER");
    put(58, b"surfel");
    put(94, &(header_size as u16).to_le_bytes());
    put(96, &((header_size + records.len()) as u32).to_le_bytes());
    put(100, &n_records.to_le_bytes());
    put(104, &[format | if laszip.is_some() { 0x80 } else { 0 }]);
    put(105, &(record_length as u16).to_le_bytes());
    let (lowest, highest) = stored_bounds(plan, cloud);
    for axis in 0..3 {
        put(131 + 8 * axis, &plan.scale[axis].to_le_bytes());
        put(155 + 8 * axis, &plan.offset[axis].to_le_bytes());
        put(179 + 16 * axis, &highest[axis].to_le_bytes());
        put(187 + 16 * axis, &lowest[axis].to_le_bytes());
    }
    let n_points = cloud.len() as u64;
    let counts = counts_by_return(plan, n_points);
    if !plan.fields.is_extended {
        put(107, &(n_points as u32).to_le_bytes());
        for (i, count) in counts[..5].iter().enumerate() {
            put(111 + 4 * i, &(*count as u32).to_le_bytes());
        }
    }
    if 4 <= plan.minor_version {
        put(247, &n_points.to_le_bytes());
        for (i, count) in counts.iter().enumerate() {
            put(255 + 8 * i, &count.to_le_bytes());
        }
    }
    header.extend(records);
    header
}

/// Returns the variable length records and their number.
fn variable_length_records(plan: &WritePlan, laszip: Option<&[u8]>) -> (u32, Vec<u8>) {
    let mut records = Vec::new();
    let mut n_records = 0;
    let mut add = |user_id: &str, record_id: u16, data: &[u8]| {
        push_vlr(&mut records, user_id, record_id, data);
        n_records += 1;
    };
    for (record_id, data) in &plan.projection {
        add(crs::USER_ID, *record_id, data);
    }
    if !plan.extras.is_empty() {
        let descriptions: Vec<u8> =
            plan.extras.iter().flat_map(|extra| extra.description).collect();
        add(EXTRA_BYTES_USER_ID, EXTRA_BYTES_RECORD_ID, &descriptions);
    }
    if let Some(data) = laszip {
        add(LazVlr::USER_ID, LazVlr::RECORD_ID, data);
    }
    (n_records, records)
}

/// Returns the global encoding, which LAS has from version 1.2 on.
fn global_encoding(plan: &WritePlan) -> u16 {
    if plan.minor_version < 2 {
        return 0;
    }
    let is_standard_time =
        || plan.standard.gps_time.is_some_and(|time| !all(time, |v| v <= SECONDS_PER_WEEK));
    let kept = match plan.global_encoding {
        Some(encoding) => encoding & (STANDARD_TIME | SYNTHETIC_RETURNS),
        None if is_standard_time() => STANDARD_TIME,
        None => 0,
    };
    let has = |id| plan.projection.iter().any(|(record_id, _)| *record_id == id);
    let is_wkt = match plan.fields.is_extended {
        // These formats require WKT; programs that find the bit do not look for the keys that some files have instead.
        true => has(crs::WKT) || !has(crs::GEO_KEYS),
        false => {
            let is_so_in_source =
                plan.global_encoding.is_none_or(|encoding| encoding & IS_WKT != 0);
            4 <= plan.minor_version && has(crs::WKT) && is_so_in_source
        }
    };
    if is_wkt { kept | IS_WKT } else { kept }
}

/// Returns the bounds of the points after quantization.
fn stored_bounds(plan: &WritePlan, cloud: &PointCloud) -> (DVec3, DVec3) {
    if cloud.is_empty() {
        return (DVec3::ZERO, DVec3::ZERO);
    }
    let bounds = cloud.bounds();
    let [low, high] = [bounds.min, bounds.max].map(|corner| {
        let steps = (corner.as_dvec3() + cloud.origin - plan.offset) / plan.scale;
        steps.round() * plan.scale + plan.offset
    });
    (low, high)
}

/// Returns the number of points of each return.
fn counts_by_return(plan: &WritePlan, n_points: u64) -> [u64; 15] {
    let mut counts = [0; 15];
    let Some(returns) = plan.standard.return_number else {
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

/// Appends a variable length record.
fn push_vlr(records: &mut Vec<u8>, user_id: &str, record_id: u16, data: &[u8]) {
    let mut header = [0; VLR_HEADER_SIZE];
    header[2..2 + user_id.len()].copy_from_slice(user_id.as_bytes());
    header[18..20].copy_from_slice(&record_id.to_le_bytes());
    header[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    records.extend(header);
    records.extend(data);
}

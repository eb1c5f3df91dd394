//! Reads the header and the variable length records of LAS files.

use std::ops::Range;

use laz::LazVlr;
use surfel_core::math::DVec3;
use surfel_core::words::counted;

use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::number_text::format_vector;

/// The header of a file.
pub(super) struct Header {
    /// Minor version of LAS 1.
    pub minor_version: u8,
    /// Point data record format.
    pub point_format: u8,
    /// True for LAZ.
    pub is_compressed: bool,
    /// Bytes of a point.
    pub record_length: usize,
    /// Number of points that the header states.
    pub n_points: u64,
    /// Unit of the integer coordinates.
    pub scale: DVec3,
    /// World coordinates of the integer coordinates 0.
    pub offset: DVec3,
    /// Least and greatest coordinates that the header states.
    pub bounds: [DVec3; 2],
    /// Bytes of the points, from the first to the end of the file or the extended records.
    pub data: Range<usize>,
    /// Variable length records.
    pub records: Vec<Vlr>,
}

/// A variable length record, extended or not.
pub(super) struct Vlr {
    /// User ID of the record.
    pub user_id: String,
    /// Record ID.
    pub record_id: u16,
    /// Bytes of its data in the file.
    pub data: Range<usize>,
}

/// Bytes of the header of a variable length record.
pub(super) const VLR_HEADER_SIZE: usize = 54;
/// Bytes of the header of an extended variable length record.
const EXTENDED_VLR_HEADER_SIZE: usize = 60;
/// Bytes of a point of each format without extra bytes (LAS 1.4 R15, tables 7 to 19).
pub(super) const RECORD_LENGTHS: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

impl Header {
    /// Returns the data of the first record with these ids.
    pub fn record<'a>(&self, input: &'a Input, user_id: &str, record_id: u16) -> Option<&'a [u8]> {
        let mut records = self.records.iter();
        let record =
            records.find(|record| record.user_id == user_id && record.record_id == record_id)?;
        Some(&input[record.data.clone()])
    }

    /// Returns the extra bytes of a point, after those of its format.
    pub fn n_extra_bytes(&self) -> usize {
        self.record_length - RECORD_LENGTHS[usize::from(self.point_format)]
    }
}

/// Reads and checks the header of a LAS or LAZ file.
pub(super) fn read_header(input: &Input) -> Result<Header> {
    if input.len() < 227 {
        return Err(ends_early(input, "a header of at least 227 bytes"));
    }
    let (major, minor_version) = (input[24], input[25]);
    if major != 1 || 5 < minor_version {
        let advice = "surfel reads LAS 1.0 to 1.4";
        return Err(input.unsupported(format!("LAS version {major}.{minor_version}"), advice));
    }
    let is_1_4 = 4 <= minor_version && 375 <= input.len();
    let header_size = u64::from(read_u16(input, 94));
    let data_start = u64::from(read_u32(input, 96));
    if data_start < header_size.max(227) || (input.len() as u64) < data_start {
        let expected =
            format!("between {} and {}, inside the file", header_size.max(227), input.len());
        return Err(malformed(input, 96, format!("points at byte {data_start}"), &expected));
    }
    let (point_format, record_length) = read_point_format(input)?;
    let (scale, offset) = read_scale_and_offset(input)?;
    // For each axis the greatest coordinate and then the least.
    let every_second = |byte| {
        DVec3::new(read_f64(input, byte), read_f64(input, byte + 16), read_f64(input, byte + 32))
    };
    let bounds = [every_second(187), every_second(179)];
    let legacy_count = u64::from(read_u32(input, 107));
    let count = if is_1_4 { read_u64(input, 247) } else { 0 };
    let n_points = if count == 0 { legacy_count } else { count };
    let mut records = read_records(input, header_size as usize)?;
    let mut data = data_start as usize..input.len();
    let extended_start = if is_1_4 { extended_start(input) } else { None };
    if let Some(start) = extended_start.filter(|start| data_start <= *start) {
        data.end = start as usize;
        records.extend(read_extended_records(input, data.end));
    }
    let has_laszip = records.iter().any(|record| record.user_id == LazVlr::USER_ID);
    Ok(Header {
        minor_version,
        point_format,
        is_compressed: input[104] & 0x80 != 0 || has_laszip,
        record_length,
        n_points,
        scale,
        offset,
        bounds,
        data,
        records,
    })
}

/// Returns the format of the points and the bytes of each.
fn read_point_format(input: &Input) -> Result<(u8, usize)> {
    let point_format = input[104] & 0x3f;
    let record_length = usize::from(read_u16(input, 105));
    let Some(&min_length) = RECORD_LENGTHS.get(usize::from(point_format)) else {
        return Err(malformed(input, 104, format!("point format {point_format}"), "0 to 10"));
    };
    if record_length < min_length {
        let expected = format!("at least {min_length} for point format {point_format}");
        let found = format!("records of {}", counted(record_length, "byte"));
        return Err(malformed(input, 105, found, &expected));
    }
    Ok((point_format, record_length))
}

/// Returns the unit of the integer coordinates, and the world coordinates of zero.
fn read_scale_and_offset(input: &Input) -> Result<(DVec3, DVec3)> {
    let vector = |byte| {
        DVec3::new(read_f64(input, byte), read_f64(input, byte + 8), read_f64(input, byte + 16))
    };
    let (scale, offset) = (vector(131), vector(155));
    if !scale.is_finite() || scale.cmpeq(DVec3::ZERO).any() || !offset.is_finite() {
        let found = format!("scale {} and offset {}", format_vector(scale), format_vector(offset));
        let expected = "finite numbers, and scales other than 0";
        return Err(malformed(input, 131, found, expected));
    }
    Ok((scale, offset))
}

/// Returns the variable length records between the header and the points.
fn read_records(input: &Input, mut at: usize) -> Result<Vec<Vlr>> {
    let mut records = Vec::new();
    for _ in 0..read_u32(input, 100) {
        let record =
            read_vlr(input, at).ok_or_else(|| ends_early(input, "a variable length record"))?;
        at = record.data.end;
        records.push(record);
    }
    Ok(records)
}

/// Returns the first byte of the extended variable length records of LAS 1.4, if there are any within the file.
fn extended_start(input: &Input) -> Option<u64> {
    let (start, n_records) = (read_u64(input, 235), read_u32(input, 243));
    (0 < n_records && start < input.len() as u64).then_some(start)
}

/// Returns the extended variable length records. They come last, so a file cut off among them still has all its points.
fn read_extended_records(input: &Input, mut at: usize) -> Vec<Vlr> {
    let mut records = Vec::new();
    for _ in 0..read_u32(input, 243) {
        let Some(record) = read_extended_vlr(input, at) else { break };
        at = record.data.end;
        records.push(record);
    }
    records
}

fn ends_early(input: &Input, expected: &str) -> Error {
    let (location, advice) =
        (Location::Byte(input.len() as u64), "copy the file again from its source");
    input.malformed(location, "the end of the file", expected, advice)
}

fn malformed(input: &Input, byte: u64, found: String, expected: &str) -> Error {
    let advice = "the header is broken; copy the file again from its source";
    input.malformed(Location::Byte(byte), found, expected, advice)
}

fn read_vlr(bytes: &[u8], at: usize) -> Option<Vlr> {
    let header = bytes.get(at..)?.get(..VLR_HEADER_SIZE)?;
    let start = at + VLR_HEADER_SIZE;
    vlr(bytes, header, start, u64::from(read_u16(header, 20)))
}

fn read_extended_vlr(bytes: &[u8], at: usize) -> Option<Vlr> {
    let header = bytes.get(at..)?.get(..EXTENDED_VLR_HEADER_SIZE)?;
    vlr(bytes, header, at + EXTENDED_VLR_HEADER_SIZE, read_u64(header, 20))
}

fn vlr(bytes: &[u8], header: &[u8], start: usize, length: u64) -> Option<Vlr> {
    let end = usize::try_from(length).ok()?.checked_add(start)?;
    (end <= bytes.len()).then(|| Vlr {
        user_id: text(&header[2..18]),
        record_id: read_u16(header, 18),
        data: start..end,
    })
}

/// Returns the text up to its first zero.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
}

/// Returns the number at a byte that is known to be there.
pub(super) fn read_u16(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(array(bytes, at))
}

/// Returns the number at a byte that is known to be there.
pub(super) fn read_u32(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(array(bytes, at))
}

/// Returns the number at a byte that is known to be there.
pub(super) fn read_u64(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(array(bytes, at))
}

/// Returns the number at a byte that is known to be there.
pub(super) fn read_f64(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(array(bytes, at))
}

/// Returns the bytes from `at`, or zeros beyond the end.
fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

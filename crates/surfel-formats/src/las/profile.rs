//! The properties of a LAS file that a file made from its points keeps.

use super::crs;
use super::fields::extra_descriptions;
use super::header::{Header, read_u16};
use super::point_format::PointFields;
use crate::file::Input;
use crate::options::LasProfile;

/// Reads the profile of a file.
pub(super) fn read_profile(input: &Input, header: &Header) -> LasProfile {
    let projection = header.records.iter().filter(|record| {
        record.user_id == crs::USER_ID && record.data.len() <= crs::MAX_RECORD_SIZE
    });
    LasProfile {
        minor_version: header.minor_version,
        point_format: header.point_format,
        // The field has another meaning before LAS 1.2.
        global_encoding: if header.minor_version < 2 { 0 } else { read_u16(input, 6) },
        offset: header.offset,
        projection: projection
            .map(|record| (record.record_id, input[record.data.clone()].to_vec()))
            .collect(),
        extra_bytes: extra_descriptions(input, header),
    }
}

/// Returns the profile of a file that holds the points of several with these profiles: the highest version, and a point
/// format with the fields that all of them have.
pub(crate) fn common_profile(first: LasProfile, other: &LasProfile) -> LasProfile {
    let fields = PointFields::of_format(first.point_format);
    let common = fields.intersection(PointFields::of_format(other.point_format));
    LasProfile {
        minor_version: first.minor_version.max(other.minor_version),
        point_format: common.format(),
        global_encoding: first.global_encoding | other.global_encoding,
        ..first
    }
}

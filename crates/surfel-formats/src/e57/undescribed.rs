//! Scans whose description is missing: sections of points are known by their headers, floating-point positions by their
//! values.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use e57::{PointCloud, Record, RecordDataType, RecordName};
use surfel_core::progress::Progress;

use super::pages::{HEADER_LENGTH, Pages};
use super::streams::{
    DATA_PACKET, SECTION_HEADER_LENGTH, SECTION_ID, Stream, find_streams, n_section_streams,
    n_streams,
};
use super::values::Encoding;
use crate::error::Result;
use crate::file::Input;
use crate::salvage::Salvage;
use crate::table::MAX_FIELDS;

/// Minimum number of points whose values tell their type.
const MIN_POINTS: u64 = 64;
/// Maximum magnitude of a coordinate in metres: ten times the radius of the Earth.
const MAX_COORDINATE: f64 = 6.4e7;
/// Maximum extent of a scan in metres.
const MAX_EXTENT: f64 = 1e6;
/// Numbers smaller than this, other than 0, are rare among coordinates and common among integers that are taken for
/// floats.
const MIN_COORDINATE: f64 = 1e-9;
/// Number of values that are decoded at a time.
const VALUES_PER_BLOCK: u64 = 1 << 14;
/// Number of positions of a section's header that are tried between two checks for cancellation.
const TRIES_PER_CHECK: u64 = 1 << 20;

/// Reason why nothing is read where no packet is whole.
pub(super) const NO_PACKET: &str = "there is no whole packet of points";

/// Namespace of the fields whose names and types are missing.
const UNKNOWN_NAMESPACE: &str = "unknown";

/// The scans that were found.
pub(super) struct Undescribed {
    /// Descriptions in which only the fields of positions have names.
    pub scans: Vec<PointCloud>,
    /// Reasons why sections of points were skipped, in the order of the file.
    pub skipped: Vec<&'static str>,
}

/// The least and the greatest number of a stream.
type Range = [f64; 2];

/// Adds the fields of a scan that its description does not list, and returns their number.
pub(super) fn add_unknown_fields(scan: &mut PointCloud, pages: Pages) -> usize {
    let n_listed = scan.prototype.len();
    let n_fields = n_section_streams(pages, scan.file_offset);
    if n_fields <= n_listed || MAX_FIELDS < n_fields {
        return 0;
    }
    scan.prototype.extend((n_listed..n_fields).map(unknown_field));
    n_fields - n_listed
}

/// Returns true if the description of a scan does not list all its fields.
pub(super) fn has_unknown_fields(scan: &PointCloud) -> bool {
    let is_unknown = |record: &Record| matches!(&record.name, RecordName::Unknown { namespace, .. } if namespace == UNKNOWN_NAMESPACE);
    scan.prototype.iter().any(is_unknown)
}

/// Returns the number of sections of points or cells that are not those of `scans`.
pub(super) fn n_other_sections(
    scans: &[PointCloud],
    pages: Pages,
    progress: &dyn Progress,
) -> Result<usize> {
    let is_other = |section: &u64| {
        scans.iter().all(|scan| Pages::content_position(scan.file_offset) != *section)
    };
    Ok(find_sections(pages, progress)?.iter().filter(|section| is_other(section)).count())
}

/// Returns a field of unknown meaning. It has no bits, so that nothing of it is read.
fn unknown_field(index: usize) -> Record {
    let namespace = UNKNOWN_NAMESPACE.into();
    Record {
        name: RecordName::Unknown { namespace, name: format!("field_{index}") },
        data_type: RecordDataType::Integer { min: 0, max: 0 },
    }
}

/// Finds the scans in the pages of a file.
pub(super) fn find_scans(
    input: &Input,
    pages: Pages,
    progress: &dyn Progress,
) -> Result<Undescribed> {
    let mut found = Undescribed { scans: Vec::new(), skipped: Vec::new() };
    for section in find_sections(pages, progress)? {
        let n_streams = n_streams(pages, section + SECTION_HEADER_LENGTH);
        let file_offset = Pages::file_position(section);
        // All bytes are taken, up to the end of what is whole.
        let all = vec![u64::MAX; n_streams];
        let mut salvage = Salvage::new(input, true);
        let streams = find_streams(&mut salvage, pages, file_offset, &all, progress)?;
        match describe(&streams, pages, progress)? {
            Ok(mut scan) => {
                scan.file_offset = file_offset;
                found.scans.push(scan);
            }
            Err(reason) => found.skipped.push(reason),
        }
    }
    Ok(found)
}

/// Returns the positions of sections of points in the pages' content.
fn find_sections(pages: Pages, progress: &dyn Progress) -> Result<Vec<u64>> {
    let mut sections = Vec::new();
    let mut at = HEADER_LENGTH as u64;
    let mut n_tries = 0u64;
    while at + SECTION_HEADER_LENGTH < pages.len() {
        if n_tries.is_multiple_of(TRIES_PER_CHECK) {
            progress.check()?;
        }
        n_tries += 1;
        match section_end(pages, at) {
            Some(end) => {
                sections.push(at);
                at = end;
            }
            // Sections begin at multiples of four bytes.
            None => at += 4,
        }
    }
    Ok(sections)
}

/// Returns the end of the section of points at a position in the pages' content, if there is one.
fn section_end(pages: Pages, at: u64) -> Option<u64> {
    let start: [u8; 8] = pages.bytes(at)?;
    if start != [SECTION_ID, 0, 0, 0, 0, 0, 0, 0] {
        return None;
    }
    let number = |byte: u64| Some(u64::from_le_bytes(pages.bytes(at + byte)?));
    let (length, packets) = (number(8)?, at + SECTION_HEADER_LENGTH);
    let is_section = SECTION_HEADER_LENGTH < length
        && length.is_multiple_of(4)
        && number(16)? == Pages::file_position(packets)
        && pages.bytes(packets)? == [DATA_PACKET]
        && (3..=MAX_FIELDS).contains(&n_streams(pages, packets));
    is_section.then(|| at.saturating_add(length))
}

/// Returns the description of a scan by its streams; fails with the reason why its positions cannot be told.
fn describe(
    streams: &[Stream],
    pages: Pages,
    progress: &dyn Progress,
) -> Result<std::result::Result<PointCloud, &'static str>> {
    if streams.iter().all(|stream| stream.len() == 0) {
        return Ok(Err(NO_PACKET));
    }
    // Fields with one value for all points have no bytes.
    let filled = streams.iter().enumerate().filter(|(_, stream)| 0 < stream.len());
    let fields: Vec<usize> = filled.map(|(i, _)| i).take(3).collect();
    let Ok(fields) = <[usize; 3]>::try_from(fields) else {
        return Ok(Err("it has fewer than three fields"));
    };
    let [a, b, c] = fields.map(|i| &streams[i]);
    if !a.is_parallel_to(b) || !a.is_parallel_to(c) {
        return Ok(Err("its first three fields differ in size"));
    }
    let Some((encoding, ranges)) = float_encoding([a, b, c], pages, progress)? else {
        return Ok(Err(
            "its first three fields are not floating-point numbers, and the scale and limits of integers are in the description",
        ));
    };
    let Some(names) = position_names(ranges) else {
        return Ok(Err("its first three fields may be coordinates as well as range and angles"));
    };
    let n_points = a.len() * 8 / encoding.n_bits();
    if n_points < MIN_POINTS {
        return Ok(Err("it has too few points to tell the type of its fields"));
    }
    let data_type = match encoding {
        Encoding::Single => RecordDataType::Single { min: None, max: None },
        _ => RecordDataType::Double { min: None, max: None },
    };
    let record = |i: usize| match fields.iter().position(|field| *field == i) {
        Some(axis) => Record { name: names[axis].clone(), data_type: data_type.clone() },
        None => unknown_field(i),
    };
    let mut scan = PointCloud::default();
    scan.records = n_points;
    scan.prototype = (0..streams.len()).map(record).collect();
    Ok(Ok(scan))
}

/// Returns the type of floats that the streams are, and their ranges; `None` if they are not floats.
fn float_encoding(
    streams: [&Stream; 3],
    pages: Pages,
    progress: &dyn Progress,
) -> Result<Option<(Encoding, [Range; 3])>> {
    let ranges_of = |encoding: Encoding| -> Result<Option<[Range; 3]>> {
        let mut ranges = [[0.0; 2]; 3];
        for (stream, slot) in streams.iter().zip(&mut ranges) {
            let Some(range) = float_range(stream, encoding, pages, progress)? else {
                return Ok(None);
            };
            *slot = range;
        }
        let is_flat = ranges.iter().filter(|[min, max]| min == max).count();
        Ok((is_flat < 2).then_some(ranges))
    };
    // Two floats make a double of a common size, but the lower half of a double is no float of such a size, unless the
    // double has few digits.
    if !have_zero_halves(streams, pages)
        && let Some(ranges) = ranges_of(Encoding::Single)?
    {
        return Ok(Some((Encoding::Single, ranges)));
    }
    Ok(ranges_of(Encoding::Double)?.map(|ranges| (Encoding::Double, ranges)))
}

/// Returns the range of a stream's numbers as such floats; `None` if they are too large or too small for coordinates.
fn float_range(
    stream: &Stream,
    encoding: Encoding,
    pages: Pages,
    progress: &dyn Progress,
) -> Result<Option<Range>> {
    let n_values = stream.len() * 8 / encoding.n_bits();
    let [mut min, mut max] = [f64::INFINITY, f64::NEG_INFINITY];
    let mut n_tiny = 0;
    for first in (0..n_values).step_by(VALUES_PER_BLOCK as usize) {
        progress.check()?;
        let mut values = vec![0.0; VALUES_PER_BLOCK.min(n_values - first) as usize];
        encoding.decode(stream, pages, first, &mut values);
        for value in values {
            // Points that were not measured may be NaN.
            if MAX_COORDINATE < value.abs() {
                return Ok(None);
            }
            n_tiny += u64::from(value != 0.0 && value.abs() < MIN_COORDINATE);
            (min, max) = (min.min(value), max.max(value));
        }
    }
    let is_range = min <= max && max - min < MAX_EXTENT && n_tiny * 100 <= n_values;
    Ok(is_range.then_some([min, max]))
}

/// Returns true if the lower half of each double is 0, as in those of few digits.
fn have_zero_halves(streams: [&Stream; 3], pages: Pages) -> bool {
    streams.iter().all(|stream| {
        let mut halves = vec![0.0; VALUES_PER_BLOCK.min(stream.len() / 4) as usize];
        Encoding::Single.decode(stream, pages, 0, &mut halves);
        halves.iter().step_by(2).all(|half| *half == 0.0)
    })
}

/// Returns the names of the fields of a position by their ranges; `None` if they may be coordinates or angles.
fn position_names([a, b, c]: [Range; 3]) -> Option<[RecordName; 3]> {
    const ROUNDING: f64 = 1e-3;
    let is_within =
        |[min, max]: Range, low: f64, high: f64| low - ROUNDING <= min && max <= high + ROUNDING;
    let may_be_angles = 0.0 <= a[0]
        && (is_within(b, -PI, PI) || is_within(b, 0.0, TAU))
        && is_within(c, -FRAC_PI_2, FRAC_PI_2);
    if !may_be_angles {
        return Some([RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]);
    }
    // Coordinates do not end where a full circle does, unless by chance.
    let is_full_circle = 0.98 * TAU < b[1] - b[0];
    is_full_circle.then_some([
        RecordName::SphericalRange,
        RecordName::SphericalAzimuth,
        RecordName::SphericalElevation,
    ])
}

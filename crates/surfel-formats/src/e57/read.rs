//! Reads the points of all scans of a file.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use surfel_core::math::DVec3;
use surfel_core::points::locate_stations;
use surfel_core::progress::{NoProgress, Progress};
use surfel_core::words::counted;

use super::document::{Document, read_document, read_header, salvage_document};
use super::images::embedded_images;
use super::pages::{PAGE_LENGTH, Pages};
use super::scan::{Scan, union};
use super::streams::find_streams;
use super::undescribed::has_unknown_fields;
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::stations::{MAX_STATIONS, set_stations};
use crate::table::{
    CloudBuilder, ColumnField, ColumnRole, Field, MAX_FIELDS, NumberType, RecordLayout,
};

/// Maximum bytes for columns that only other scans have, for each byte of the file.
const MAX_PADDING_PER_BYTE: u64 = 64;
/// Bytes for such columns that a file of any size may need.
const BASE_PADDING: u64 = 64 << 20;
/// Number of points of a block, which a thread decodes.
const POINTS_PER_BLOCK: u64 = 1 << 14;
/// Number of blocks whose records are in memory at a time.
const BLOCKS_PER_BATCH: usize = 32;

/// Reads header and XML.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    // What the XML states does not depend on damage elsewhere.
    let mut salvage = Salvage::new(input, true);
    let header = read_header(&mut salvage)?;
    let document = match read_document(input, &header) {
        Err(_) if salvage.is_damaged() => {
            salvage_document(input, &header, Pages::new(&input[..header.length]), &NoProgress)?
        }
        document => document?,
    };
    let scans = scans(input, &document)?;
    let columns = columns(input, &scans)?;
    Ok(file_info(&document, &scans, &columns))
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let mut salvage = Salvage::new(input, options.salvage);
    // Advice to salvage holds only if there is something to be salvaged.
    let header =
        read_header(&mut salvage).map_err(|error| inspect(input).err().unwrap_or(error))?;
    let pages = Pages::new(&input[..header.length]);
    let broken = find_broken(&mut salvage, pages, progress)?;
    let pages = pages.without(&broken);
    let document = match read_document(input, &header) {
        Err(_) if salvage.is_damaged() => salvage_document(input, &header, pages, progress)?,
        document => document?,
    };
    let scans = scans(input, &document)?;
    let mut columns = columns(input, &scans)?;
    let mut info = file_info(&document, &scans, &columns);
    columns.retain(|(role, _)| options.columns.wants(role));
    let roles: Vec<ColumnRole> = columns.iter().map(|(role, _)| role.clone()).collect();

    let layout_of = |_: &[u8]| layout(&columns, options);
    let mut builder = CloudBuilder::new(input, layout_of, options.origin, options.filter.as_ref());
    let mut n_scan_points = Vec::new();
    let mut n_points = 0;
    let n_claimed =
        document.scans.iter().fold(0, |sum: u64, scan| sum.saturating_add(scan.records));
    let padding_budget =
        BASE_PADDING.saturating_add(MAX_PADDING_PER_BYTE.saturating_mul(input.len() as u64));
    let n_invalid = AtomicU64::new(0);
    let mut reading = Reading { pages, roles: &roles, n_claimed, padding_budget, n_invalid };
    progress.begin(&format!("read {}", input.name), n_claimed);
    for (scan, description) in scans.iter().zip(&document.scans) {
        let n_before = builder.n_points();
        if 0 < scan.n_points {
            let section = description.file_offset;
            n_points += reading.append(scan, section, &mut builder, &mut salvage, progress)?;
        }
        n_scan_points.push(builder.n_points() - n_before);
    }
    // Without a description nothing claims a number.
    let n_claimed = document.is_described.then_some(n_claimed);
    salvage.report("point", n_points, n_claimed, progress)?;
    info.n_points = Some(n_points);
    note_invalid_points(input, reading.n_invalid.into_inner(), n_points, progress);
    let mut cloud = builder.finish();
    let stations = scans.iter().zip(&document.scans).enumerate();
    let stations = stations.map(|(i, (scan, description))| scan.station(i, description));
    set_stations(&mut cloud, stations.collect(), &n_scan_points);
    note_located_stations(input, locate_stations(&mut cloud), progress);
    Ok(Loaded { cloud, info })
}

/// Returns the indices of the pages whose checksums are wrong, which is accepted as damage.
fn find_broken(salvage: &mut Salvage, pages: Pages, progress: &dyn Progress) -> Result<Vec<usize>> {
    let broken = pages.find_broken(progress)?;
    if let Some(page) = broken.first() {
        salvage.accept(salvage.input.malformed(
            Location::Byte((page * PAGE_LENGTH) as u64),
            "a page whose checksum is wrong",
            "the bytes that were written",
            "copy the file again from its source",
        ))?;
    }
    Ok(broken)
}

/// Says how many points have no valid position.
fn note_invalid_points(input: &Input, n_invalid: u64, n_points: u64, progress: &dyn Progress) {
    if 0 < n_invalid {
        let points = counted(n_points, "point");
        let line = format!("skipped {n_invalid} of {points}: no valid position");
        progress.note(&format!("{}: {line}", input.name));
    }
}

/// Says how many stations were found from the points.
fn note_located_stations(input: &Input, n_located: usize, progress: &dyn Progress) {
    if 0 < n_located {
        let scans = counted(n_located, "scan");
        let line = format!("{scans} without a pose: the rays of the grid start at 0,0,0");
        progress.note(&format!("{}: {line}", input.name));
    }
}

/// State that the scans of a file share while they are read.
struct Reading<'a> {
    pages: Pages<'a>,
    /// The columns to read.
    roles: &'a [ColumnRole],
    /// Number of points of all scans that the file states.
    n_claimed: u64,
    /// Bytes that are left for columns that only other scans have.
    padding_budget: u64,
    /// Number of points without a valid position.
    n_invalid: AtomicU64,
}

impl Reading<'_> {
    /// Appends the points of a scan whose values begin at the byte `section`; returns how many could be read.
    fn append<F: Fn(&[u8]) -> RecordLayout>(
        &mut self,
        scan: &Scan,
        section: u64,
        builder: &mut CloudBuilder<F>,
        salvage: &mut Salvage,
        progress: &dyn Progress,
    ) -> Result<u64> {
        let (input, pages, roles) = (salvage.input, self.pages, self.roles);
        let streams = find_streams(salvage, pages, section, &scan.stream_lengths(), progress)?;
        let n_readable = scan.n_readable(&streams);
        if n_readable < scan.n_points {
            let location = Location::Byte(section);
            salvage.accept(input.truncated(location, n_readable, scan.n_points))?;
        }
        // Without a limit, the many columns of a scan of one point would make a small file ask for any memory.
        let n_lacking = roles.iter().filter(|role| !scan.has_column(role)).count() as u64;
        let padding = n_readable.saturating_mul(8 * n_lacking);
        let left = self.padding_budget.checked_sub(padding);
        self.padding_budget = left.ok_or_else(|| Error::OutOfMemory {
            file: input.name.to_string(),
            n_points: self.n_claimed,
        })?;
        let decode = |first: &u64| {
            progress.check()?;
            let n_points = POINTS_PER_BLOCK.min(n_readable - first);
            let records = scan.decode(&streams, pages, *first, n_points as usize, roles);
            let n_valid = (records.len() / (8 * (3 + roles.len()))) as u64;
            self.n_invalid.fetch_add(n_points - n_valid, Ordering::Relaxed);
            progress.advance(n_points);
            Ok::<_, Error>(records)
        };
        let firsts: Vec<u64> = (0..n_readable).step_by(POINTS_PER_BLOCK as usize).collect();
        for batch in firsts.chunks(BLOCKS_PER_BATCH) {
            builder.append(&batch.par_iter().map(decode).collect::<Result<Vec<_>>>()?)?;
        }
        Ok(n_readable)
    }
}

/// Returns the scans; fails if one has no coordinates or too many fields.
fn scans(input: &Input, document: &Document) -> Result<Vec<Scan>> {
    let malformed = |found: String, expected: String| malformed(input, found, expected);
    if document.scans.is_empty() {
        return Err(malformed("no scans".into(), "points".into()));
    }
    if MAX_STATIONS < document.scans.len() {
        let found = format!("{} scans", document.scans.len());
        return Err(malformed(found, format!("at most {MAX_STATIONS}")));
    }
    // Many scans of the same points would make a small file ask for any memory.
    let filled = document.scans.iter().filter(|scan| 0 < scan.records);
    let mut sections: Vec<u64> = filled.map(|scan| scan.file_offset).collect();
    sections.sort_unstable();
    if let Some(section) = sections.windows(2).find(|pair| pair[0] == pair[1]) {
        let found = format!("two scans whose points begin at byte {}", section[0]);
        return Err(malformed(found, "points of its own for each scan".into()));
    }
    let checked = document.scans.iter().enumerate().map(|(i, description)| {
        let n_fields = description.prototype.len();
        if MAX_FIELDS < n_fields {
            let found = format!("{} in scan {i}", counted(n_fields, "field"));
            return Err(malformed(found, format!("at most {MAX_FIELDS}")));
        }
        // Where nothing says which points were measured, those at the scanner were not.
        let is_described = document.is_described && !has_unknown_fields(description);
        let has_empty_cells = description.has_row_column() || !is_described;
        Scan::new(description, has_empty_cells).ok_or_else(|| {
            let expected = "cartesianX, Y and Z, or sphericalRange, Azimuth and Elevation";
            malformed(format!("scan {i} without coordinates"), expected.into())
        })
    });
    checked.collect()
}

/// Returns the error of descriptions that break the rules of the format.
fn malformed(input: &Input, found: String, expected: String) -> Error {
    input.malformed(Location::Byte(0), found, expected, "write the file again")
}

/// Returns the columns of all scans and their types; fails if there are too many.
fn columns(input: &Input, scans: &[Scan]) -> Result<Vec<(ColumnRole, NumberType)>> {
    let mut columns: Vec<(ColumnRole, NumberType)> = Vec::new();
    let mut column_of_role = HashMap::new();
    for column in scans.iter().flat_map(|scan| &scan.columns) {
        let n_columns = columns.len();
        let place = *column_of_role.entry(&column.role).or_insert(n_columns);
        match columns.get_mut(place) {
            // Scans that store a column in different ways have it as f64.
            Some((_, number_type)) if *number_type != column.number_type => {
                *number_type = NumberType::F64;
            }
            Some(_) => {}
            // The work of each scan grows with the columns of all.
            None if n_columns == MAX_FIELDS => {
                let found = format!("more than {MAX_FIELDS} different columns in all scans");
                return Err(malformed(input, found, format!("at most {MAX_FIELDS}")));
            }
            None => columns.push((column.role.clone(), column.number_type)),
        }
    }
    Ok(columns)
}

/// Returns the layout of decoded records.
fn layout(columns: &[(ColumnRole, NumberType)], options: &LoadOptions) -> RecordLayout {
    let axes = (0..3).map(|axis| (ColumnRole::Position(axis), NumberType::F64));
    let columns = axes.chain(columns.iter().cloned()).enumerate();
    let fields = columns.map(|(i, (role, number_type))| ColumnField {
        role,
        field: Field::parsed(8 * i, number_type),
    });
    let fields: Vec<ColumnField> = fields.collect();
    RecordLayout::new(8 * fields.len(), false, fields, &options.columns)
        .expect("the first three columns are x, y and z")
}

/// Returns the information in header and XML.
fn file_info(
    document: &Document,
    scans: &[Scan],
    columns: &[(ColumnRole, NumberType)],
) -> FileInfo {
    let filled = scans.iter().zip(&document.scans).filter(|(scan, _)| 0 < scan.n_points);
    let bounds: Option<Vec<[DVec3; 2]>> =
        filled.map(|(scan, description)| scan.stated_bounds(description)).collect();
    let scans = counted(document.scans.len(), "scan");
    let names = columns.iter().map(|(role, _)| role.name().to_owned());
    FileInfo {
        format: format!("E57 1.0, {scans}"),
        is_in_metres: true,
        n_points: Some(document.scans.iter().fold(0, |sum, scan| sum.saturating_add(scan.records))),
        bounds: bounds.and_then(|boxes| boxes.into_iter().reduce(union)),
        coordinate_system: document.coordinate_system.clone(),
        images: embedded_images(document),
        columns: ["x", "y", "z"].into_iter().map(str::to_owned).chain(names).collect(),
        ..FileInfo::default()
    }
}

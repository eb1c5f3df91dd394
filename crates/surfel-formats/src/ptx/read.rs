//! Reads the points of PTX files to world coordinates.

use std::sync::atomic::{AtomicU64, Ordering};

use surfel_core::math::DVec3;
use surfel_core::points::ScanStation;
use surfel_core::progress::Progress;

use super::scans::{Scan, find_scans, first_header};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::stations::set_stations;
use crate::table::{
    CloudBuilder, ColorRange, ColumnField, ColumnRole, Field, LineError, NumberType, RecordLayout,
    RowRange, append_rows, parse_number,
};

/// Reads the header of the first scan.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let scan = first_header(input)?;
    Ok(FileInfo {
        format: format!("PTX, {} x {} grid", scan.grid[0], scan.grid[1]),
        ..FileInfo::default()
    })
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let scans = find_scans(input, progress)?;
    let roles = roles(input, &scans)?;
    let layout_of = |_: &[u8]| layout(&roles, options);
    let mut builder = CloudBuilder::new(input, layout_of, options.origin, options.filter.as_ref());
    let mut n_scan_points = Vec::new();
    let n_empty = AtomicU64::new(0);
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    for scan in &scans {
        let parse = |line: &[u8], row: &mut Vec<f64>| {
            parse_cell(line, scan, roles.len(), row)?;
            n_empty.fetch_add(u64::from(row.is_empty()), Ordering::Relaxed);
            Ok(())
        };
        let rows = RowRange {
            start: scan.start,
            end: Some(scan.end),
            line: scan.line,
            n_columns: roles.len(),
            limit: None,
        };
        let n_before = builder.n_points();
        append_rows(&mut builder, rows, &parse, progress)?;
        n_scan_points.push(builder.n_points() - n_before);
    }
    let n_empty = n_empty.into_inner();
    if 0 < n_empty {
        let n_cells: u64 = scans.iter().map(Scan::n_cells).sum();
        let line = format!("{n_empty} of {n_cells} cells of the scanner's grid are empty; skipped");
        progress.note(&format!("{}: {line}", input.name));
    }
    let n_points = builder.n_read();
    let mut cloud = builder.finish();
    let stations = scans.iter().enumerate().map(|(i, scan)| ScanStation {
        name: format!("scan {}", i + 1),
        position: Some(scan.position),
    });
    set_stations(&mut cloud, stations.collect(), &n_scan_points);
    let info = FileInfo {
        format: format!("PTX, {}", describe(&scans)),
        n_points: Some(n_points),
        columns: roles.iter().map(|role| role.name().to_owned()).collect(),
        ..FileInfo::default()
    };
    Ok(Loaded { cloud, info })
}

/// Returns the scans in words.
fn describe(scans: &[Scan]) -> String {
    match scans {
        [scan] => format!("{} x {} grid", scan.grid[0], scan.grid[1]),
        _ => format!("{} scans", scans.len()),
    }
}

/// Returns the columns that the scans have together.
fn roles(input: &Input, scans: &[Scan]) -> Result<Vec<ColumnRole>> {
    let mut roles: Vec<ColumnRole> = (0..3).map(ColumnRole::Position).collect();
    let filled = || scans.iter().filter(|scan| 0 < scan.n_cells());
    if let Some(scan) = filled().find(|scan| ![3, 4, 7].contains(&scan.n_fields)) {
        return Err(input.malformed(
            Location::Line(scan.line),
            format!("{} fields", scan.n_fields),
            "x y z, with or without intensity, and red green blue after it",
            "write the file again",
        ));
    }
    let n_fields = filled().map(|scan| scan.n_fields).max().unwrap_or(3);
    if 4 <= n_fields {
        roles.push(ColumnRole::Intensity);
    }
    if n_fields == 7 {
        roles.extend((0..3).map(ColumnRole::Color));
    }
    Ok(roles)
}

/// Returns the layout of rows with these columns.
fn layout(roles: &[ColumnRole], options: &LoadOptions) -> RecordLayout {
    let columns = roles.iter().enumerate().map(|(i, role)| {
        let is_color = matches!(role, ColumnRole::Color(_));
        let scale = if is_color { ColorRange::Bits8.scale() } else { 1.0 };
        let field = Field { scale, ..Field::new(8 * i, NumberType::F64) };
        ColumnField { role: role.clone(), field }
    });
    RecordLayout::new(8 * roles.len(), false, columns.collect(), &options.columns)
        .expect("the first three columns are x, y and z")
}

/// Appends the values of a cell in world coordinates; an empty cell, which is at the scanner, has none.
fn parse_cell(
    line: &[u8],
    scan: &Scan,
    n_columns: usize,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    for word in line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
        row.push(parse_number(word)?);
    }
    if row.len() != scan.n_fields {
        let expected = format!("{} as in the scan's first line", scan.n_fields);
        return Err(LineError { found: format!("{} fields", row.len()), expected });
    }
    let measured = DVec3::new(row[0], row[1], row[2]);
    if measured == DVec3::ZERO || !measured.is_finite() {
        row.clear();
        return Ok(());
    }
    let world = scan.rotation * measured + scan.translation;
    row[..3].copy_from_slice(&world.to_array());
    row.resize(n_columns, f64::NAN);
    Ok(())
}

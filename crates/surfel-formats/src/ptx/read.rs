//! Reads the points of PTX files to world coordinates.

use surfel_core::math::{DVec3, rotation_of};
use surfel_core::points::{COLUMN_INDEX, ROW_INDEX, ScanStation};
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::scans::{Scan, find_scans, first_header};
use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::stations::set_stations;
use crate::table::{
    CloudBuilder, ColorRange, ColumnField, ColumnRole, Field, LineError, NumberType, RecordLayout,
    RowRange, append_rows, parse_numbers,
};

/// Names of the last columns: the place of each point in the grid of its scan.
const GRID_COLUMNS: [&str; 2] = [ROW_INDEX, COLUMN_INDEX];

/// Reads the header of the first scan.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let scan = first_header(input)?;
    Ok(FileInfo {
        format: format!("PTX, {} x {} grid", scan.grid[0], scan.grid[1]),
        is_in_metres: true,
        ..FileInfo::default()
    })
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let mut salvage = Salvage::new(input, options.salvage);
    let scans = find_scans(&mut salvage, progress)?;
    let roles = roles(input, &scans)?;
    let layout_of = |_: &[u8]| layout(&roles, &scans, options);
    let mut builder = CloudBuilder::new(input, layout_of, options.origin, options.filter.as_ref());
    let mut n_scan_points = Vec::new();
    let mut n_cells_read = 0;
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    for scan in &scans {
        let parse = |number: u64, line: &[u8], row: &mut Vec<f64>| {
            parse_cell(line, scan, number - scan.line, roles.len(), row)
        };
        let rows = RowRange {
            start: scan.start,
            end: Some(scan.end),
            line: scan.line,
            n_columns: roles.len(),
            limit: None,
            line_end: None,
        };
        let n_before = builder.n_points();
        n_cells_read += match append_rows(&mut builder, rows, &parse, progress) {
            Ok(()) => scan.n_lines,
            Err(error) => {
                let line = match &error {
                    Error::Malformed { location: Location::Line(line), .. } => *line,
                    _ => scan.line,
                };
                salvage.accept(error)?;
                line - scan.line
            }
        };
        n_scan_points.push(builder.n_points() - n_before);
    }
    let n_points = builder.n_read();
    let n_empty = n_cells_read - n_points;
    if 0 < n_empty {
        let line = format!(
            "skipped {n_empty} of {} of the scanner's grid: empty",
            counted(n_cells_read, "cell")
        );
        progress.note(&format!("{}: {line}", input.name));
    }
    let n_cells = scans.iter().fold(0, |sum: u64, scan| sum.saturating_add(scan.n_cells()));
    salvage.report("grid cell", n_cells_read, Some(n_cells), progress)?;
    let mut cloud = builder.finish();
    let stations = scans.iter().enumerate().map(|(i, scan)| ScanStation {
        name: format!("scan {}", i + 1),
        position: Some(scan.position),
        rotation: rotation_of(&scan.rotation),
        grid: Some([scan.grid[1], scan.grid[0]]),
    });
    set_stations(&mut cloud, stations.collect(), &n_scan_points);
    let info = FileInfo {
        format: format!("PTX, {}", describe(&scans)),
        is_in_metres: true,
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
    let filled = || scans.iter().filter(|scan| 0 < scan.n_lines);
    if let Some(scan) = filled().find(|scan| ![3, 4, 7].contains(&scan.n_fields)) {
        return Err(input.malformed(
            Location::Line(scan.line),
            counted(scan.n_fields, "field"),
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
    roles.extend(GRID_COLUMNS.map(|name| ColumnRole::Scalar(name.into())));
    Ok(roles)
}

/// Returns the layout of rows with these columns.
fn layout(roles: &[ColumnRole], scans: &[Scan], options: &LoadOptions) -> RecordLayout {
    let is_small = |scan: &Scan| scan.grid.iter().all(|count| *count <= 1 << 16);
    let index_type = if scans.iter().all(is_small) { NumberType::U16 } else { NumberType::U32 };
    let columns = roles.iter().enumerate().map(|(i, role)| {
        let is_color = matches!(role, ColumnRole::Color(_));
        let scale = if is_color { ColorRange::Bits8.scale() } else { 1.0 };
        let is_index = matches!(role, ColumnRole::Scalar(_));
        let file_type = if is_index { index_type } else { NumberType::F64 };
        let field = Field { scale, ..Field::parsed(8 * i, file_type) };
        ColumnField { role: role.clone(), field }
    });
    RecordLayout::new(8 * roles.len(), false, columns.collect(), &options.columns)
        .expect("the first three columns are x, y and z")
}

/// Appends the values of the `cell`-th cell in world coordinates; an empty cell, which is at the scanner, has none.
fn parse_cell(
    line: &[u8],
    scan: &Scan,
    cell: u64,
    n_columns: usize,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    parse_numbers(line, row)?;
    if row.len() != scan.n_fields {
        let expected = format!("{} as in the scan's first line", scan.n_fields);
        return Err(LineError { found: counted(row.len(), "field"), expected });
    }
    let measured = DVec3::new(row[0], row[1], row[2]);
    if measured == DVec3::ZERO || !measured.is_finite() {
        row.clear();
        return Ok(());
    }
    let world = scan.rotation * measured + scan.translation;
    row[..3].copy_from_slice(&world.to_array());
    row.resize(n_columns - GRID_COLUMNS.len(), f64::NAN);
    // A file lists its cells column by column.
    let n_rows = scan.grid[1].max(1);
    row.extend([cell % n_rows, cell / n_rows].map(|index| index as f64));
    Ok(())
}

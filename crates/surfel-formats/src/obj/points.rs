//! Reads the vertices of OBJ files as points, with the colours that some programs write after the coordinates.

use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::mesh::count_triangles;
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    ColorRange, ColumnField, ColumnRole, Field, LineError, NumberType, RecordLayout, RowRange,
    parse_number, read_rows,
};

/// Reads the first vertex.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    first_vertex(input).map(file_info)
}

/// Reads the vertices, also those that no face uses.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let n_columns = first_vertex(input)?;
    let roles =
        [0, 1, 2].map(ColumnRole::Position).into_iter().chain([0, 1, 2].map(ColumnRole::Color));
    let layout_of = |sample: &[u8]| {
        let values = sample.chunks_exact(8).map(|v| Field::new(0, NumberType::F64).value(v, false));
        let colors = values.enumerate().filter(|(i, _)| n_columns == 6 && 3 <= i % 6);
        let color_scale = ColorRange::from_floats(colors.map(|(_, v)| v)).scale();
        let columns = roles.clone().take(n_columns).enumerate().map(|(i, role)| {
            let is_color = matches!(role, ColumnRole::Color(_));
            let scale = if is_color { color_scale } else { 1.0 };
            ColumnField { role, field: Field { scale, ..Field::new(8 * i, NumberType::F64) } }
        });
        RecordLayout::new(8 * n_columns, false, columns.collect(), &options.columns)
            .expect("the first three columns are x, y and z")
    };
    let parse = |_, line: &[u8], row: &mut Vec<f64>| parse_vertex(line, n_columns, row);
    let rows = RowRange { start: 0, end: None, line: 1, n_columns, limit: None };
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    let mut salvage = Salvage::new(input, options.salvage);
    let (cloud, n_points) = read_rows(
        &mut salvage,
        rows,
        &parse,
        layout_of,
        options.origin,
        options.filter.as_ref(),
        progress,
    )?;
    salvage.report("point", n_points, None, progress)?;
    let n_triangles = Some(count_triangles(input)).filter(|count| 0 < *count);
    let info = FileInfo { n_points: Some(n_points), n_triangles, ..file_info(n_columns) };
    Ok(Loaded { cloud, info })
}

/// Returns the information about points of this many columns.
fn file_info(n_columns: usize) -> FileInfo {
    let columns = ["x", "y", "z", "red", "green", "blue"][..n_columns].iter();
    FileInfo {
        format: "OBJ, its vertices".into(),
        columns: columns.map(|name| (*name).into()).collect(),
        ..FileInfo::default()
    }
}

/// Returns the number of columns of the first vertex: 3, or 6 with its colour.
fn first_vertex(input: &Input) -> Result<usize> {
    let mut lines = input.split(|byte| *byte == b'\n').enumerate();
    let Some((i, line)) = lines.find(|(_, line)| vertex_words(line).is_some()) else {
        let advice = "the file holds no points";
        return Err(input.malformed(Location::Byte(0), "no vertex", "lines `v X Y Z`", advice));
    };
    match vertex_words(line).into_iter().flatten().count() {
        3 | 4 => Ok(3),
        6 | 7 => Ok(6),
        n_words => Err(input.malformed(
            Location::Line(i as u64 + 1),
            counted(n_words, "number"),
            "3 for a vertex, or 6 with its colour",
            "repair or remove the line",
        )),
    }
}

/// Returns the words after the `v` of a vertex line; `None` for other lines.
fn vertex_words(line: &[u8]) -> Option<impl Iterator<Item = &[u8]>> {
    let rest = line.trim_ascii().strip_prefix(b"v")?;
    let is_vertex = rest.first().is_some_and(u8::is_ascii_whitespace);
    is_vertex.then(|| rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()))
}

/// Appends the coordinates and colour of a vertex line to `row`; other lines add nothing.
fn parse_vertex(
    line: &[u8],
    n_columns: usize,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let Some(words) = vertex_words(line) else { return Ok(()) };
    for word in words {
        row.push(parse_number(word)?);
    }
    // A weight may stand between position and colour, or at the end.
    if row.len() == n_columns + 1 {
        row.remove(3);
    }
    if row.len() != n_columns {
        let expected = format!("{n_columns} as in the first vertex");
        return Err(LineError { found: counted(row.len(), "number"), expected });
    }
    Ok(())
}

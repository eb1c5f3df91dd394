//! Reads the vertices of OBJ files as points, with the colours that some programs write after the coordinates.

use rayon::prelude::*;
use surfel_core::progress::Progress;

use super::lines::{line_end, split_keyword, words};
use super::mesh::count_triangles;
use super::parse::vertex;
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    ColorRange, ColumnField, ColumnRole, Field, FindEnd, LineError, NumberType, ParseFault,
    RecordLayout, RowRange, TextChunk, read_rows,
};

/// Reads the first vertex.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let (byte, rest) = first_vertex(input)?;
    let first = vertex(rest).map_err(|error| ParseFault::new(byte, error).into_error(input));
    let (_, color) = first?;
    Ok(file_info(if color.is_some() { 6 } else { 3 }))
}

/// Reads the vertices, also those that no face uses.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    first_vertex(input)?;
    let n_columns = if has_colors(input) { 6 } else { 3 };
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
    let line_end = Some(line_end as FindEnd);
    let rows = RowRange { start: 0, end: None, line: 1, n_columns, limit: None, line_end };
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

/// Returns the byte and the arguments of the first vertex line.
fn first_vertex<'a>(input: &'a Input) -> Result<(usize, &'a [u8])> {
    let text = TextChunk { text: input, start: 0 };
    let mut vertices = text.lines(line_end).filter_map(|(byte, line)| {
        let (keyword, rest) = split_keyword(line);
        (keyword == b"v").then_some((byte, rest))
    });
    vertices.next().ok_or_else(|| {
        let advice = "the file holds no points";
        input.malformed(Location::Byte(0), "no vertex", "lines `v X Y Z`", advice)
    })
}

/// Returns true if any vertex has a colour.
fn has_colors(input: &Input) -> bool {
    let chunks = TextChunk { text: input, start: 0 }.split(line_end);
    chunks.par_iter().any(|chunk| {
        chunk.lines(line_end).any(|(_, line)| {
            let (keyword, rest) = split_keyword(line);
            keyword == b"v" && words(rest).nth(5).is_some()
        })
    })
}

/// Appends the coordinates and colour of a vertex line to `row`, NaN for a colour that it lacks; other lines add
/// nothing.
fn parse_vertex(
    line: &[u8],
    n_columns: usize,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let (keyword, rest) = split_keyword(line);
    if keyword != b"v" {
        return Ok(());
    }
    let (position, color) = vertex(rest)?;
    row.extend(position);
    if n_columns == 6 {
        row.extend(color.unwrap_or([f64::NAN; 3]));
    }
    Ok(())
}

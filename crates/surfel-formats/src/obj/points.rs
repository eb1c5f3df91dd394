//! OBJ: the vertices of a mesh as points, colours too where a program has put them behind the coordinates.

use surfel::progress::Progress;

use crate::error::{Place, Result};
use crate::input::Input;
use crate::lines::{LineError, Rows, parse_number, read_rows};
use crate::options::{LoadOptions, Loaded, Source};
use crate::range::ColorRange;
use crate::record::{ColumnField, Field, Kind, Layout};
use crate::role::Role;

pub(crate) fn inspect(input: &Input) -> Result<Source> {
    first_vertex(input).map(source)
}

// Not by tobj: it builds meshes, and keeps only the vertices that faces use.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let n_columns = first_vertex(input)?;
    let roles = [0, 1, 2].map(Role::Position).into_iter().chain([0, 1, 2].map(Role::Color));
    let layout_of = |sample: &[u8]| {
        let values = sample.chunks_exact(8).map(|v| Field::new(0, Kind::F64).value(v, false));
        let colors = values.enumerate().filter(|(i, _)| n_columns == 6 && 3 <= i % 6);
        let color_scale = ColorRange::of_floats(colors.map(|(_, v)| v)).scale();
        let columns = roles.clone().take(n_columns).enumerate().map(|(i, role)| {
            let is_color = matches!(role, Role::Color(_));
            let scale = if is_color { color_scale } else { 1.0 };
            ColumnField { role, field: Field { scale, ..Field::new(8 * i, Kind::F64) } }
        });
        Layout::new(8 * n_columns, false, columns.collect(), &options.columns)
            .expect("x, y and z are the first three")
    };
    let parse = |line: &[u8], row: &mut Vec<f64>| parse_vertex(line, n_columns, row);
    let rows = Rows { start: 0, line: 1, n_columns, limit: None };
    progress.begin(&format!("read {}", input.name), input.len() as u64);
    let cloud = read_rows(input, rows, &parse, layout_of, options.origin, progress)?;
    let source = Source { n_points: Some(cloud.len() as u64), ..source(n_columns) };
    Ok(Loaded { cloud, source })
}

fn source(n_columns: usize) -> Source {
    let columns = ["x", "y", "z", "red", "green", "blue"][..n_columns].iter();
    Source {
        format: "OBJ, its vertices".into(),
        columns: columns.map(|name| (*name).into()).collect(),
        ..Source::default()
    }
}

/// The number of columns, 3 or with colours 6, that the first vertex has.
fn first_vertex(input: &Input) -> Result<usize> {
    let mut lines = input.split(|byte| *byte == b'\n').enumerate();
    let Some((i, line)) = lines.find(|(_, line)| vertex_words(line).is_some()) else {
        let advice = "the file holds no points";
        return Err(input.malformed(Place::Byte(0), "no vertex", "lines `v X Y Z`", advice));
    };
    match vertex_words(line).into_iter().flatten().count() {
        3 | 4 => Ok(3),
        6 | 7 => Ok(6),
        n_words => Err(input.malformed(
            Place::Line(i as u64 + 1),
            format!("{n_words} numbers"),
            "3 for a vertex, or 6 with its colour",
            "mend or remove the line",
        )),
    }
}

/// What follows the `v` of a vertex line.
fn vertex_words(line: &[u8]) -> Option<impl Iterator<Item = &[u8]>> {
    let rest = line.trim_ascii().strip_prefix(b"v")?;
    let is_vertex = rest.first().is_some_and(u8::is_ascii_whitespace);
    is_vertex.then(|| rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()))
}

fn parse_vertex(
    line: &[u8],
    n_columns: usize,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let Some(words) = vertex_words(line) else { return Ok(()) };
    for word in words {
        row.push(parse_number(word)?);
    }
    // A weight stands between position and colour, or at the end.
    if row.len() == n_columns + 1 {
        row.remove(3);
    }
    if row.len() != n_columns {
        let expected = format!("{n_columns} as in the first vertex");
        return Err(LineError { found: format!("{} numbers", row.len()), expected });
    }
    Ok(())
}

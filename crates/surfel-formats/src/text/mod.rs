//! Points as lines of text: XYZ, TXT, CSV, ASC and PTS.

mod guess;
mod preamble;

use surfel::progress::Progress;

use crate::error::{Place, Result};
use crate::input::Input;
use crate::lines::{LONGEST_LINE, LineError, Rows, parse_number, read_rows};
use crate::options::{LoadOptions, Loaded, Source, TextColumn};
use crate::range::ColorRange;
use crate::record::{ColumnField, Field, Kind, Layout};
use crate::role::Role;
use guess::{color_range, guess_columns, holds_classes};
use preamble::{Preamble, Separator, comment, read_preamble};

pub(crate) fn inspect(input: &Input) -> Result<Source> {
    let preamble = read_preamble(input)?;
    Ok(source(&preamble))
}

pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let preamble = read_preamble(input)?;
    let sample = sample_rows(input, &preamble);
    let columns = match (&options.text_columns, &preamble.names) {
        (Some(stated), _) => stated.iter().map(|TextColumn(role)| role.clone()).collect(),
        (None, Some(names)) => roles_of_header(names),
        (None, None) => {
            let (columns, description) = guess_columns(&sample, preamble.n_fields);
            progress.note(&format!(
                "{}: no header; columns taken as {description} (state them with --columns)",
                input.name
            ));
            columns
        }
    };
    check_columns(input, &columns, &preamble)?;
    let kept: Vec<(usize, &Role)> =
        columns.iter().enumerate().filter_map(|(i, role)| Some((i, role.as_ref()?))).collect();
    let fields = column_fields(&kept, &sample, input, progress);
    let stride = 8 * kept.len();
    let layout_of = |_: &[u8]| {
        Layout::new(stride, false, fields.clone(), &options.columns).expect("x, y and z were found")
    };
    let parse = |line: &[u8], row: &mut Vec<f64>| parse_line(line, &preamble, &columns, row);
    let rows =
        Rows { start: preamble.data, line: preamble.data_line, n_columns: kept.len(), limit: None };
    progress.begin(&format!("read {}", input.name), (input.len() - preamble.data) as u64);
    let cloud = read_rows(input, rows, &parse, layout_of, options.origin, progress)?;
    if let Some(count) = preamble.count {
        let n_points = cloud.len();
        let line = format!("a line before the points says {count} points, {n_points} were read");
        progress.note(&format!("{}: {line}", input.name));
    }
    let mut source = source(&preamble);
    source.n_points = Some(cloud.len() as u64);
    source.columns = kept.iter().map(|(_, role)| role.name().to_owned()).collect();
    Ok(Loaded { cloud, source })
}

fn roles_of_header(names: &[String]) -> Vec<Option<Role>> {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let roles = Role::of_names(&names).into_iter().zip(names);
    roles.map(|(role, name)| (!Role::is_alpha(name)).then_some(role)).collect()
}

fn check_columns(input: &Input, columns: &[Option<Role>], preamble: &Preamble) -> Result<()> {
    let place = Place::Line(preamble.data_line);
    if columns.len() != preamble.n_fields {
        return Err(input.malformed(
            place,
            format!("{} columns", preamble.n_fields),
            format!("{}", columns.len()),
            "state all columns with --columns, `-` for one to skip",
        ));
    }
    for axis in 0..3 {
        if !columns.contains(&Some(Role::Position(axis))) {
            let found = format!("{} columns without {}", columns.len(), ["x", "y", "z"][axis]);
            let advice = "state the columns with --columns, as in x,y,z,-,r,g,b";
            return Err(input.malformed(place, found, "columns x, y and z", advice));
        }
    }
    Ok(())
}

/// Where the kept columns stand in a parsed row, and how their values are to be taken.
fn column_fields(
    kept: &[(usize, &Role)],
    sample: &[Vec<f64>],
    input: &Input,
    progress: &dyn Progress,
) -> Vec<ColumnField> {
    let colors: Vec<usize> =
        kept.iter().filter(|(_, role)| matches!(role, Role::Color(_))).map(|(i, _)| *i).collect();
    let range = color_range(sample, &colors);
    if !colors.is_empty() && range != ColorRange::Bits8 {
        progress.note(&format!("{}: colours taken as {}", input.name, range.words()));
    }
    let mut fields: Vec<ColumnField> = Vec::new();
    for (place, (column, role)) in kept.iter().enumerate() {
        let mut field = Field::new(8 * place, Kind::F64);
        let mut role = (*role).clone();
        if let Role::Color(_) = role {
            field.scale = range.scale();
        }
        if role == Role::Classification && !holds_classes(sample, *column) {
            role = Role::Scalar("classification".into());
        }
        fields.push(ColumnField { role, field });
    }
    fields
}

fn parse_line(
    line: &[u8],
    preamble: &Preamble,
    columns: &[Option<Role>],
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    if comment(line).is_some() {
        return Ok(());
    }
    let mut n_fields = 0;
    let mut has_empty_end = false;
    for field in preamble.separator.fields(line) {
        if let Some(Some(_)) = columns.get(n_fields) {
            row.push(if field.is_empty() { f64::NAN } else { parse_number(field)? });
        }
        n_fields += 1;
        has_empty_end = field.is_empty();
    }
    // Each scan of a PTS file may have a line with its number of points.
    if n_fields == 1 && preamble.count.is_some() {
        row.clear();
        return Ok(());
    }
    let is_longer_by_empty_end = has_empty_end && n_fields == columns.len() + 1;
    if n_fields != columns.len() && !is_longer_by_empty_end {
        let expected = format!("{} as in the lines before", columns.len());
        return Err(LineError { found: format!("{n_fields} fields"), expected });
    }
    Ok(())
}

/// All fields of some lines spread over the file; what is wrong with lines is told when they are read.
fn sample_rows(input: &Input, preamble: &Preamble) -> Vec<Vec<f64>> {
    const PLACES: usize = 64;
    const LINES: usize = 16;
    let data = &input[preamble.data..];
    let mut rows = Vec::new();
    for place in 0..PLACES {
        let from = data.len() * place / PLACES;
        let near = &data[from..data.len().min(from + LONGEST_LINE)];
        let is_cut = from + near.len() < data.len();
        let end = if is_cut { memchr::memrchr(b'\n', near).unwrap_or(0) } else { near.len() };
        // A line is begun at its start, not where the place happens to fall into it.
        let lines = near[..end].split(|byte| *byte == b'\n').skip(usize::from(0 < place));
        for line in lines.take(LINES) {
            let line = line.trim_ascii();
            let fields = preamble.separator.fields(line).take(preamble.n_fields);
            let row: Vec<f64> =
                fields.map(|field| parse_number(field).unwrap_or(f64::NAN)).collect();
            if comment(line).is_none() && row.len() == preamble.n_fields {
                rows.push(row);
            }
        }
    }
    rows
}

fn source(preamble: &Preamble) -> Source {
    let separator = match preamble.separator {
        Separator::Whitespace => "spaces",
        Separator::Comma => "commas",
        Separator::Semicolon => "semicolons",
    };
    Source {
        format: format!("text, {} columns separated by {separator}", preamble.n_fields),
        n_points: preamble.count,
        columns: preamble.names.clone().unwrap_or_default(),
        ..Source::default()
    }
}

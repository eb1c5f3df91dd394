//! Points as lines of text: XYZ, TXT, CSV, ASC and PTS.

mod header;
mod infer_columns;
mod number;
mod preamble;
mod separator;
mod write;

pub(crate) use write::write;

use surfel_core::points::KnownColumn;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::{Error, Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    ColorRange, ColumnField, ColumnRole, Field, LineError, MAX_LINE_LENGTH, NumberType,
    RecordLayout, RowRange, TextColumn, read_rows,
};
use header::roles_of_names;
use infer_columns::{color_range, has_class_values, infer_columns};
use preamble::{Preamble, read_preamble};
use separator::{Separator, comment};

/// Coordinate system of longitudes and latitudes.
const WGS84: &str = "EPSG:4326";

/// Maximum bytes of a row, for each byte of a line that lacks fields. It bounds the memory of a file with a long header
/// and short lines, and allows 48 columns in lines as short as `1 2 3`.
const MAX_BYTES_PER_BYTE: usize = 64;

/// Reads the lines before the points.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let preamble = read_preamble(input)?;
    Ok(file_info(&preamble))
}

/// Returns true if the first lines are a header and points, or lines of numbers.
pub(crate) fn begins_with_points(input: &Input) -> bool {
    read_preamble(input).is_ok_and(|preamble| preamble.names.is_some() || !preamble.has_text)
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let preamble = read_preamble(input)?;
    let sample = sample_rows(input, &preamble);
    let mut columns = match (&options.text_columns, &preamble.names) {
        (Some(stated), _) => stated.iter().map(|TextColumn(role)| role.clone()).collect(),
        (None, Some(names)) => roles_of_header(names),
        (None, None) if preamble.has_text => {
            let Some(columns) = survey_columns(&sample.is_text) else {
                return Err(unnamed_text(input, &preamble));
            };
            let line = format!(
                "{}: no header; columns taken as name of the point, x y z, code; {} if the northing comes first",
                input.name,
                possible_columns(first_line(input, &preamble), &preamble, ["y", "x", "z"])
            );
            progress.choice(&line, &["columns"]);
            columns
        }
        (None, None) => {
            let is_pts = preamble.count.is_some() || input.name.to_lowercase().ends_with(".pts");
            let (columns, description) = infer_columns(&sample.rows, preamble.n_fields, is_pts);
            let is_survey = columns.first() == Some(&None);
            let example = if is_survey { "; -,y,x,z if the northing comes first" } else { "" };
            let line =
                format!("{}: no header; columns taken as {description}{example}", input.name);
            progress.choice(&line, &["columns"]);
            columns
        }
    };
    check_columns(input, &columns, &preamble)?;
    if options.text_columns.is_some() || preamble.names.is_some() {
        skip_text(input, &mut columns, &sample, &preamble, progress);
    }
    let kept: Vec<(usize, &ColumnRole)> =
        columns.iter().enumerate().filter_map(|(i, role)| Some((i, role.as_ref()?))).collect();
    let fields = column_fields(&kept, &sample.rows, input, progress);
    let stride = 8 * kept.len();
    let layout_of = |_: &[u8]| {
        RecordLayout::new(stride, false, fields.clone(), &options.columns)
            .expect("x, y and z were found")
    };
    let parse = |_, line: &[u8], row: &mut Vec<f64>| parse_line(line, &preamble, &columns, row);
    let rows = RowRange {
        start: preamble.data,
        end: None,
        line: preamble.data_line,
        n_columns: kept.len(),
        limit: None,
        line_end: None,
    };
    progress.begin(&format!("read {}", input.name), (input.len() - preamble.data) as u64);
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
    salvage.report("point", n_points, preamble.count, progress)?;
    if let Some(count) = preamble.count.filter(|count| *count != n_points) {
        let line =
            format!("a line before the points says {}, {n_points} read", counted(count, "point"));
        progress.note(&format!("{}: {line}", input.name));
    }
    let mut info = file_info(&preamble);
    info.n_points = Some(n_points);
    info.columns = kept.iter().map(|(_, role)| role.name().to_owned()).collect();
    Ok(Loaded { cloud, info })
}

/// Returns the roles of named columns, `None` for opacity.
fn roles_of_header(names: &[String]) -> Vec<Option<ColumnRole>> {
    let roles = roles_of_names(names).into_iter().zip(names);
    roles.map(|(role, name)| (!ColumnRole::is_alpha(name)).then_some(role)).collect()
}

/// Returns the columns of a survey's list without a header: the name of a point, three coordinates, and a code or several;
/// `None` if texts stand elsewhere.
fn survey_columns(is_text: &[bool]) -> Option<Vec<Option<ColumnRole>>> {
    let ([true, false, false, false], [true, codes @ ..]) = is_text.split_first_chunk()? else {
        return None;
    };
    let axes = (0..3).map(|axis| Some(ColumnRole::Position(axis)));
    let columns = [None].into_iter().chain(axes).chain(vec![None; 1 + codes.len()]);
    codes.iter().all(|is_text| *is_text).then(|| columns.collect())
}

/// Returns the first line of points.
fn first_line<'a>(input: &'a Input, preamble: &Preamble) -> &'a [u8] {
    let lines = input[preamble.data..].split(|byte| *byte == b'\n');
    lines.map(<[u8]>::trim_ascii).next().unwrap_or_default()
}

/// Returns the error of lines that hold text besides numbers, of which nothing tells the coordinates.
fn unnamed_text(input: &Input, preamble: &Preamble) -> Error {
    let line = first_line(input, preamble);
    let [easting_first, northing_first] = [["x", "y", "z"], ["y", "x", "z"]]
        .map(|coordinates| possible_columns(line, preamble, coordinates));
    let advice = format!(
        "state the columns, as in {easting_first} or, if the northing comes first, {northing_first}; \
         or remove the line if it is no point [columns]"
    );
    input.malformed(
        Location::Line(preamble.data_line),
        format!("`{}`", line[..line.len().min(60)].escape_ascii()),
        "numbers, or a header with at least x, y and z, E, N and H or longitude, latitude and height",
        advice,
    )
}

/// Returns columns as the key `columns` takes them that fit a line of a survey: three coordinates, perhaps after the number of
/// the point, and texts that are skipped.
fn possible_columns(line: &[u8], preamble: &Preamble, coordinates: [&str; 3]) -> String {
    let fields: Vec<&[u8]> = preamble.separator.fields(line).collect();
    let is_number = |field: &&[u8]| preamble.separator.parse_number(field).is_ok();
    let n_numbers = fields.iter().filter(|field| is_number(field)).count();
    let mut n_before = n_numbers.saturating_sub(3).min(1);
    let mut coordinates = coordinates.into_iter();
    let names = fields.iter().map(|field| {
        if !is_number(field) {
            return "-";
        }
        if 0 < n_before {
            n_before -= 1;
            return "-";
        }
        coordinates.next().unwrap_or("-")
    });
    names.collect::<Vec<_>>().join(",")
}

/// Leaves out columns whose values are texts. A text in place of a coordinate, a colour or a normal stays an error.
fn skip_text(
    input: &Input,
    columns: &mut [Option<ColumnRole>],
    sample: &Sample,
    preamble: &Preamble,
    progress: &dyn Progress,
) {
    let mut skipped = Vec::new();
    for (i, column) in columns.iter_mut().enumerate().filter(|(i, _)| sample.is_text[*i]) {
        if let Some(role @ (ColumnRole::Scalar(_) | ColumnRole::Classification)) = column {
            // The columns may be stated for more fields than the header names.
            let name = preamble.names.as_ref().and_then(|names| names.get(i));
            skipped.push(name.map_or(role.name(), String::as_str).to_owned());
            *column = None;
        }
    }
    if !skipped.is_empty() {
        let word = if skipped.len() == 1 { "column" } else { "columns" };
        progress.note(&format!("{}: skipped text {word} {}", input.name, skipped.join(", ")));
    }
}

/// Checks that there is a column for each field, and that x, y and z are among them.
fn check_columns(input: &Input, columns: &[Option<ColumnRole>], preamble: &Preamble) -> Result<()> {
    let location = Location::Line(preamble.data_line);
    if columns.len() != preamble.n_fields {
        return Err(input.malformed(
            location,
            counted(preamble.n_fields, "column"),
            format!("{}", columns.len()),
            "state all columns, `-` for one to skip [columns]",
        ));
    }
    for axis in 0..3 {
        if !columns.contains(&Some(ColumnRole::Position(axis))) {
            let found =
                format!("{} without {}", counted(columns.len(), "column"), ["x", "y", "z"][axis]);
            let advice = "state the columns, as in x,y,z,-,r,g,b or -,n,e,h [columns]";
            return Err(input.malformed(location, found, "columns x, y and z", advice));
        }
    }
    Ok(())
}

/// Returns the fields of the kept columns in a parsed row, with the range of colours and the check of classes applied.
fn column_fields(
    kept: &[(usize, &ColumnRole)],
    sample: &[Vec<f64>],
    input: &Input,
    progress: &dyn Progress,
) -> Vec<ColumnField> {
    let colors: Vec<usize> = kept
        .iter()
        .filter(|(_, role)| matches!(role, ColumnRole::Color(_)))
        .map(|(i, _)| *i)
        .collect();
    let range = color_range(sample, &colors);
    if !colors.is_empty() && range != ColorRange::Bits8 {
        progress.note(&format!("{}: colours taken as {}", input.name, range.describe()));
    }
    let mut fields: Vec<ColumnField> = Vec::new();
    for (i, (column, role)) in kept.iter().enumerate() {
        let mut field = Field::new(8 * i, NumberType::F64);
        let mut role = (*role).clone();
        if let ColumnRole::Color(_) = role {
            field.scale = range.scale();
        }
        if role == ColumnRole::Classification && !has_class_values(sample, *column) {
            role = ColumnRole::Scalar("classification".into());
        }
        fields.push(ColumnField { role, field });
    }
    fields
}

/// Appends the kept fields of a line to `row`.
fn parse_line(
    line: &[u8],
    preamble: &Preamble,
    columns: &[Option<ColumnRole>],
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    if comment(line).is_some() {
        return Ok(());
    }
    let mut n_fields = 0;
    let mut has_empty_end = false;
    for field in preamble.separator.fields(line) {
        if preamble.has_list && n_fields == columns.len() {
            break;
        }
        if let Some(Some(_)) = columns.get(n_fields) {
            let separator = preamble.separator;
            row.push(if field.is_empty() { f64::NAN } else { separator.parse_number(field)? });
        }
        n_fields += 1;
        has_empty_end = field.is_empty();
    }
    // Each scan of a PTS file may have a line with its number of points.
    if n_fields == 1 && preamble.count.is_some() {
        row.clear();
        return Ok(());
    }
    if preamble.separator.may_lack_fields(n_fields, columns.len()) {
        let is_axis = |role: &ColumnRole| matches!(role, ColumnRole::Position(_));
        let cells = &columns[n_fields..];
        let n_values = row.len() + cells.iter().flatten().count();
        let is_in_proportion = n_values * size_of::<f64>() <= MAX_BYTES_PER_BYTE * (line.len() + 1);
        if is_in_proportion && !cells.iter().flatten().any(is_axis) {
            row.extend(cells.iter().flatten().map(|_| f64::NAN));
            n_fields = columns.len();
        }
    }
    let is_longer_by_empty_end = has_empty_end && n_fields == columns.len() + 1;
    if n_fields != columns.len() && !is_longer_by_empty_end {
        let expected = format!("{} as in the lines before", columns.len());
        return Err(LineError { found: counted(n_fields, "field"), expected });
    }
    Ok(())
}

/// Lines spread over the file, with all their fields.
struct Sample {
    /// Values of each line; those of texts are not numbers.
    rows: Vec<Vec<f64>>,
    /// True for the columns that hold a text.
    is_text: Vec<bool>,
}

/// Parses some lines spread over the file. Broken lines are skipped, and become errors when the file is read.
fn sample_rows(input: &Input, preamble: &Preamble) -> Sample {
    const N_POSITIONS: usize = 64;
    const LINES_PER_POSITION: usize = 16;
    let data = &input[preamble.data..];
    let mut sample = Sample { rows: Vec::new(), is_text: vec![false; preamble.n_fields] };
    let mut next = 0;
    for i in 0..N_POSITIONS {
        let start = next.max(data.len() * i / N_POSITIONS);
        let near = &data[start..data.len().min(start + MAX_LINE_LENGTH)];
        let is_cut = start + near.len() < data.len();
        let end = if is_cut { memchr::memrchr(b'\n', near).unwrap_or(0) } else { near.len() };
        // A position inside a line belongs to the line before.
        let is_inside = start != next;
        next = start;
        let lines = near[..end].split_inclusive(|byte| *byte == b'\n');
        for (i, line) in lines.take(LINES_PER_POSITION + usize::from(is_inside)).enumerate() {
            next += line.len();
            if i == 0 && is_inside {
                continue;
            }
            let line = line.trim_ascii();
            let fields: Vec<&[u8]> =
                preamble.separator.fields(line).take(preamble.n_fields).collect();
            if comment(line).is_some() || fields.len() < preamble.n_fields {
                continue;
            }
            let values = fields.iter().map(|field| preamble.separator.parse_number(field));
            let values: Vec<Option<f64>> = values.map(std::result::Result::ok).collect();
            for (i, value) in values.iter().enumerate() {
                sample.is_text[i] |= value.is_none() && !fields[i].is_empty();
            }
            sample.rows.push(values.iter().map(|value| value.unwrap_or(f64::NAN)).collect());
        }
    }
    sample
}

/// Returns the information in the lines before the points.
fn file_info(preamble: &Preamble) -> FileInfo {
    let separator = match preamble.separator {
        Separator::Whitespace => "spaces",
        Separator::Tab => "tabs",
        Separator::Comma => "commas",
        Separator::Semicolon => "semicolons",
    };
    let names = preamble.names.as_deref().unwrap_or_default();
    FileInfo {
        format: format!("text, {} separated by {separator}", counted(preamble.n_fields, "column")),
        n_points: preamble.count,
        columns: names.to_owned(),
        coordinate_system: has_longitudes(names).then(|| WGS84.to_owned()),
        ..FileInfo::default()
    }
}

/// True if longitudes stand for x.
fn has_longitudes(names: &[String]) -> bool {
    let roles = roles_of_names(names);
    let x = roles.iter().position(|role| *role == ColumnRole::Position(0));
    x.is_some_and(|x| KnownColumn::is_longitude(&names[x]))
}

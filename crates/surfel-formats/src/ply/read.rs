//! Reads the vertices of PLY files: binary ones in place, ascii ones by lines.

use surfel::points::PointCloud;
use surfel::progress::Progress;

use super::faces::count_faces;
use super::header::{Element, Encoding, Header, read_header};
use super::lines::end_of_lines;
use super::walk::{pack_vertices, skip_elements};
use crate::error::{Error, Place, Result};
use crate::input::Input;
use crate::lines::{LineError, Rows, read_rows};
use crate::options::{ColumnChoice, LoadOptions, Loaded, Source};
use crate::range::{ColorRange, is_byte};
use crate::record::{ColumnField, Field, Kind, Layout};
use crate::records::{Tolerance, origin_of_records, read_records};
use crate::role::Role;

pub(crate) fn inspect(input: &Input) -> Result<Source> {
    let header = read_header(input)?;
    let (_, vertex) = find_vertex(input, &header)?;
    Ok(source(&header, vertex))
}

pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let header = read_header(input)?;
    let cloud = read_cloud(input, &header, options, progress)?;
    let (_, vertex) = find_vertex(input, &header)?;
    Ok(Loaded { cloud, source: source(&header, vertex) })
}

/// The vertices as points.
pub(super) fn read_cloud(
    input: &Input,
    header: &Header,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let (before, vertex) = find_vertex(input, header)?;
    match header.encoding {
        Encoding::Ascii => read_ascii(input, header, before, vertex, options, progress),
        _ => read_binary(input, header, before, vertex, options, progress),
    }
}

pub(super) fn source(header: &Header, vertex: &Element) -> Source {
    let encoding = match header.encoding {
        Encoding::Ascii => "ascii",
        Encoding::LittleEndian => "binary little endian",
        Encoding::BigEndian => "binary big endian",
    };
    let n_faces = count_faces(header);
    let kind = if 0 < n_faces { ", mesh" } else { "" };
    Source {
        format: format!("PLY, {encoding}{kind}"),
        n_points: Some(vertex.count),
        n_triangles: (0 < n_faces).then_some(n_faces),
        columns: vertex.properties.iter().map(|property| property.name.clone()).collect(),
        ..Source::default()
    }
}

/// The vertex element and those before it.
pub(super) fn find_vertex<'a>(
    input: &Input,
    header: &'a Header,
) -> Result<(&'a [Element], &'a Element)> {
    let at = header.elements.iter().position(|element| element.name == "vertex");
    let missing = |expected: &str| {
        let found: Vec<&str> = match at {
            None => header.elements.iter().map(|element| element.name.as_str()).collect(),
            Some(at) => header.elements[at].properties.iter().map(|p| p.name.as_str()).collect(),
        };
        let found = format!("only `{}`", found.join(" ").chars().take(80).collect::<String>());
        input.malformed(Place::Byte(0), found, expected, "the file holds no points")
    };
    let Some(at) = at else { return Err(missing("an element `vertex`")) };
    let vertex = &header.elements[at];
    for axis in 0..3 {
        let is_axis = |name: &str| Role::of_name(name) == Some(Role::Position(axis));
        if !vertex.properties.iter().any(|p| p.list.is_none() && is_axis(&p.name)) {
            return Err(missing("vertex properties x, y and z"));
        }
    }
    Ok((&header.elements[..at], vertex))
}

fn read_binary(
    input: &Input,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let big_endian = header.encoding == Encoding::BigEndian;
    let mut start = header.body;
    for element in before {
        start = skip_elements(input, start, element, big_endian, progress)?;
    }
    let mut columns = Vec::new();
    let mut stride = 0;
    for property in vertex.properties.iter().filter(|property| property.list.is_none()) {
        columns.push((property.name.as_str(), Field::new(stride, property.kind)));
        stride += property.kind.size();
    }

    // Lists between the numbers are taken out first; the rest is then of fixed length.
    let packed;
    let records = if vertex.stride().is_some() {
        let rest = &input[start..];
        let readable = rest.len() / stride;
        if (readable as u64) < vertex.count {
            return Err(truncated(input, readable as u64, vertex));
        }
        &rest[..vertex.count as usize * stride]
    } else {
        packed = pack_vertices(input, start, vertex, big_endian, progress)?;
        &packed
    };
    let layout =
        layout(stride, big_endian, columns, &records[..records.len().min(1 << 20)], options);
    let tolerance = match layout.position[0].kind {
        Kind::F64 => Tolerance::UNSTATED,
        _ => Tolerance::SINGLE,
    };
    let origin = options.origin.unwrap_or_else(|| origin_of_records(records, &layout, tolerance));
    progress.begin(&format!("read {}", input.name), vertex.count);
    read_records(input, records, &layout, origin, progress)
}

fn read_ascii(
    input: &Input,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let mut start = header.body;
    for element in before {
        start = end_of_lines(input, start, element, progress)?;
    }
    let lines_between = memchr::memchr_iter(b'\n', &input[header.body..start]).count();
    let line = header.body_line + lines_between as u64;
    let numbers = vertex.properties.iter().filter(|property| property.list.is_none());
    let columns: Vec<(&str, Kind)> = numbers.map(|p| (p.name.as_str(), p.kind)).collect();
    let n_columns = columns.len();
    let rows = Rows { start, line, n_columns, limit: Some(vertex.count) };
    let parse = |line: &[u8], row: &mut Vec<f64>| parse_vertex(line, vertex, row);
    let layout_of = |sample: &[u8]| {
        let fields = columns.iter().enumerate().map(|(i, (name, kind))| {
            (*name, Field { scale: 1.0, ..Field::new(8 * i, Kind::F64) }, *kind)
        });
        let columns = named_columns(fields, 8 * n_columns, false, sample, &options.columns);
        Layout::new(8 * n_columns, false, columns, &options.columns).expect("x, y and z were found")
    };
    progress.begin(&format!("read {}", input.name), (input.len() - start) as u64);
    let cloud = read_rows(input, rows, &parse, layout_of, options.origin, progress)?;
    if (cloud.len() as u64) < vertex.count {
        return Err(truncated(input, cloud.len() as u64, vertex));
    }
    Ok(cloud)
}

/// One ascii vertex: a number a property, and for a list its length and items, which are not kept.
fn parse_vertex(
    line: &[u8],
    vertex: &Element,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    let mut number = |n_found: usize| {
        let word = words.next().ok_or_else(|| LineError {
            found: format!("{n_found} values"),
            expected: format!("{} properties a vertex", vertex.properties.len()),
        })?;
        crate::lines::parse_number(word)
    };
    for (i, property) in vertex.properties.iter().enumerate() {
        let value = number(i)?;
        if property.list.is_none() {
            row.push(value);
            continue;
        }
        // A length beyond the line ends at its last word with an error.
        for _ in 0..value as u64 {
            number(i)?;
        }
    }
    Ok(())
}

fn layout(
    stride: usize,
    big_endian: bool,
    columns: Vec<(&str, Field)>,
    sample: &[u8],
    options: &LoadOptions,
) -> Layout {
    let fields = columns.into_iter().map(|(name, field)| (name, field, field.kind));
    let columns = named_columns(fields, stride, big_endian, sample, &options.columns);
    Layout::new(stride, big_endian, columns, &options.columns).expect("x, y and z were found")
}

/// The meaning of properties by their names, types and, for classes, values in a sample of the records.
fn named_columns<'a>(
    fields: impl Iterator<Item = (&'a str, Field, Kind)>,
    stride: usize,
    big_endian: bool,
    sample: &[u8],
    choice: &ColumnChoice,
) -> Vec<ColumnField> {
    let keeps_alpha = choice.names("alpha");
    let fields: Vec<(&str, Field, Kind)> =
        fields.filter(|(name, ..)| keeps_alpha || !Role::is_alpha(name)).collect();
    let colors =
        fields.iter().filter(|(name, ..)| matches!(Role::of_name(name), Some(Role::Color(_))));
    let float_range = ColorRange::of_floats(colors.flat_map(|(_, field, _)| {
        sample.chunks_exact(stride).map(|record| field.value(record, big_endian))
    }));
    let names: Vec<&str> = fields.iter().map(|(name, ..)| *name).collect();
    let mut columns: Vec<ColumnField> = Vec::new();
    for (mut role, (name, mut field, kind)) in Role::of_names(&names).into_iter().zip(fields) {
        let holds_classes = || {
            let records = sample.chunks_exact(stride);
            records.into_iter().all(|record| is_byte(field.value(record, big_endian)))
        };
        if role == Role::Classification && kind != Kind::U8 && !holds_classes() {
            role = Role::Scalar(name.into());
        }
        let range = match kind {
            Kind::F32 | Kind::F64 => float_range,
            Kind::U16 => ColorRange::Bits16,
            _ => ColorRange::Bits8,
        };
        if let Role::Color(_) = role {
            field.scale = range.scale();
        } else if Role::is_alpha(name) {
            role = Role::Scalar("alpha".into());
            field.scale = range.scale() / 65535.0;
        }
        columns.push(ColumnField { role, field });
    }
    columns
}

pub(super) fn truncated(input: &Input, readable: u64, vertex: &Element) -> Error {
    Error::Truncated {
        file: input.name.to_string(),
        place: Place::Byte(input.len() as u64),
        readable,
        claimed: vertex.count,
    }
}

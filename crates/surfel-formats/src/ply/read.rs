//! Reads the vertices of PLY files: binary ones in place, ascii ones by lines.

use surfel_core::points::{GAUSSIAN_COLUMNS, PointCloud, STATION};
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use super::element_lines::end_of_lines;
use super::faces::count_faces;
use super::header::{Element, Encoding, Header, read_header};
use super::skip::{pack_vertices, skip_elements};
use super::trained_splats::{
    add_discs, are_trained_splats, describe_colors, harmonics_degree, incomplete_splats,
    keeps_gaussians, refuse_compressed,
};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::table::{
    ColumnRole, Field, LineError, NumberType, RecordLayout, RowRange, Tolerance, named_columns,
    origin_of_records, parse_number, read_records, read_rows, words_of,
};

/// Reads the header.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let header = read_header(input)?;
    let (_, vertex) = find_vertex(input, &header)?;
    Ok(file_info(&header, vertex))
}

/// Reads the vertices as points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let header = read_header(input)?;
    let (_, vertex) = find_vertex(input, &header)?;
    let mut info = file_info(&header, vertex);
    let mut salvage = Salvage::new(input, options.salvage);
    if !are_trained_splats(vertex) {
        if let Some(line) = incomplete_splats(vertex) {
            progress.note(&format!("{}: {line}", input.name));
        }
        let stations = if header.stations.is_empty() { vec![] } else { vec![STATION] };
        let columns = options.columns.with_names(&stations);
        let needed = LoadOptions { columns, ..options.clone() };
        let (mut cloud, n_points) = read_cloud(&mut salvage, &header, &needed, progress)?;
        salvage.report("point", n_points, info.n_points.replace(n_points), progress)?;
        cloud.stations = header.stations;
        return Ok(Loaded { cloud, info });
    }
    let columns = options.columns.with_names(&GAUSSIAN_COLUMNS);
    let needed = LoadOptions { columns, ..options.clone() };
    let (mut cloud, n_points) = read_cloud(&mut salvage, &header, &needed, progress)?;
    salvage.report("point", n_points, info.n_points.replace(n_points), progress)?;
    let keeps_gaussians = keeps_gaussians(options);
    if let Some(mut line) = add_discs(&mut cloud, keeps_gaussians) {
        if keeps_gaussians {
            line += &format!("; {}", describe_colors(vertex));
        }
        progress.note(&format!("{}: {line}", input.name));
    }
    options.columns.drop_others(&mut cloud);
    Ok(Loaded { cloud, info })
}

/// Reads the vertices of a file with this header; also returns their number, kept or not.
pub(super) fn read_cloud(
    salvage: &mut Salvage,
    header: &Header,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let (before, vertex) = find_vertex(salvage.input, header)?;
    match header.encoding {
        Encoding::Ascii => read_ascii(salvage, header, before, vertex, options, progress),
        _ => read_binary(salvage, header, before, vertex, options, progress),
    }
}

/// Returns the information in a header.
pub(super) fn file_info(header: &Header, vertex: &Element) -> FileInfo {
    let encoding = match header.encoding {
        Encoding::Ascii => "ascii",
        Encoding::LittleEndian => "binary little endian",
        Encoding::BigEndian => "binary big endian",
    };
    let n_faces = count_faces(header);
    let suffix = match n_faces {
        0 if are_trained_splats(vertex) => ", trained splats",
        0 => "",
        _ => ", mesh",
    };
    FileInfo {
        format: format!("PLY, {encoding}{suffix}"),
        n_points: Some(vertex.count),
        n_triangles: (0 < n_faces).then_some(n_faces),
        columns: vertex.properties.iter().map(|property| property.name.clone()).collect(),
        harmonics_degree: are_trained_splats(vertex).then(|| harmonics_degree(vertex)).flatten(),
        ..FileInfo::default()
    }
}

/// Returns the elements before the vertices, and the vertices; fails if the latter have no x, y and z.
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
        input.malformed(Location::Byte(0), found, expected, "the file holds no points")
    };
    let Some(at) = at else { return Err(missing("an element `vertex`")) };
    let vertex = &header.elements[at];
    refuse_compressed(input, vertex)?;
    for axis in 0..3 {
        let is_axis = |name: &str| ColumnRole::from_name(name) == Some(ColumnRole::Position(axis));
        if !vertex.properties.iter().any(|p| p.length_type.is_none() && is_axis(&p.name)) {
            return Err(missing("vertex properties x, y and z"));
        }
    }
    Ok((&header.elements[..at], vertex))
}

fn read_binary(
    salvage: &mut Salvage,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let input = salvage.input;
    let big_endian = header.encoding == Encoding::BigEndian;
    let mut start = header.body;
    for element in before {
        start = skip_elements(input, start, element, big_endian, progress)?;
    }
    let mut columns = Vec::new();
    let mut stride = 0;
    for property in vertex.properties.iter().filter(|property| property.length_type.is_none()) {
        columns.push((property.name.as_str(), Field::new(stride, property.number_type)));
        stride += property.number_type.size();
    }

    // Without the lists between the numbers, the records have a fixed length.
    let packed;
    let records = if vertex.stride().is_some() {
        let rest = &input[start..];
        let readable = (rest.len() / stride) as u64;
        if readable < vertex.count {
            salvage.accept(vertex.truncated(input, readable))?;
        }
        &rest[..vertex.count.min(readable) as usize * stride]
    } else {
        packed = pack_vertices(salvage, start, vertex, big_endian, progress)?;
        &packed
    };
    let layout = layout(stride, big_endian, columns, records, options, progress);
    let tolerance = match layout.position[0].number_type {
        NumberType::F64 => Tolerance::UNSTATED,
        _ => Tolerance::F32_COORDINATES,
    };
    let origin = options.origin.unwrap_or_else(|| origin_of_records(records, &layout, tolerance));
    let n_points = (records.len() / stride) as u64;
    progress.begin(&format!("read {}", input.name), n_points);
    let cloud = read_records(
        input,
        records,
        &layout,
        origin,
        options.filter.as_ref(),
        |_, _| (),
        progress,
    )?;
    Ok((cloud, n_points))
}

fn read_ascii(
    salvage: &mut Salvage,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let input = salvage.input;
    let mut start = header.body;
    for element in before {
        start = end_of_lines(input, start, element, progress)?;
    }
    let lines_between = memchr::memchr_iter(b'\n', &input[header.body..start]).count();
    let line = header.body_line + lines_between as u64;
    let numbers = vertex.properties.iter().filter(|property| property.length_type.is_none());
    let columns: Vec<(&str, NumberType)> =
        numbers.map(|p| (p.name.as_str(), p.number_type)).collect();
    let n_columns = columns.len();
    let rows =
        RowRange { start, end: None, line, n_columns, limit: Some(vertex.count), line_end: None };
    let parse = |_, line: &[u8], row: &mut Vec<f64>| parse_vertex(line, vertex, row);
    let layout_of = |sample: &[u8]| {
        let fields = columns.iter().enumerate();
        let fields =
            fields.map(|(i, (name, number_type))| (*name, Field::parsed(8 * i, *number_type)));
        let columns =
            named_columns(fields, 8 * n_columns, false, sample, sample, &options.columns, progress);
        RecordLayout::new(8 * n_columns, false, columns, &options.columns)
            .expect("x, y and z were found")
    };
    progress.begin(&format!("read {}", input.name), (input.len() - start) as u64);
    read_rows(salvage, rows, &parse, layout_of, options.origin, options.filter.as_ref(), progress)
}

/// Parses an ascii vertex: a number for each property; a list has its length and its items, which are not kept.
fn parse_vertex(
    line: &[u8],
    vertex: &Element,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let mut words = words_of(line);
    let mut number = |n_found: usize| {
        let word = words.next().ok_or_else(|| LineError {
            found: counted(n_found, "value"),
            expected: format!("{} properties a vertex", vertex.properties.len()),
        })?;
        parse_number(word)
    };
    for (i, property) in vertex.properties.iter().enumerate() {
        let value = number(i)?;
        if property.length_type.is_none() {
            row.push(value);
            continue;
        }
        // A list longer than the line is an error at the end of the line.
        for _ in 0..value as u64 {
            number(i)?;
        }
    }
    Ok(())
}

/// Returns the layout of binary vertices.
fn layout(
    stride: usize,
    big_endian: bool,
    columns: Vec<(&str, Field)>,
    records: &[u8],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> RecordLayout {
    let (columns, sample) = (columns.into_iter(), &records[..records.len().min(1 << 20)]);
    let columns =
        named_columns(columns, stride, big_endian, sample, records, &options.columns, progress);
    RecordLayout::new(stride, big_endian, columns, &options.columns).expect("x, y and z were found")
}

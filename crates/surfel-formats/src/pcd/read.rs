//! Reads the points of PCD files: binary ones in place, ascii ones by lines.

use std::borrow::Cow;
use surfel_core::words::counted;

use surfel_core::points::{COLUMN_INDEX, PointCloud, ROW_INDEX, Scalar, ScanStation, Values};
use surfel_core::progress::Progress;

use super::compressed;
use super::header::{Encoding, Header, PcdField, Viewpoint, read_header};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions, Loaded};
use crate::salvage::Salvage;
use crate::stations::set_stations;
use crate::table::{
    ColumnField, ColumnRole, Field, LineError, NumberType, RecordLayout, RowRange, Tolerance,
    named_columns, origin_of_records, parse_number, read_records, read_rows, words_of,
};

/// Channels of a packed colour and their bytes in it.
const PACKED_COLOR: [(&str, usize); 4] = [("red", 2), ("green", 1), ("blue", 0), ("alpha", 3)];

/// Reads the header.
pub(crate) fn inspect(input: &Input) -> Result<FileInfo> {
    let header = read_header(input)?;
    check_axes(input, &header)?;
    Ok(file_info(&header))
}

/// Reads the points.
pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let header = read_header(input)?;
    check_axes(input, &header)?;
    let mut salvage = Salvage::new(input, options.salvage);
    let (mut cloud, n_points) = match header.encoding {
        Encoding::Ascii => read_ascii(&mut salvage, &header, options, progress)?,
        _ => read_binary(&mut salvage, &header, options, progress)?,
    };
    salvage.report("point", n_points, Some(header.n_points()), progress)?;
    add_station(&mut cloud, &header);
    if header.is_organized() {
        add_grid(&mut cloud, &header, options);
    }
    Ok(Loaded { cloud, info: FileInfo { n_points: Some(n_points), ..file_info(&header) } })
}

/// Adds the station of a cloud that was measured from the viewpoint. Without a grid, the viewpoint that all programs
/// write by default tells none.
fn add_station(cloud: &mut PointCloud, header: &Header) {
    let is_organized = header.is_organized();
    if !is_organized && header.viewpoint == Viewpoint::default() {
        return;
    }
    let station = ScanStation {
        name: "scan 1".into(),
        position: Some(header.viewpoint.position),
        rotation: header.viewpoint.rotation,
        grid: is_organized.then_some([header.height, header.width]),
    };
    let n_points = cloud.len();
    set_stations(cloud, vec![station], &[n_points]);
}

/// Adds the row and column of each point of an organised cloud. A cloud without the points that a filter dropped is no
/// grid any more.
fn add_grid(cloud: &mut PointCloud, header: &Header, options: &LoadOptions) {
    if cloud.len() as u64 != header.n_points() {
        return;
    }
    let cells = 0..header.n_points();
    let (width, n_lines) = (header.width, header.width.max(header.height));
    let column = |index_of: &dyn Fn(u64) -> u64| match n_lines <= 1 << 16 {
        true => Values::U16(cells.clone().map(|cell| index_of(cell) as u16).collect()),
        false => Values::I32(cells.clone().map(|cell| index_of(cell) as i32).collect()),
    };
    let is_wanted = |name: &str| options.columns.wants(&ColumnRole::Scalar(name.into()));
    if is_wanted(ROW_INDEX) {
        let values = column(&|cell| cell / width);
        cloud.scalars.push(Scalar { name: ROW_INDEX.into(), values });
    }
    if is_wanted(COLUMN_INDEX) {
        let values = column(&|cell| cell % width);
        cloud.scalars.push(Scalar { name: COLUMN_INDEX.into(), values });
    }
}

/// Checks that x, y and z are among the fields.
fn check_axes(input: &Input, header: &Header) -> Result<()> {
    let is_axis = |field: &PcdField, axis| {
        field.count == 1 && ColumnRole::from_name(&field.name) == Some(ColumnRole::Position(axis))
    };
    if (0..3).all(|axis| header.fields.iter().any(|field| is_axis(field, axis))) {
        return Ok(());
    }
    let names: Vec<&str> = header.fields.iter().map(|field| field.name.as_str()).collect();
    let found = format!("only `{}`", names.join(" ").chars().take(80).collect::<String>());
    let advice = "the file holds no points";
    Err(input.malformed(Location::Byte(0), found, "fields x, y and z", advice))
}

/// Returns the information in a header.
fn file_info(header: &Header) -> FileInfo {
    let encoding = match header.encoding {
        Encoding::Ascii => "ascii",
        Encoding::Binary => "binary",
        Encoding::BinaryCompressed => "binary compressed",
    };
    let grid = match header.height {
        1 => String::new(),
        height => format!(", {} x {height} grid", header.width),
    };
    FileInfo {
        format: format!("PCD {}, {encoding}{grid}", header.version),
        n_points: Some(header.n_points()),
        columns: binary_columns(header).into_iter().map(|(name, _)| name).collect(),
        ..FileInfo::default()
    }
}

/// Returns name and field in a binary point of each column; the channels of packed colours are columns.
fn binary_columns(header: &Header) -> Vec<(String, Field)> {
    let mut columns = Vec::new();
    let mut byte = 0;
    for field in &header.fields {
        if field.is_packed_color() {
            columns.extend(PACKED_COLOR.iter().map(|(name, channel)| {
                let channel = Field::new(byte + channel, NumberType::U8);
                ((*name).to_owned(), channel)
            }));
        } else if field.name != "_" {
            let size = field.number_type.size();
            columns.extend((0..field.count).map(|i| {
                let number = Field::new(byte + i * size, field.number_type);
                (name_of(field, i), number)
            }));
        }
        byte += field.size();
    }
    columns
}

/// Returns the name of the `i`-th number of a field.
fn name_of(field: &PcdField, i: usize) -> String {
    if field.count == 1 { field.name.clone() } else { format!("{}_{i}", field.name) }
}

/// Reads binary points; also returns their number, kept or not.
fn read_binary(
    salvage: &mut Salvage,
    header: &Header,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let input = salvage.input;
    let stride = header.stride();
    progress.begin(&format!("read {}", input.name), header.n_points());
    let mut columns = binary_columns(header);
    let records = match header.encoding {
        Encoding::BinaryCompressed => {
            let records = compressed::records(salvage, header, progress)?;
            drop_lost(&mut columns, &records, input, progress);
            Cow::Owned(records.bytes)
        }
        _ => {
            let rest = &input[header.body..];
            let readable = (rest.len() / stride) as u64;
            if readable < header.n_points() {
                let location = Location::Byte(input.len() as u64);
                salvage.accept(input.truncated(location, readable, header.n_points()))?;
            }
            Cow::Borrowed(&rest[..header.n_points().min(readable) as usize * stride])
        }
    };
    let fields = columns.iter().map(|(name, field)| (name.as_str(), *field));
    let sample = &records[..records.len().min(1 << 20)];
    let columns =
        named_columns(fields, stride, false, sample, &records, &options.columns, progress);
    let layout = layout(stride, columns, options);
    let tolerance = match layout.position[0].number_type {
        NumberType::F64 => Tolerance::UNSTATED,
        _ => Tolerance::F32_COORDINATES,
    };
    let origin = options.origin.unwrap_or_else(|| origin_of_records(&records, &layout, tolerance));
    let n_points = (records.len() / stride) as u64;
    let cloud = read_records(
        input,
        &records,
        &layout,
        origin,
        options.filter.as_ref(),
        |_, _| (),
        progress,
    )?;
    Ok((cloud, n_points))
}

/// Drops the columns of which values are lost, and reports them.
fn drop_lost(
    columns: &mut Vec<(String, Field)>,
    records: &compressed::Records,
    input: &Input,
    progress: &dyn Progress,
) {
    let is_lost = |name: &str, field: &Field| {
        let is_axis = matches!(ColumnRole::from_name(name), Some(ColumnRole::Position(_)));
        !is_axis && records.whole_width < field.end()
    };
    let lost: Vec<String> = columns
        .extract_if(.., |(name, field)| is_lost(name, field))
        .map(|(name, _)| name)
        .collect();
    if !lost.is_empty() {
        let names = lost.join(" ").chars().take(80).collect::<String>();
        progress.note(&format!("{}: values of {names} are lost", input.name));
    }
}

/// Reads points by lines; also returns their number, kept or not.
fn read_ascii(
    salvage: &mut Salvage,
    header: &Header,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(PointCloud, u64)> {
    let input = salvage.input;
    let columns = binary_columns(header);
    let rows = RowRange {
        start: header.body,
        end: None,
        line: header.body_line,
        n_columns: columns.len(),
        limit: Some(header.n_points()),
        line_end: None,
    };
    let parse = |_, line: &[u8], row: &mut Vec<f64>| parse_point(line, header, row);
    let stride = 8 * columns.len();
    let layout_of = |sample: &[u8]| {
        let fields = columns
            .iter()
            .enumerate()
            .map(|(i, (name, field))| (name.as_str(), Field::parsed(8 * i, field.file_type)));
        let columns =
            named_columns(fields, stride, false, sample, sample, &options.columns, progress);
        layout(stride, columns, options)
    };
    progress.begin(&format!("read {}", input.name), (input.len() - header.body) as u64);
    read_rows(salvage, rows, &parse, layout_of, options.origin, options.filter.as_ref(), progress)
}

fn layout(stride: usize, columns: Vec<ColumnField>, options: &LoadOptions) -> RecordLayout {
    RecordLayout::new(stride, false, columns, &options.columns).expect("x, y and z were found")
}

/// Appends the columns of an ascii point to `row`.
fn parse_point(
    line: &[u8],
    header: &Header,
    row: &mut Vec<f64>,
) -> std::result::Result<(), LineError> {
    let mut words = words_of(line);
    let mut n_found = 0;
    for field in &header.fields {
        for _ in 0..field.count {
            let word = words.next().ok_or_else(|| LineError {
                found: counted(n_found, "value"),
                expected: format!("{} a point", counted(header.n_values(), "value")),
            })?;
            n_found += 1;
            if field.is_packed_color() {
                let bytes = packed_color(word, field.number_type)?.to_le_bytes();
                row.extend(PACKED_COLOR.map(|(_, channel)| f64::from(bytes[channel])));
            } else if field.name != "_" {
                row.push(parse_number(word)?);
            }
        }
    }
    Ok(())
}

/// Returns the bits of a packed colour, written as an integer or as the float of the same bits.
fn packed_color(word: &[u8], number_type: NumberType) -> std::result::Result<u32, LineError> {
    let value = parse_number(word)?;
    // The float of a colour is smaller than 1 or, if it is opaque, beyond any integer of 32 bits.
    let is_integer = value.fract() == 0.0 && 1.0 <= value && value <= f64::from(u32::MAX);
    Ok(match number_type {
        NumberType::F32 if !is_integer => (value as f32).to_bits(),
        NumberType::I32 => value as i32 as u32,
        _ => value as u32,
    })
}

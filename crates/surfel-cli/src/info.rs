//! `surfel info`: what is in a file, as a table or as JSON.

use crate::global::Global;
use crate::inputs::expand_content;
use crate::options::{KeyOptions, Scope};
use crate::report::{Report, print};
use crate::stdin_copy::with_stdin_named;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use surfel::crs::{CoordinateSystem, Unit, short_name};
use surfel::description::Section;
use surfel::resolve::{MemoryEstimate, up_convention};
use surfel_core::image::{class_name, is_data};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{
    COLOR_8_TO_16, PointCloud, STATION, ScanStation, Subsample, Values, have_8_bits, infer_up,
    is_flag, is_valid_position, points_per_area, spacing,
};
use surfel_core::progress::Progress;
use surfel_core::words::counted;
use surfel_formats::{ColumnChoice, EmbeddedImage, FileInfo, Loaded};

#[derive(clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Point clouds, meshes and glTF scenes. A folder stands for its files, `*` for any part of a name, - for standard
    /// input.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// JSON instead of a table: one object a file, in an array if there are several.
    #[arg(long)]
    json: bool,
    /// Only what the header states, at once, however large the file is.
    #[arg(long)]
    summary: bool,
    #[command(flatten)]
    options: KeyOptions<Args>,
}

impl Scope for Args {
    fn has(_: Section, path: &str) -> bool {
        ["columns", "salvage"].contains(&path)
    }
}

/// Side of the cells in which points are counted for their density, in distances between points.
const DENSITY_CELL: f32 = 5.0;

/// Name of the column of the numbers of returns.
const RETURN_NUMBER: &str = "return_number";

const EXAMPLES: &str = "\
Examples:
  surfel info scan.laz
  surfel info --summary 'tiles/*.laz'
  surfel info --json scan.laz | jq .bounds";

/// Shows what each file holds.
pub fn run(args: &Args, global: &Global, report: &Report) -> anyhow::Result<()> {
    let description = args.options.description.clone()?;
    let options = description.objects_default.preparation.load_options(ColumnChoice::All)?;
    let limit = global.start()?.memory_limit;
    let mut all = Vec::new();
    for file in &expand_content(&args.files, report)? {
        let header = surfel_formats::inspect(file)?;
        let info = if args.summary {
            summarize(file, &header)
        } else {
            let file_info = [(file.as_path(), &header)];
            // Points are only looked at.
            MemoryEstimate::from_files(file_info, Some(Subsample::First(0)), 0).check(limit)?;
            let loaded = surfel_formats::load(file, &options, report)?;
            describe(file, &loaded, report)?
        };
        report.end();
        if args.json {
            all.push(info);
        } else {
            print(&with_stdin_named(&table(&info)))?;
        }
    }
    match all.as_slice() {
        [] => Ok(()),
        [only] => Ok(print(&format!("{only:#}"))?),
        several => Ok(print(&format!("{:#}", json!(several)))?),
    }
}

/// Describes a file by its header.
fn summarize(file: &Path, header: &FileInfo) -> Value {
    json!({
        "file": file.display().to_string(),
        "format": header.format,
        "points": header.n_points,
        "triangles": header.n_triangles,
        "bounds": header.bounds.map(|[low, high]| json!({ "min": low.to_array(), "max": high.to_array() })),
        "resolution": header.resolution.map(|step| step.to_array()),
        "coordinate_system": header.coordinate_system,
        "unit": unit(header).to_string(),
        "spherical_harmonics_degree": header.harmonics_degree,
        "columns_in_file": header.columns,
        "images": images(header),
    })
}

fn describe(file: &Path, loaded: &Loaded, report: &Report) -> surfel_core::Result<Value> {
    let Loaded { cloud, info: source } = loaded;
    let bounds = cloud.bounds();
    let corner = |corner: Vec3| (cloud.origin + corner.as_dvec3()).to_array();
    let corners = || json!({ "min": corner(bounds.min), "max": corner(bounds.max) });
    let distance = if cloud.is_empty() { 0.0 } else { spacing(&cloud.positions, report)? };
    let up = infer_up(cloud, &up_convention(cloud, std::slice::from_ref(source)));
    Ok(json!({
        "file": file.display().to_string(),
        "format": source.format,
        "points": cloud.len(),
        "points_without_position": cloud.len() - cloud.positions.iter().filter(|p| is_valid_position(**p)).count(),
        "triangles": source.n_triangles,
        "bounds": (!bounds.is_empty()).then(corners),
        // Adding 0 turns -0 into 0.
        "global_shift": (cloud.origin + DVec3::ZERO).to_array(),
        "spacing": distance,
        "points_per_square_unit": points_per_area(&cloud.positions, DENSITY_CELL * distance),
        "resolution": source.resolution.map(|step| step.to_array()),
        "coordinate_system": source.coordinate_system,
        "unit": unit(source).to_string(),
        "spherical_harmonics_degree": source.harmonics_degree,
        "up": { "axis": up.up.to_array(), "reason": up.reason },
        "stations": stations(cloud),
        "columns": columns(cloud),
        "classes": classes(cloud),
        "returns": returns(cloud),
        "flags": flags(cloud),
        "columns_in_file": source.columns,
        "images": images(source),
    }))
}

/// Unit of the coordinates by the coordinate system, or else by the format.
fn unit(source: &FileInfo) -> Unit {
    let system = source.coordinate_system.as_deref().and_then(CoordinateSystem::parse);
    let of_format = if source.is_in_metres { Unit::Metres(1.0) } else { Unit::Unknown };
    system.map_or(of_format, |system| system.unit())
}

/// Scans with the places of their scanners and their numbers of points.
fn stations(cloud: &PointCloud) -> Vec<Value> {
    let mut n_points = vec![0u64; cloud.stations.len()];
    match cloud.scalar(STATION) {
        Some(indices) => (0..cloud.len()).for_each(|i| {
            n_points.get_mut(indices.get(i) as usize).into_iter().for_each(|n| *n += 1);
        }),
        None => n_points.iter_mut().for_each(|n| *n = cloud.len() as u64),
    }
    let stations = cloud.stations.iter().zip(n_points);
    let describe = |(station, n_points): (&ScanStation, u64)| {
        let position = station.position.map(|position| position.to_array());
        let [rows, columns] = station.grid.map_or([None; 2], |grid| grid.map(Some));
        json!({
            "name": station.name,
            "position": position,
            "rotation": station.rotation.to_array(),
            "rows": rows,
            "columns": columns,
            "points": n_points,
        })
    };
    stations.map(describe).collect()
}

/// Pictures in the file with the places of their cameras.
fn images(source: &FileInfo) -> Vec<Value> {
    let describe = |image: &EmbeddedImage| {
        json!({
            "name": image.name,
            "camera": image.camera.name(),
            "resolution": [image.width, image.height],
            "bytes": image.n_bytes,
            "position": image.position.map(|position| position.to_array()),
            "scan": image.scan,
        })
    };
    source.images.iter().map(describe).collect()
}

/// Numbers of points of each ASPRS class that occurs.
fn classes(cloud: &PointCloud) -> Map<String, Value> {
    let mut counts = [0u64; 256];
    cloud.classification.iter().flatten().for_each(|class| counts[usize::from(*class)] += 1);
    let found = (0..=u8::MAX).zip(counts).filter(|(_, count)| 0 < *count);
    found.map(|(class, count)| (format!("{class} {}", class_name(class)), json!(count))).collect()
}

/// Numbers of points of each return of a pulse.
fn returns(cloud: &PointCloud) -> Map<String, Value> {
    let mut counts = BTreeMap::new();
    if let Some(numbers) = cloud.scalar(RETURN_NUMBER) {
        (0..cloud.len()).for_each(|i| *counts.entry(numbers.get(i) as u8).or_insert(0u64) += 1);
    }
    counts.into_iter().map(|(number, count)| (number.to_string(), json!(count))).collect()
}

/// Numbers of points of each flag that is set at all.
fn flags(cloud: &PointCloud) -> Map<String, Value> {
    let count = |values: &Values| (0..values.len()).filter(|i| values.get(*i) != 0.0).count();
    let of_flags = cloud.scalars.iter().filter(|scalar| is_flag(&scalar.name));
    of_flags.map(|scalar| (scalar.name.clone(), json!(count(&scalar.values)))).collect()
}

/// Columns by the names that filters take, with their least and greatest values.
fn columns(cloud: &PointCloud) -> Map<String, Value> {
    let mut columns = Map::new();
    let mut add = |name: &str, values: &mut dyn Iterator<Item = f64>| {
        let stated = values.filter(|value| is_data(*value));
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = stated.fold(none, |(low, high), v| (v.min(low), v.max(high)));
        let range = if low <= high { json!([low, high]) } else { Value::Null };
        columns.insert(name.to_owned(), range);
    };
    if let Some(colors) = &cloud.colors {
        let unit = if have_8_bits(colors) { COLOR_8_TO_16 } else { 1 };
        for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
            add(name, &mut colors.iter().map(|color| (color[channel] / unit).into()));
        }
    }
    if let Some(values) = &cloud.intensity {
        add("intensity", &mut values.iter().map(|&value| value.into()));
    }
    if let Some(classes) = &cloud.classification {
        add("classification", &mut classes.iter().map(|&class| class.into()));
    }
    if let Some(normals) = &cloud.normals {
        for (axis, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
            add(name, &mut normals.iter().map(|normal| normal[axis].into()));
        }
    }
    if let Some(radii) = &cloud.radii {
        add("radius", &mut radii.iter().map(|&radius| radius.into()));
    }
    for scalar in &cloud.scalars {
        add(&scalar.name, &mut (0..cloud.len()).map(|i| scalar.values.get(i)));
    }
    columns
}

fn table(info: &Value) -> String {
    let mut lines = vec![info["file"].as_str().unwrap_or_default().to_owned()];
    let mut row = |name: &str, value: String| lines.push(format!("  {name:<14}{value}"));
    row("format", text(&info["format"]));
    row("points", text(&info["points"]));
    if info["points_without_position"].as_u64().is_some_and(|count| 0 < count) {
        row("", format!("{} of them without a position", text(&info["points_without_position"])));
    }
    if !info["triangles"].is_null() {
        row("triangles", text(&info["triangles"]));
    }
    if !info["spherical_harmonics_degree"].is_null() {
        row("harmonics", format!("degree {}", text(&info["spherical_harmonics_degree"])));
    }
    let bounds = &info["bounds"];
    let is_summary = info["columns"].is_null();
    row(
        "bounds",
        match bounds {
            Value::Null if !is_summary => "none: no point has a position".to_owned(),
            Value::Null => text(bounds),
            bounds => format!("{} to {}", text(&bounds["min"]), text(&bounds["max"])),
        },
    );
    if !is_summary {
        row("global shift", text(&info["global_shift"]));
        row("spacing", format!("{} between points, about", text(&info["spacing"])));
        // Nobody counts the corners of a mesh by area.
        let density = info["points_per_square_unit"].as_f64();
        if let Some(density) = density.filter(|_| info["triangles"].is_null()) {
            let unit = match text(&info["unit"]) {
                unit if unit == Unit::Unknown.to_string() => "unit".to_owned(),
                unit => unit,
            };
            let density = rounded(density);
            row("density", format!("{density} points a square {unit} seen from above, about"));
        }
    }
    row("resolution", text(&info["resolution"]));
    row(
        "coordinates",
        info["coordinate_system"].as_str().map_or_else(|| text(&Value::Null), short_name),
    );
    row("unit", text(&info["unit"]));
    for (i, image) in info["images"].as_array().into_iter().flatten().enumerate() {
        row(if i == 0 { "images" } else { "" }, image_text(image));
    }
    if is_summary {
        // The names in files of text are not read before their points.
        let is_unknown = info["columns_in_file"].as_array().is_none_or(Vec::is_empty);
        row("columns", text(if is_unknown { &Value::Null } else { &info["columns_in_file"] }));
        return lines.join("\n");
    }
    let up = text(&info["up"]["reason"]);
    row("up", up.strip_prefix("up is ").unwrap_or(&up).to_owned());
    for (i, station) in info["stations"].as_array().into_iter().flatten().enumerate() {
        let title = if i == 0 { "stations" } else { "" };
        row(title, station_text(station));
    }
    let n_points = info["points"].as_f64().unwrap_or(1.0);
    for key in ["classes", "returns", "flags"] {
        for (i, (name, count)) in info[key].as_object().into_iter().flatten().enumerate() {
            let percent = 100.0 * count.as_f64().unwrap_or(0.0) / n_points;
            let title = if i == 0 { key } else { "" };
            row(title, format!("{name:<24}{:<12}{percent:.1} %", text(count)));
        }
    }
    for (i, (name, range)) in info["columns"].as_object().into_iter().flatten().enumerate() {
        let title = if i == 0 { "columns" } else { "" };
        row(title, format!("{name:<24}{}", range_text(range)));
    }
    lines.join("\n")
}

fn station_text(station: &Value) -> String {
    let points = counted(station["points"].as_u64().unwrap_or(0), "point");
    let position = text(&station["position"]);
    let mut line = format!("{:<24}{points}, scanner at {position}", text(&station["name"]));
    if station["rotation"] != json!([0.0, 0.0, 0.0, 1.0]) {
        line += &format!(", rotation x y z w {}", text(&station["rotation"]));
    }
    if !station["rows"].is_null() {
        let (rows, columns) = (text(&station["rows"]), text(&station["columns"]));
        line += &format!(", {rows} rows and {columns} columns");
    }
    line
}

fn image_text(image: &Value) -> String {
    let resolution: Vec<String> =
        image["resolution"].as_array().into_iter().flatten().map(text).collect();
    let mut line = format!(
        "{:<24}{}, {} pixels, {}",
        text(&image["name"]),
        text(&image["camera"]),
        resolution.join(" x "),
        counted(image["bytes"].as_u64().unwrap_or(0), "byte")
    );
    for (words, key) in [("camera at", "position"), ("of", "scan")] {
        if !image[key].is_null() {
            line += &format!(", {words} {}", text(&image[key]));
        }
    }
    line
}

fn range_text(range: &Value) -> String {
    match range.as_array().map(Vec::as_slice) {
        Some([low, high]) => format!("{} to {}", text(low), text(high)),
        _ => "no values".to_owned(),
    }
}

fn text(value: &Value) -> String {
    match value {
        Value::Null => "not stated".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(text).collect::<Vec<_>>().join(", "),
        Value::Number(number) if number.is_f64() => short(number.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    }
}

/// Three digits.
fn rounded(value: f64) -> String {
    format!("{value:.*}", (2 - value.log10().floor() as i32).clamp(0, 9) as usize)
}

/// Six digits at least, and no zeros at the end.
fn short(value: f64) -> String {
    let digits =
        if value == 0.0 { 0 } else { (6 - value.abs().log10().floor() as i32).clamp(3, 12) };
    let text = format!("{value:.*}", digits as usize);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    //! Numbers are short.

    use super::*;

    #[test]
    fn numbers_are_short_and_exact_enough() {
        assert_eq!(short(0.0), "0");
        assert_eq!(short(6_632_630.25), "6632630.25");
        assert_eq!(short(0.000_123_456_7), "0.0001234567");
        assert_eq!(short(-100.0), "-100");
    }
}

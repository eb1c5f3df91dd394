//! Writes clouds as text: XYZ, TXT and ASC with the header of CloudCompare, CSV with names of columns, PTS with a count.

use std::io::Write;
use std::ops::Range;
use std::path::Path;

use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, Values, to_8_bits};
use surfel_core::progress::Progress;

use super::number::{MAX_DECIMALS, push_fixed, push_float, push_whole};
use crate::error::Result;
use crate::file::{extension, write_error, write_file};
use crate::options::SaveOptions;
use crate::table::{ColumnRole, decimal_step, encode_points, note_rounded_colors, scalar_word};

/// Writes `cloud` to `path`, whose extension gives the form of the text.
pub(crate) fn write(
    path: &Path,
    cloud: &PointCloud,
    options: &SaveOptions,
    progress: &dyn Progress,
) -> Result<()> {
    let form = TextForm::from_extension(&extension(path));
    let columns = columns(cloud, options, form);
    if form == TextForm::Pts {
        note_losses(path, cloud, progress);
    }
    note_rounded_colors(path, cloud, progress);
    progress.begin(&format!("write {}", path.display()), cloud.len() as u64);
    write_file(path, |writer| {
        let mut put = |bytes: &[u8]| writer.write_all(bytes).map_err(|e| write_error(path, e));
        put(first_line(cloud, &columns, form).as_bytes())?;
        encode_points(cloud.len(), |points| Ok(encode(&columns, form, points)), progress, put)
    })
}

/// The forms of text that differ by their first line and the separator.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TextForm {
    /// Spaces, and `//X Y Z` with the names of the other columns.
    Spaces,
    /// Commas, and the names of the columns.
    Csv,
    /// Spaces, and the number of points. The columns have a fixed order.
    Pts,
}

impl TextForm {
    fn from_extension(extension: &str) -> Self {
        match extension {
            "csv" => Self::Csv,
            "pts" => Self::Pts,
            _ => Self::Spaces,
        }
    }
}

/// A column of the file.
struct OutputColumn<'a> {
    name: String,
    cells: Cells<'a>,
}

/// The numbers of a column.
enum Cells<'a> {
    /// World coordinate on an axis, with the digits of its precision.
    Position(&'a PointCloud, usize, Digits),
    /// Component of vectors.
    Component(&'a [Vec3], usize),
    /// Channel of colours, rounded to 8 bits.
    Channel(&'a [[u16; 3]], usize),
    /// Radii or intensities.
    F32(&'a [f32]),
    /// Classes.
    Classes(&'a [u8]),
    /// Scalar column.
    Scalar(&'a Values),
}

/// The digits of the coordinates on an axis.
#[derive(Clone, Copy)]
enum Digits {
    /// A number of decimals, which the file's stated resolution needs.
    Stated(usize),
    /// At most this number of decimals: no more than f32 resolves about the origin.
    Resolved(usize),
    /// The fewest digits that read back equal in f32. The origin is zero, so coordinates are those of the file.
    Shortest,
}

impl Digits {
    fn new(cloud: &PointCloud, options: &SaveOptions, axis: usize) -> Self {
        let bounds = cloud.bounds();
        let extent = f64::from(bounds.min[axis].abs().max(bounds.max[axis].abs()));
        // The bounds of no points are infinite.
        let resolved = n_decimals(decimal_step(if extent.is_finite() { extent } else { 0.0 }));
        let stated = options.resolution.map(|resolution| resolution[axis]);
        match stated.filter(|step| 0.0 < *step && step.is_finite()) {
            Some(step) => Self::Stated(n_decimals(step).min(resolved)),
            None if cloud.origin[axis] == 0.0 => Self::Shortest,
            None => Self::Resolved(resolved),
        }
    }
}

/// Returns the number of decimals that write multiples of `step` without a loss that counts.
fn n_decimals(step: f64) -> usize {
    let is_exact = |decimals: &usize| {
        let multiple = step * 10.0_f64.powi(*decimals as i32);
        0.5 < multiple && (multiple - multiple.round()).abs() < 1e-6 * multiple
    };
    (0..MAX_DECIMALS).find(is_exact).unwrap_or(MAX_DECIMALS)
}

/// Returns the columns of the file in order.
fn columns<'a>(
    cloud: &'a PointCloud,
    options: &SaveOptions,
    form: TextForm,
) -> Vec<OutputColumn<'a>> {
    let digits = |axis| Digits::new(cloud, options, axis);
    let positions =
        (0..3).map(|axis| (ColumnRole::Position(axis), Cells::Position(cloud, axis, digits(axis))));
    let colors = cloud.colors.iter().flat_map(|colors| {
        (0..3).map(|channel| (ColumnRole::Color(channel), Cells::Channel(colors, channel)))
    });
    let intensity = cloud.intensity.iter().map(|v| (ColumnRole::Intensity, Cells::F32(v)));
    let normals = cloud.normals.iter().flat_map(|normals| {
        (0..3).map(move |axis| (ColumnRole::Normal(axis), Cells::Component(normals, axis)))
    });
    let radii = cloud.radii.iter().map(|v| (ColumnRole::Radius, Cells::F32(v)));
    let classes =
        cloud.classification.iter().map(|v| (ColumnRole::Classification, Cells::Classes(v)));
    let scalars = cloud.scalars.iter().map(|scalar| {
        (ColumnRole::Scalar(scalar_word(&scalar.name)), Cells::Scalar(&scalar.values))
    });
    let columns: Vec<(ColumnRole, Cells)> = match form {
        TextForm::Pts => positions.chain(intensity).chain(colors).collect(),
        TextForm::Spaces | TextForm::Csv => {
            let vectors = positions.chain(colors).chain(normals);
            vectors.chain(radii).chain(intensity).chain(classes).chain(scalars).collect()
        }
    };
    let named = columns.into_iter();
    named.map(|(role, cells)| OutputColumn { name: column_name(&role, form), cells }).collect()
}

/// Returns the name of a column in a header; CloudCompare has its own for those that it knows.
fn column_name(role: &ColumnRole, form: TextForm) -> String {
    let name = match role {
        ColumnRole::Position(axis) => ["X", "Y", "Z"][*axis],
        ColumnRole::Color(channel) => ["R", "G", "B"][*channel],
        ColumnRole::Normal(axis) => ["Nx", "Ny", "Nz"][*axis],
        ColumnRole::Radius => "Radius",
        ColumnRole::Intensity => "Intensity",
        ColumnRole::Classification => "Classification",
        ColumnRole::Scalar(name) => name,
    };
    if form == TextForm::Csv { role.name() } else { name }.to_owned()
}

fn first_line(cloud: &PointCloud, columns: &[OutputColumn], form: TextForm) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    match form {
        TextForm::Spaces => format!("//{}\n", names.join(" ")),
        TextForm::Csv => format!("{}\n", names.join(",")),
        TextForm::Pts => format!("{}\n", cloud.len()),
    }
}

/// Notes the columns that PTS files do not hold.
fn note_losses(path: &Path, cloud: &PointCloud, progress: &dyn Progress) {
    let present = [
        ("normals", cloud.normals.is_some()),
        ("radii", cloud.radii.is_some()),
        ("classes", cloud.classification.is_some()),
    ];
    let lost = present.iter().filter(|(_, is_present)| *is_present).map(|(name, _)| *name);
    let lost: Vec<&str> = lost.chain(cloud.scalars.iter().map(|s| s.name.as_str())).collect();
    if !lost.is_empty() {
        let (path, lost) = (path.display(), lost.join(", "));
        let line = format!("{path}: PTS holds intensity and colour only; left out: {lost}");
        progress.note(&line);
    }
}

/// Encodes the lines of these points.
fn encode(columns: &[OutputColumn], form: TextForm, points: Range<usize>) -> Vec<u8> {
    let separator = if form == TextForm::Csv { b',' } else { b' ' };
    let mut text = Vec::with_capacity(8 * columns.len() * points.len());
    for i in points {
        for column in columns {
            column.cells.push(i, &mut text);
            text.push(separator);
        }
        text.pop();
        text.push(b'\n');
    }
    text
}

impl Cells<'_> {
    /// Appends the number of a point.
    fn push(&self, i: usize, text: &mut Vec<u8>) {
        match *self {
            Self::Position(cloud, axis, digits) => {
                let local = cloud.positions[i][axis];
                let world = cloud.origin[axis] + f64::from(local);
                match digits {
                    Digits::Stated(decimals) => push_fixed(text, world, decimals, false),
                    Digits::Resolved(decimals) => push_fixed(text, world, decimals, true),
                    Digits::Shortest => push_float(text, local),
                }
            }
            Self::Component(vectors, axis) => push_float(text, vectors[i][axis]),
            Self::Channel(colors, channel) => push_whole(text, to_8_bits(colors[i][channel])),
            Self::F32(values) => push_float(text, values[i]),
            Self::Classes(classes) => push_whole(text, classes[i]),
            Self::Scalar(values) => match values {
                Values::U8(v) => push_whole(text, v[i]),
                Values::U16(v) => push_whole(text, v[i]),
                Values::I32(v) => push_whole(text, v[i]),
                Values::F32(v) => push_float(text, v[i]),
                Values::F64(v) => push_float(text, v[i]),
            },
        }
    }
}

//! Infers the roles of text columns without a header from their number and values.

use std::ops::Range;

use crate::table::{ColorRange, ColumnRole, is_byte};

/// Returns the roles of `n_fields` columns, and a description of them. `is_pts` states the order of PTS files, whose
/// intensity comes before the colour.
///
/// Three columns are a colour or a normal if their values can be one. What is neither is the intensity if it is the only
/// column beside coordinates and colour, or in front of a colour; else a scalar, named by its number.
pub(super) fn infer_columns(
    sample: &[Vec<f64>],
    n_fields: usize,
    is_pts: bool,
) -> (Vec<Option<ColumnRole>>, String) {
    let mut names = if 4 <= n_fields && counts_up(sample) { vec!["-"] } else { vec![] };
    names.extend(["x", "y", "z"]);
    let is_color = |first| first + 3 <= n_fields && has_colors(sample, first);
    let axes = names.len() - 3..names.len();
    let is_normal = |first| first + 3 <= n_fields && has_normals(sample, first, axes.clone());
    while names.len() < n_fields {
        let column = names.len();
        let is_last = column + 1 == n_fields;
        let comes_before_color = || {
            let is_surely_later = || !is_color(column) || is_pts;
            is_color(column + 1) && (is_surely_later() || !is_grayer(sample, column, column + 1))
        };
        let next: &[&str] = if !names.contains(&"nx") && is_normal(column) {
            &["nx", "ny", "nz"]
        } else if !names.contains(&"r") && comes_before_color() {
            &["intensity", "r", "g", "b"]
        } else if !names.contains(&"r") && is_color(column) {
            &["r", "g", "b"]
        } else if is_last
            && matches!(names.last(), Some(&"z" | &"b"))
            && !names.contains(&INTENSITY)
        {
            &[INTENSITY]
        } else {
            &[""]
        };
        names.extend(next);
    }
    names.truncate(n_fields);
    let columns = names.iter().enumerate().map(|(i, name)| match *name {
        "-" => None,
        "" => Some(ColumnRole::Scalar(scalar_name(i))),
        name => ColumnRole::from_name(name),
    });
    (columns.collect(), describe(&names))
}

const INTENSITY: &str = "intensity";

/// Returns the name of a scalar without a header.
fn scalar_name(column: usize) -> String {
    format!("column {}", column + 1)
}

/// Returns the names of columns in one line; scalars have an empty name.
fn describe(names: &[&str]) -> String {
    let mut description = String::new();
    for (i, name) in names.iter().enumerate() {
        if 0 < i {
            let is_beside_scalar = name.is_empty() || names[i - 1].is_empty();
            description += if is_beside_scalar { ", " } else { " " };
        }
        description += &if name.is_empty() { scalar_name(i) } else { (*name).to_owned() };
    }
    description
}

/// Returns true if three columns can be a colour: whole numbers of 8 or 16 bits, or numbers from 0 to 1. Vectors of
/// length 1 are normals, although those along the axes are whole numbers, too.
fn has_colors(sample: &[Vec<f64>], first: usize) -> bool {
    let has_bytes = (first..first + 3).all(|column| has_class_values(sample, column));
    let mut values = sample.iter().flat_map(|row| &row[first..first + 3]);
    let has_fractions = values.all(|value| (0.0..=1.0).contains(value));
    (has_bytes || has_fractions || has_16_bits(sample, first)) && !has_unit_lengths(sample, first)
}

/// Returns true if three columns have whole numbers of 16 bits, each with some that need more than 8.
fn has_16_bits(sample: &[Vec<f64>], first: usize) -> bool {
    (first..first + 3).all(|column| {
        let mut values = sample.iter().map(|row| row[column]);
        values.clone().all(|value| value.fract() == 0.0 && (0.0..65536.0).contains(&value))
            && values.any(|value| 255.0 < value)
    })
}

/// Returns true if the channels of the first three columns differ less from each other than those of the others.
fn is_grayer(sample: &[Vec<f64>], first: usize, others: usize) -> bool {
    let difference = |first: usize| -> f64 {
        let of_row = |row: &Vec<f64>| {
            let [r, g, b] = [row[first], row[first + 1], row[first + 2]];
            r.max(g).max(b) - r.min(g).min(b)
        };
        sample.iter().map(of_row).sum()
    };
    difference(first) < difference(others)
}

/// Returns true if three columns can be a normal: vectors of length 1, or shorter than the longest side of the points,
/// whose lengths may be radii. `axes` are the columns of the coordinates.
fn has_normals(sample: &[Vec<f64>], first: usize, axes: Range<usize>) -> bool {
    let values = || sample.iter().flat_map(|row| &row[first..first + 3]).copied();
    let is_signed = values().any(|value| value < 0.0);
    let are_whole = values().all(|value| value.fract() == 0.0);
    let sides = axes.map(|axis| {
        let coordinates = || sample.iter().map(|row| row[axis]);
        coordinates().fold(f64::MIN, f64::max) - coordinates().fold(f64::MAX, f64::min)
    });
    let longest = sides.fold(0.0, f64::max);
    let may_be_radii = is_signed && !are_whole && values().all(|value| value.abs() < longest);
    has_unit_lengths(sample, first) || may_be_radii
}

/// Returns true if three columns have vectors of length 1, except for zeros.
fn has_unit_lengths(sample: &[Vec<f64>], first: usize) -> bool {
    let lengths = sample.iter().map(|row| row[first..first + 3].iter().map(|v| v * v).sum());
    let mut squares = lengths.filter(|squared: &f64| *squared != 0.0).peekable();
    squares.peek().is_some() && squares.all(|squared| (0.98..1.02).contains(&squared))
}

/// Returns true if the first column numbers the points: whole numbers that grow from line to line, also over the parts of
/// the file from which the lines are. A column of coordinates starts again with each row of a grid.
fn counts_up(sample: &[Vec<f64>]) -> bool {
    /// With fewer lines, coordinates may grow by chance.
    const MIN_LINES: usize = 32;
    let numbers = sample.iter().map(|row| row[0]);
    MIN_LINES <= sample.len()
        && numbers.clone().all(|number| number.fract() == 0.0)
        && numbers.clone().zip(numbers.skip(1)).all(|(a, b)| a < b)
}

/// Returns the range of the colours in these columns.
pub(super) fn color_range(sample: &[Vec<f64>], columns: &[usize]) -> ColorRange {
    ColorRange::from_text(sample.iter().flat_map(|row| columns.iter().map(|column| row[*column])))
}

/// Returns true if the column has only whole numbers from 0 to 255.
pub(super) fn has_class_values(sample: &[Vec<f64>], column: usize) -> bool {
    sample.iter().all(|row| is_byte(row[column]))
}

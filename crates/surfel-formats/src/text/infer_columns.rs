//! Infers the roles of text columns without a header from their number and values.

use crate::table::{ColorRange, ColumnRole, is_byte};

/// Returns the roles of `n_fields` columns, and a description of them.
pub(super) fn infer_columns(
    sample: &[Vec<f64>],
    n_fields: usize,
) -> (Vec<Option<ColumnRole>>, String) {
    let has_bytes = |first| (first..first + 3).all(|column| has_class_values(sample, column));
    // Normals along the axes are whole numbers, too.
    let is_color = |first| has_bytes(first) && !has_unit_lengths(sample, first);
    let names: &[&str] = match n_fields {
        4 if counts_up(sample) => &["-", "x", "y", "z"],
        4 => &["x", "y", "z", "intensity"],
        6 if is_color(3) => &["x", "y", "z", "r", "g", "b"],
        6 if has_fractions_of_color(sample, 3) => &["x", "y", "z", "r", "g", "b"],
        6 => &["x", "y", "z", "nx", "ny", "nz"],
        // The order of PTS files takes precedence, because an intensity may look like a colour.
        7 if has_bytes(4) => &["x", "y", "z", "intensity", "r", "g", "b"],
        7 if has_bytes(3) => &["x", "y", "z", "r", "g", "b", "intensity"],
        9 if is_color(3) => &["x", "y", "z", "r", "g", "b", "nx", "ny", "nz"],
        9 if is_color(6) => &["x", "y", "z", "nx", "ny", "nz", "r", "g", "b"],
        _ => &["x", "y", "z"],
    };
    let mut columns: Vec<Option<ColumnRole>> =
        names.iter().map(|name| ColumnRole::from_name(name).filter(|_| *name != "-")).collect();
    let mut description = names.join(" ");
    for column in names.len()..n_fields {
        let name = format!("column {}", column + 1);
        description += &format!(", {name}");
        columns.push(Some(ColumnRole::Scalar(name)));
    }
    columns.truncate(n_fields);
    (columns, description)
}

/// Returns true if three columns have colours from 0 to 1: other than normals, they differ in length.
fn has_fractions_of_color(sample: &[Vec<f64>], first: usize) -> bool {
    let mut values = sample.iter().flat_map(|row| &row[first..first + 3]);
    values.all(|value| (0.0..=1.0).contains(value)) && !has_unit_lengths(sample, first)
}

/// Returns true if three columns have vectors of length 1.
fn has_unit_lengths(sample: &[Vec<f64>], first: usize) -> bool {
    let is_unit = |row: &Vec<f64>| {
        let squares: f64 = row[first..first + 3].iter().map(|value| value * value).sum();
        (0.98..1.02).contains(&squares)
    };
    !sample.is_empty() && sample.iter().all(is_unit)
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

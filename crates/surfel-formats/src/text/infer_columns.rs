//! Infers the roles of text columns without a header from their number and values.

use crate::table::{ColorRange, ColumnRole, is_byte};

/// Returns the roles of `n_fields` columns, and a description of them.
pub(super) fn infer_columns(
    sample: &[Vec<f64>],
    n_fields: usize,
) -> (Vec<Option<ColumnRole>>, String) {
    let is_color = |first| (first..first + 3).all(|column| has_class_values(sample, column));
    let names: &[&str] = match n_fields {
        4 => &["x", "y", "z", "intensity"],
        6 if is_color(3) => &["x", "y", "z", "r", "g", "b"],
        6 => &["x", "y", "z", "nx", "ny", "nz"],
        // The order of PTS files takes precedence, because an intensity may look like a colour.
        7 if is_color(4) => &["x", "y", "z", "intensity", "r", "g", "b"],
        7 if is_color(3) => &["x", "y", "z", "r", "g", "b", "intensity"],
        9 if is_color(3) => &["x", "y", "z", "r", "g", "b", "nx", "ny", "nz"],
        9 if is_color(6) => &["x", "y", "z", "nx", "ny", "nz", "r", "g", "b"],
        _ => &["x", "y", "z"],
    };
    let mut columns: Vec<Option<ColumnRole>> =
        names.iter().map(|name| ColumnRole::from_name(name)).collect();
    let mut description = names.join(" ");
    for column in names.len()..n_fields {
        let name = format!("column {}", column + 1);
        description += &format!(", {name}");
        columns.push(Some(ColumnRole::Scalar(name)));
    }
    columns.truncate(n_fields);
    (columns, description)
}

/// Returns the range of the colours in these columns.
pub(super) fn color_range(sample: &[Vec<f64>], columns: &[usize]) -> ColorRange {
    ColorRange::from_text(sample.iter().flat_map(|row| columns.iter().map(|column| row[*column])))
}

/// Returns true if the column has only whole numbers from 0 to 255.
pub(super) fn has_class_values(sample: &[Vec<f64>], column: usize) -> bool {
    sample.iter().all(|row| is_byte(row[column]))
}

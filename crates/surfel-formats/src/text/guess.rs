//! The meaning of text columns that no header names, guessed from their number and values.

use crate::range::{ColorRange, is_byte};
use crate::role::Role;

/// Roles of `n_fields` columns, and the same in words.
pub(super) fn guess_columns(sample: &[Vec<f64>], n_fields: usize) -> (Vec<Option<Role>>, String) {
    let is_color = |from| (from..from + 3).all(|column| holds_classes(sample, column));
    let names: &[&str] = match n_fields {
        4 => &["x", "y", "z", "intensity"],
        6 if is_color(3) => &["x", "y", "z", "r", "g", "b"],
        6 => &["x", "y", "z", "nx", "ny", "nz"],
        // The order of PTS files goes first: an intensity may look like a colour.
        7 if is_color(4) => &["x", "y", "z", "intensity", "r", "g", "b"],
        7 if is_color(3) => &["x", "y", "z", "r", "g", "b", "intensity"],
        9 if is_color(3) => &["x", "y", "z", "r", "g", "b", "nx", "ny", "nz"],
        9 if is_color(6) => &["x", "y", "z", "nx", "ny", "nz", "r", "g", "b"],
        _ => &["x", "y", "z"],
    };
    let mut columns: Vec<Option<Role>> = names.iter().map(|name| Role::of_name(name)).collect();
    let mut description = names.join(" ");
    for column in names.len()..n_fields {
        let name = format!("column {}", column + 1);
        description += &format!(", {name}");
        columns.push(Some(Role::Scalar(name)));
    }
    columns.truncate(n_fields);
    (columns, description)
}

/// The range of the colours in these columns.
pub(super) fn color_range(sample: &[Vec<f64>], columns: &[usize]) -> ColorRange {
    ColorRange::of_text(sample.iter().flat_map(|row| columns.iter().map(|column| row[*column])))
}

/// True if the column has only whole numbers from 0 to 255.
pub(super) fn holds_classes(sample: &[Vec<f64>], column: usize) -> bool {
    sample.iter().all(|row| is_byte(row[column]))
}

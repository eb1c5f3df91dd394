//! The meaning of text columns that no header names, guessed from their number and values.

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

/// The factor to 0..65535 that colours in these columns need, and their range in words.
pub(super) fn color_scale(sample: &[Vec<f64>], columns: &[usize]) -> (f64, &'static str) {
    let values = || {
        let rows = sample.iter();
        rows.flat_map(|row| columns.iter().map(|column| row[*column])).filter(|v| v.is_finite())
    };
    let largest = values().fold(0.0, f64::max);
    let has_fractions = values().any(|v| v.fract() != 0.0);
    if has_fractions && largest <= 1.0 {
        (65535.0, "0 to 1")
    } else if largest <= 255.0 {
        (257.0, "0 to 255")
    } else {
        (1.0, "0 to 65535")
    }
}

/// True if the column has only whole numbers from 0 to 255.
pub(super) fn holds_classes(sample: &[Vec<f64>], column: usize) -> bool {
    sample.iter().all(|row| row[column].fract() == 0.0 && (0.0..256.0).contains(&row[column]))
}

//! The names of columns in a header, as scanners, modelling programs and surveyors write them.

use crate::table::ColumnRole;

/// Returns the fields as names of columns, if x, y and z are among them.
pub(super) fn column_names(fields: &[&[u8]]) -> Option<Vec<String>> {
    let mut names: Vec<String> = fields
        .iter()
        .map(|field| String::from_utf8_lossy(field).trim_matches(['"', '\'', ' ']).to_owned())
        .collect();
    if names.last().is_some_and(String::is_empty) {
        names.pop();
    }
    let roles = roles_of_names(&names);
    (0..3).all(|axis| roles.contains(&ColumnRole::Position(axis))).then_some(names)
}

/// Returns the roles of named columns.
pub(super) fn roles_of_names(names: &[String]) -> Vec<ColumnRole> {
    let words: Vec<&str> = names.iter().map(String::as_str).collect();
    ColumnRole::from_names(&words)
}

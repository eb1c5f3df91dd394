//! Tables of keys and values: those of parts are read and written, and tables in tables are found by their paths.

use super::invalid::Invalid;
use super::keys::KeyedSettings;
use super::section::Part;
use super::spelling::{nearest, synonym};
use serde_json::{Map, Value};
use std::path::Path;

/// Sets a key of a part if the part has it.
pub(super) fn read_value(
    settings: &mut dyn KeyedSettings,
    key: &str,
    value: &Value,
    folder: &Path,
) -> Result<bool, Invalid> {
    if !settings.keys().iter().any(|known| known.name == key) {
        return Ok(false);
    }
    if value.is_null() {
        settings.unset(key);
    } else {
        settings.set(key, value, folder).map_err(|error| error.within(key))?;
    }
    Ok(true)
}

/// Sets all keys of a table.
pub(super) fn read_table(
    settings: &mut dyn KeyedSettings,
    table: &Map<String, Value>,
    folder: &Path,
) -> Result<(), Invalid> {
    for (key, value) in &take_normalized(table) {
        if !read_value(settings, key, value, folder)? {
            let known = settings.keys();
            return Err(unknown_key(key, known.iter().map(|key| key.name)));
        }
    }
    Ok(())
}

/// Writes the keys of a part that are set.
pub fn write_table<S: KeyedSettings + ?Sized>(settings: &S) -> Map<String, Value> {
    let keys = settings.keys().into_iter();
    keys.filter_map(|key| Some((key.name.to_owned(), settings.get(key.name)?))).collect()
}

/// Writes the keys of parts that are set, in tables by their prefixes.
pub(crate) fn write_parts(parts: &[Part<&dyn KeyedSettings>]) -> Map<String, Value> {
    let mut table = Map::new();
    for Part { prefix, settings, .. } in parts {
        let values = write_table(*settings);
        match prefix.trim_end_matches('.') {
            "" => table.extend(values),
            _ if values.is_empty() => {}
            name => _ = table.insert(name.to_owned(), Value::Object(values)),
        }
    }
    table
}

/// Both spellings are known: `focal-point` as on the command line, `focal_point` as in programs.
pub(super) fn take_normalized(table: &Map<String, Value>) -> Map<String, Value> {
    table.iter().map(|(key, value)| (key.replace('-', "_"), value.clone())).collect()
}

pub(super) fn unknown_key(key: &str, known: impl IntoIterator<Item = impl AsRef<str>>) -> Invalid {
    let known: Vec<String> = known.into_iter().map(|name| name.as_ref().to_owned()).collect();
    Invalid::at(key, format!("unknown key{}", key_advice(key, &known)))
}

/// Advises on an unknown key: by the known ones that mean the same or have its name in another table, or by the nearest.
pub(super) fn key_advice(key: &str, known: &[impl AsRef<str>]) -> String {
    let known = known.iter().map(AsRef::as_ref);
    let key = key.replace('-', "_");
    let last = |path: &str| path.rsplit('.').next().map(str::to_owned);
    let synonym = synonym(&key).filter(|path| known.clone().any(|known| known == *path));
    let paths: Vec<&str> = match synonym {
        Some(path) => vec![path],
        None => known.clone().filter(|path| last(path) == last(&key) && *path != key).collect(),
    };
    let Some(first) = paths.first() else { return nearest(&key, known) };
    let outside = match key.split_once('.') {
        Some((table, _)) if !first.contains('.') => format!(", outside of [{table}]"),
        _ => String::new(),
    };
    format!("; here it is `{}`{outside}", paths.join("` or `"))
}

/// Takes the tables of `[[name]]` out of a table.
pub(super) fn take_tables(
    table: &mut Map<String, Value>,
    name: &str,
) -> Result<Vec<Map<String, Value>>, Invalid> {
    let tables = match table.shift_remove(name) {
        None => return Ok(Vec::new()),
        Some(Value::Array(tables)) => tables,
        Some(table @ Value::Object(_)) => vec![table],
        Some(other) => return Err(Invalid::at(name, "expected tables").found(&other)),
    };
    let tables = tables.into_iter().enumerate().map(|(i, table)| match table {
        Value::Object(table) => Ok(table),
        other => Err(Invalid::at(format!("{name}[{i}]"), "expected a table").found(&other)),
    });
    tables.collect()
}

/// Lists values by their paths: tables in tables are one path. A material is a value itself.
pub(super) fn flatten<'v>(
    prefix: &str,
    table: &'v Map<String, Value>,
    values: &mut Vec<(String, &'v Value)>,
) {
    for (key, value) in table {
        let path = format!("{prefix}{key}");
        match value {
            Value::Object(inner) if path != "material" => {
                flatten(&format!("{path}."), inner, values)
            }
            value => values.push((path, value)),
        }
    }
}

/// Names with the tables that have them: `object[0]` and so on.
pub(super) fn numbered(table: &str, names: impl Iterator<Item = String>) -> Vec<(String, String)> {
    names.enumerate().map(|(i, name)| (format!("{table}[{i}]"), name)).collect()
}

/// Returns true if a name is there; fails if several tables have it.
pub(super) fn is_unique(
    named: &[(String, String)],
    wanted: &str,
    path: &str,
) -> Result<bool, Invalid> {
    let bearers = named.iter().filter(|(_, name)| name == wanted);
    let bearers: Vec<&str> = bearers.map(|(bearer, _)| bearer.as_str()).collect();
    if bearers.len() < 2 {
        return Ok(!bearers.is_empty());
    }
    let bearers = bearers.join(" and ");
    Err(Invalid::at(path, format!("`{wanted}` is the name of {bearers}; give each its own")))
}

//! File names with a `*` in them, in the order of their numbers.

use std::path::{Path, PathBuf};

/// Returns the files of a folder whose names match a pattern, in natural order; the pattern itself if it has no `*`.
///
/// # Errors
///
/// Fails if the folder cannot be read or no file matches.
pub fn matching(pattern: &Path) -> Result<Vec<PathBuf>, String> {
    let text = pattern.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if !text.contains('*') {
        return Ok(vec![pattern.to_owned()]);
    }
    let folder = match pattern.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let names = file_names(folder)?;
    let parts: Vec<&str> = text.split('*').collect();
    let mut names: Vec<String> = names.into_iter().filter(|name| matches(name, &parts)).collect();
    if names.is_empty() {
        return Err(format!("no file matches {}", pattern.display()));
    }
    names.sort_by_cached_key(|name| natural_order(name));
    let joined = pattern.parent().unwrap_or(Path::new(""));
    Ok(names.into_iter().map(|name| joined.join(name)).collect())
}

/// Returns the names of the files in a folder, in natural order.
///
/// # Errors
///
/// Fails if the folder cannot be read.
pub fn file_names(folder: &Path) -> Result<Vec<String>, String> {
    let entries = std::fs::read_dir(folder)
        .map_err(|error| format!("{}: cannot be read: {error}", folder.display()))?;
    let files = entries.filter_map(|entry| entry.ok()).filter(|entry| entry.path().is_file());
    let mut names: Vec<String> =
        files.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    names.sort_by_cached_key(|name| natural_order(name));
    Ok(names)
}

/// Returns true if a name starts with the first part, ends with the last, and has the others between, in order.
fn matches(name: &str, parts: &[&str]) -> bool {
    let [first, middle @ .., last] = parts else { return false };
    let Some(rest) = name.strip_prefix(first) else { return false };
    let Some(mut rest) = rest.strip_suffix(last) else { return false };
    for part in middle {
        let Some((_, after)) = rest.split_once(part) else { return false };
        rest = after;
    }
    true
}

/// A sort key by which `frame_10` comes after `frame_9` and `frame_009`: runs of digits count without their leading
/// zeros, and by their length first. The text decides between equal numbers.
fn natural_order(name: &str) -> (Vec<(usize, String)>, String) {
    let mut parts: Vec<(usize, String)> = Vec::new();
    for c in name.chars() {
        let is_digit = c.is_ascii_digit();
        match parts.last_mut() {
            Some((1, part)) if is_digit && *part == "0" => *part = c.to_string(),
            Some((len, part)) if is_digit && 0 < *len => {
                part.push(c);
                *len += 1;
            }
            _ => parts.push((usize::from(is_digit), c.to_string())),
        }
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests {
    //! The order of names, and what a pattern matches.

    use super::*;

    #[test]
    fn names_are_in_the_order_of_their_numbers() {
        let mut names = ["f10.ply", "f9.ply", "f1.ply", "e2.ply"];
        names.sort_by_key(|name| natural_order(name));
        assert_eq!(names, ["e2.ply", "f1.ply", "f9.ply", "f10.ply"]);
        let mut names = ["f10.ply", "f2.ply", "f009.ply", "f02.ply", "f0.ply", "f000.ply", "f.ply"];
        names.sort_by_key(|name| natural_order(name));
        assert_eq!(
            names,
            ["f.ply", "f0.ply", "f000.ply", "f02.ply", "f2.ply", "f009.ply", "f10.ply"]
        );
    }

    #[test]
    fn a_star_stands_for_any_text() {
        let fits =
            |pattern: &str, name: &str| matches(name, &pattern.split('*').collect::<Vec<_>>());
        assert!(fits("*.laz", "a.laz") && fits("a*b*.ply", "a1b2.ply") && fits("a*", "a"));
        assert!(!fits("*.laz", "a.las") && !fits("ab*ba", "aba"));
    }
}

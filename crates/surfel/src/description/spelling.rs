//! Advice on names that are not known.

/// Advises on an unknown name: the nearest known one, or all known ones if none is near.
pub fn nearest<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match nearest_if_any(found, known.iter().copied()) {
        none if none.is_empty() && !known.is_empty() => format!("; known: {}", known.join(", ")),
        advice => advice,
    }
}

/// Advises on an unknown name by the nearest known one; empty if none is near.
pub fn nearest_if_any<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let likeness = |name: &&str| match strsim::osa_distance(found, name) {
        // Two swapped letters of a short word, which the other measure takes for another word.
        0 | 1 => 1.0,
        _ => strsim::jaro_winkler(found, name),
    };
    let best = known.into_iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    let is_near = |name: &&str| 0.75 < likeness(name);
    best.filter(is_near)
        .map_or_else(String::new, |name| format!("; the nearest known one is `{name}`"))
}

/// Returns the known name that a text misspells: all but at most a third of its letters are the same.
pub fn misspelled<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let n_wrong = |name: &&str| strsim::osa_distance(&found.to_lowercase(), name);
    let best = known.into_iter().min_by_key(n_wrong);
    best.filter(|name| n_wrong(name) <= found.chars().count() / 3)
}

/// Returns the message of an error of the library; an unknown name is answered with the nearest known one.
pub fn with_nearest(error: &surfel_core::Error) -> String {
    match error {
        surfel_core::Error::UnknownName { found, known, .. } => {
            format!("{error}{}", nearest_if_any(found, known.split(", ")))
        }
        _ => error.to_string(),
    }
}

/// Words of other programs, with the keys that mean the same here.
const SYNONYMS: [(&str, &str); 15] = [
    ("fov", "camera.view_angle"),
    ("eye", "camera.position"),
    ("zoom", "camera.zoom_factor"),
    ("width", "resolution"),
    ("height", "resolution"),
    ("size", "resolution"),
    ("window_size", "resolution"),
    ("samples", "spp"),
    ("scalars", "color"),
    ("colour", "color"),
    ("scalar_field", "color"),
    ("colormap", "cmap"),
    ("clim", "range"),
    ("voxel_size", "subsample"),
    ("point_radius", "radius"),
];

/// Returns the path of the key for which this is the word of other programs.
pub fn synonym(found: &str) -> Option<&'static str> {
    let found = found.replace(['-', '.'], "_");
    let found = found.strip_prefix("camera_").unwrap_or(&found);
    SYNONYMS.iter().find(|(word, _)| *word == found).map(|(_, path)| *path)
}

#[cfg(test)]
mod tests {
    //! Words of other programs lead to keys.

    use super::*;
    use crate::SceneDescription;

    #[test]
    fn words_of_other_programs_are_no_keys_and_mean_one() {
        let keys = SceneDescription::keys();
        let is_key = |found: &str| keys.iter().any(|(path, ..)| path == found);
        for (word, path) in SYNONYMS {
            assert!(is_key(path) && !is_key(word), "{word}: {path}");
        }
        assert_eq!(synonym("window-size"), Some("resolution"));
        assert_eq!(synonym("camera.fov"), Some("camera.view_angle"));
        assert_eq!(synonym("resolution"), None);
    }
}

//! Advice on names that are not known.

/// Advises on an unknown name: the nearest known one, or all known ones if none is near.
pub fn nearest<'k>(found: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let likeness = |name: &&&str| match strsim::osa_distance(found, name) {
        // Two swapped letters of a short word, which the other measure takes for another word.
        0 | 1 => 1.0,
        _ => strsim::jaro_winkler(found, name),
    };
    let best = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    match best {
        Some(best) if 0.75 < likeness(&best) => format!("; the nearest known one is `{best}`"),
        Some(_) => format!("; known: {}", known.join(", ")),
        None => String::new(),
    }
}

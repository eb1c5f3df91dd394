//! Keys that exclude each other.

use super::Invalid;
use super::keys::KeyedSettings;
use super::section::Part;

/// Keys of the camera that a plan to scale has none of.
const NOT_OF_PLANS: &[&str] = &[
    "camera.orthographic",
    "camera.panorama",
    "camera.station",
    "camera.name",
    "camera.zoom_factor",
    "camera.view_angle",
];

/// Keys with those that they exclude.
const EXCLUSIVE: &[(&str, &[&str])] = &[
    (
        "camera.panorama",
        &[
            "camera.orthographic",
            "camera.direction",
            "camera.elevation_angle",
            "camera.zoom_factor",
            "camera.view_angle",
        ],
    ),
    ("camera.orthographic", &["camera.view_angle"]),
    ("camera.direction", &["camera.azimuth_angle", "camera.elevation_angle"]),
    ("camera.position", &["camera.zoom_factor"]),
    (
        "camera.station",
        &[
            "camera.position",
            "camera.orthographic",
            "camera.direction",
            "camera.elevation_angle",
            "camera.zoom_factor",
            "camera.name",
        ],
    ),
    (
        "camera.name",
        &[
            "camera.position",
            "camera.focal_point",
            "camera.view_up",
            "camera.orthographic",
            "camera.panorama",
            "camera.direction",
            "camera.azimuth_angle",
            "camera.elevation_angle",
            "camera.zoom_factor",
        ],
    ),
    ("gsd", &["scale"]),
    ("gsd", NOT_OF_PLANS),
    ("scale", NOT_OF_PLANS),
    ("sun.date", &["sun.azimuth", "sun.elevation"]),
    ("normals_k", &["normals_radius"]),
];

/// Returns the keys that cannot be set together with `path`.
pub fn excluded_by(path: &str) -> impl Iterator<Item = &'static str> {
    EXCLUSIVE.iter().flat_map(move |(key, others)| {
        let excluded = others.iter().filter(move |_| *key == path).copied();
        excluded.chain(others.contains(&path).then_some(*key))
    })
}

/// Returns true if a key of a part is set to anything but false, which excludes nothing.
pub fn is_set(settings: &dyn KeyedSettings, name: &str) -> bool {
    settings.get(name).is_some_and(|value| value != serde_json::json!(false))
}

/// Fails at the first two keys that exclude each other.
pub fn check(parts: &[Part<&dyn KeyedSettings>]) -> Result<(), Invalid> {
    let is_set_at = |path: &str| {
        let (prefix, name) = path.split_once('.').map_or(("", path), |(table, name)| (table, name));
        let mut parts = parts.iter();
        parts.any(|part| part.prefix.trim_end_matches('.') == prefix && is_set(part.settings, name))
    };
    for (key, others) in EXCLUSIVE.iter().filter(|(key, _)| is_set_at(key)) {
        if let Some(other) = others.iter().find(|other| is_set_at(other)) {
            return Err(Invalid::at(*key, format!("excludes {other}; leave out one of them")));
        }
    }
    Ok(())
}

//! The rows of a page's list of files and objects: their names, and what descriptions call them.

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use surfel::SceneDescription;
use surfel::description::{MaterialChoice, ObjectOverride, names_of};
use surfel::file_names::file_name;
use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::scene::inlier_bounds;

/// The rows of the files and objects that the program was started with, in their order.
#[derive(Default)]
pub struct Rows(Vec<Row>);

/// A file or an object.
struct Row {
    /// Name by which pages call it, different from those of all others.
    name: String,
    /// The name by which settings of a description call it, and nothing else.
    target: String,
    /// The names by which a description may call it.
    known_as: Vec<PathBuf>,
}

impl Rows {
    /// The rows of a description. Of several with one name each gets a number.
    pub fn of(startup: &SceneDescription) -> Self {
        let files = startup.files.iter().map(|file| (file_name(file), vec![file.clone()]));
        let objects = startup.objects.iter();
        let objects = objects.map(|object| (object.name().to_owned(), object.names()));
        let all: Vec<(String, Vec<PathBuf>)> = files.chain(objects).collect();
        // Number of rows that each name means.
        let mut n_called: BTreeMap<&OsStr, usize> = BTreeMap::new();
        for (_, known_as) in &all {
            let names: BTreeSet<&OsStr> = known_as.iter().flat_map(|file| names_of(file)).collect();
            names.into_iter().for_each(|name| *n_called.entry(name).or_default() += 1);
        }
        let mut rows: Vec<Row> = Vec::new();
        let mut taken: BTreeSet<String> = BTreeSet::new();
        for (own_name, known_as) in &all {
            let is_shared = n_called.get(OsStr::new(own_name)).is_some_and(|n| 1 < *n);
            let path = known_as[0].display().to_string();
            let target = if is_shared { path } else { own_name.clone() };
            let name = numbered_name(own_name, |name| taken.contains(name));
            taken.insert(name.clone());
            rows.push(Row { name, target, known_as: known_as.clone() });
        }
        Self(rows)
    }

    /// The names of all rows.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().map(|row| row.name.clone()).collect()
    }

    /// Returns the name in settings of a description of the row that pages call `name`.
    pub fn target_of<'r>(&'r self, name: &'r str) -> &'r str {
        self.0.iter().find(|row| row.name == name).map_or(name, |row| &row.target)
    }

    /// Returns the name for pages of the only thing that settings of a description call `target`.
    pub fn name_of<'r>(&'r self, target: &'r str) -> &'r str {
        self.0.iter().find(|row| row.target == target).map_or(target, |row| &row.name)
    }

    /// Returns the names for pages of the rows that are meant, by one of the paths and names that they are known as.
    pub fn meant(&self, is_meant: impl Fn(&Path) -> bool) -> Vec<String> {
        let rows = self.0.iter().filter(|row| row.known_as.iter().any(|file| is_meant(file)));
        rows.map(|row| row.name.clone()).collect()
    }
}

/// Names files and objects in settings and materials as the rows of a page do: one setting for each row that it is about.
pub fn name_by_rows(startup: &mut SceneDescription, rows: &Rows) {
    let or_own = |found: Vec<String>, own: &str| match found.is_empty() {
        true => vec![own.to_owned()],
        false => found,
    };
    let settings = startup.overrides.object_settings.take();
    startup.overrides.object_settings = settings.map(|settings| {
        let renamed = settings.into_iter().flat_map(|one| {
            let targets = or_own(rows.meant(|file| one.names_file(file)), &one.target);
            targets.into_iter().map(move |target| ObjectOverride { target, ..one.clone() })
        });
        renamed.collect()
    });
    let materials = startup.materials.material.take();
    startup.materials.material = materials.map(|materials| {
        let renamed = materials.into_iter().flat_map(|one| {
            let Some(own) = &one.target else { return vec![one] };
            let targets = or_own(rows.meant(|file| one.names(file)), own).into_iter();
            let renamed = |target| MaterialChoice { target: Some(target), ..one.clone() };
            targets.map(renamed).collect()
        });
        renamed.collect()
    });
}

/// The name, with a number before its extension if it, or it without extension, means one of `taken` too.
pub fn free_name(name: &str, taken: &[String]) -> String {
    let stem = |name: &str| -> String {
        Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    };
    numbered_name(name, |name| {
        taken.iter().any(|other| other == name || *other == stem(name) || stem(other) == name)
    })
}

/// The name, or the first one with a number before its extension that is not taken.
fn numbered_name(name: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let (before, extension) = match name.rsplit_once('.') {
        Some((before, extension)) if !before.is_empty() => (before, format!(".{extension}")),
        _ => (name, String::new()),
    };
    let numbered = (2..).map(|number: u64| format!("{before} ({number}){extension}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| !is_taken(name)).unwrap_or_else(|| name.to_owned())
}

/// The bounds of points without outliers in world coordinates, as pages get them.
pub fn bounds_json(points: &PointCloud) -> Value {
    let bounds = inlier_bounds(points);
    let world = |corner: Vec3| (points.origin + corner.as_dvec3()).to_array();
    json!({ "min": world(bounds.min), "max": world(bounds.max) })
}

#[cfg(test)]
mod tests {
    //! Rows of files of one name.

    use super::*;
    use surfel::description::ObjectDescription;

    fn rows(files: &[&str]) -> Rows {
        let mut startup = SceneDescription::of_files(files);
        startup.objects.push(ObjectDescription::new("/c/tower.obj"));
        Rows::of(&startup)
    }

    #[test]
    fn files_of_one_name_have_rows_and_targets_of_their_own() {
        let rows = rows(&["/a/scan.laz", "/b/scan.laz", "/b/house.ply"]);
        assert_eq!(rows.names(), ["scan.laz", "scan (2).laz", "house.ply", "tower"]);
        for (name, target) in [
            ("scan.laz", "/a/scan.laz"),
            ("scan (2).laz", "/b/scan.laz"),
            ("house.ply", "house.ply"),
            ("tower", "tower"),
            ("other", "other"),
        ] {
            assert_eq!((rows.target_of(name), rows.name_of(target)), (target, name));
        }
    }

    #[test]
    fn a_name_may_mean_several_rows() {
        let rows = rows(&["/a/scan.laz", "/b/scan.laz"]);
        let meant = |name: &str| rows.meant(|file| names_of(file).any(|own| own == name));
        assert_eq!(meant("scan"), ["scan.laz", "scan (2).laz"]);
        assert_eq!(meant("/b/scan.laz"), ["scan (2).laz"]);
        assert!(meant("unknown").is_empty());
    }

    #[test]
    fn free_names_mean_nothing_else() {
        let taken = ["town.ply".to_owned(), "tower".to_owned()];
        for (name, expected) in [
            ("house.ply", "house.ply"),
            ("town.ply", "town (2).ply"),
            ("town", "town (2)"),
            ("tower.obj", "tower (2).obj"),
        ] {
            assert_eq!(free_name(name, &taken), expected);
        }
    }
}

//! Facts about the loaded files that a page offers controls by.

use super::legend::hex;
use super::rows::Rows;
use serde_json::{Value, json};
use std::path::PathBuf;
use surfel::SceneDescription;
use surfel::crs::{Unit, short_name};
use surfel::description::{CameraSettings, write_table};
use surfel::file_names::{file_name, list_files};
use surfel::resolve::{LoadedScene, coordinate_system, coordinate_system_text, located_stations};
use surfel_core::image::{class_color, class_name};
use surfel_core::math::Vec3;
use surfel_core::points::{NOISE_CLASSES, PointCloud, PointFilter};
use surfel_core::scene::color::ColorSource;
use surfel_core::surface::SurfaceKind;
use surfel_core::words::counted;
use surfel_formats::{FileInfo, common_file_info};

/// The names of the files that were typed, without their folders, which a page need not know. Without files: those of the
/// rows, with the numbers of points and triangles, which tell them from others of these names.
pub fn name(typed: &[PathBuf], rows: &Rows, (n_points, n_triangles): (usize, usize)) -> String {
    if !typed.is_empty() {
        return list_files(&typed.iter().map(|file| file_name(file).into()).collect::<Vec<_>>());
    }
    let names: Vec<PathBuf> = rows.names().into_iter().map(PathBuf::from).collect();
    let sizes = [(n_points, "point"), (n_triangles, "triangle")].into_iter();
    let sizes = sizes.filter(|(n, _)| 0 < *n).map(|(n, thing)| counted(n, thing));
    format!("{} ({})", list_files(&names), sizes.collect::<Vec<_>>().join(", "))
}

/// Columns by which all clouds can be coloured.
pub fn colors(scene: &LoadedScene) -> Vec<&str> {
    let mut clouds = scene.clouds().map(|(_, cloud)| columns(cloud));
    let mut names = clouds.next().unwrap_or_default();
    clouds.for_each(|others| names.retain(|name| others.contains(name)));
    names.extend(ColorSource::names_where(ColorSource::is_computed));
    names
}

/// Columns of a cloud as `--color` takes them.
pub fn columns(cloud: &PointCloud) -> Vec<&str> {
    let is_column = |source: &ColorSource| !source.is_computed() && source.is_available_in(cloud);
    let mut names = ColorSource::names_where(is_column);
    let scalars = cloud.scalars.iter().map(|scalar| scalar.name.as_str());
    // A column `class` of labels is among the usual names.
    let others: Vec<&str> = scalars.filter(|name| !names.contains(name)).collect();
    names.extend(others);
    names
}

/// The name of the coordinate system, and its horizontal EPSG code.
pub fn coordinate_system_facts(
    scene: &LoadedScene,
    startup: &SceneDescription,
) -> (Option<String>, Option<u16>) {
    let name = coordinate_system_text(scene, startup).map(|text| short_name(&text));
    let codes = coordinate_system(scene, startup).and_then(|system| system.epsg());
    (name, codes.map(|codes| codes.horizontal))
}

/// The symbol of the unit of lengths, if the coordinate system tells it.
pub fn unit_symbol(scene: &LoadedScene, startup: &SceneDescription) -> Option<&'static str> {
    let unit = coordinate_system(scene, startup)?.unit();
    matches!(unit, Unit::Metres(_)).then(|| unit.symbol())
}

/// The stations of all scans by name, with the cameras that look from there.
pub fn stations(scene: &LoadedScene, up: Vec3) -> Vec<Value> {
    let stations = located_stations(scene).into_iter().filter_map(|station| {
        let camera = CameraSettings::of(&station.view(up)?.camera(up, None));
        Some(json!({ "name": station.name, "camera": write_table(&camera) }))
    });
    stations.collect()
}

/// The classes of all clouds with their names, colours and numbers of points. Those of noise are hidden by default where
/// others are shown.
pub fn classes(scene: &LoadedScene) -> Vec<Value> {
    let mut counts = [0u64; 256];
    let mut hides_noise = false;
    let is_noise = |class: &u8| NOISE_CLASSES.contains(class);
    for classes in scene.clouds().filter_map(|(_, cloud)| cloud.classification.as_ref()) {
        classes.iter().for_each(|class| counts[usize::from(*class)] += 1);
        hides_noise |= !classes.iter().all(is_noise);
    }
    let found = (0..=u8::MAX).zip(counts).filter(|(_, count)| 0 < *count);
    let described = found.map(|(class, count)| {
        let name = format!("{class} {}", class_name(class));
        let is_hidden = hides_noise && is_noise(&class);
        let color = hex(class_color(class));
        json!({ "class": class, "name": name, "color": color, "points": count, "is_hidden": is_hidden })
    });
    described.collect()
}

/// The columns that all files with points have.
pub fn filter_columns(scene: &LoadedScene) -> Vec<String> {
    let files = scene.read_files.iter().zip(&scene.file_infos);
    let of_points = files.filter(|(file, _)| 0 < file.n_points).map(|(_, info)| info.clone());
    common_file_info(&of_points.collect::<Vec<FileInfo>>()).columns
}

/// Returns the names of the surfaces that the scene can have: only trained splats are Gaussians.
pub fn surfaces(scene: &LoadedScene) -> Vec<&'static str> {
    let has_splats = scene.clouds().any(|(_, cloud)| cloud.has_gaussians());
    let kinds = SurfaceKind::ALL.iter();
    kinds
        .filter(|(_, kind)| has_splats || *kind != SurfaceKind::Gaussian)
        .map(|(name, _)| *name)
        .collect()
}

/// Returns true if all clouds tell the returns of each pulse.
pub fn has_returns(scene: &LoadedScene) -> bool {
    let filter: PointFilter =
        "return_number <= number_of_returns".parse().expect("the condition is valid");
    let mut clouds = scene.clouds().map(|(_, cloud)| cloud).peekable();
    // Fails for missing columns, also without points.
    let has_returns = |cloud: &PointCloud| filter.matches(cloud, cloud.len()).is_ok();
    clouds.peek().is_some() && clouds.all(has_returns)
}

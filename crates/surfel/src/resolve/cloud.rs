//! A cloud on its way from the file to a surface: read, prepared, coloured.

use super::crop_hints::outside_hint;
use crate::crs::{is_in_degrees, move_to_metres, report_degrees};
use crate::description::{Invalid, ObjectSettings, PreparationSettings, with_nearest};
use crate::error::{Error, Result};
use crate::memory_files::{MemoryContent, MemoryFiles};
use crate::progress_log::NotesAsChoices;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use surfel_core::math::{DAffine3, Vec3};
use surfel_core::points::neighbors::Neighborhood;
use surfel_core::points::{
    PointCloud, PointFilter, PreparationReport, PreparedCloud, Radius, STRUCTURE,
    SURFACE_VARIATION, prepare,
};
use surfel_core::progress::Progress;
use surfel_core::scene::color::{ColorSource, choose_source, colorize};
use surfel_core::scene::{CloudGeometry, Geometry, Graph, Material, PART, Transform};
use surfel_core::surface::SurfaceKind;
use surfel_core::words::counted;
use surfel_formats::{ColumnChoice, FileInfo, Loaded};

/// The columns that the surface gaussian needs, in words.
const GAUSSIANS: &str = "columns of trained splats (f_dc_0, opacity, scale_0, rot_0 and so on), which the surface gaussian needs";

/// Options of reading besides an object's settings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Keeps all columns of clouds; otherwise only those that the picture needs.
    pub keeps_all_columns: bool,
    /// Decides what a random subsample keeps.
    pub seed: u64,
    /// Files that are in memory instead.
    pub memory: MemoryFiles,
    /// Coordinate system of a file that was read before, to which degrees are moved.
    pub coordinate_system: Option<String>,
    /// Coordinate system of the description: that of coordinates in degrees, or the one to which they are moved.
    pub crs: Option<String>,
}

/// Reads what a file holds.
pub fn import(
    file: &Path,
    settings: &ObjectSettings,
    options: &ImportOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    let content = options.memory.get(file);
    let mut loaded = match content {
        Some(content) => import_from_memory(content, settings, options, progress)?,
        None => import_from_file(file, settings, options, progress)?,
    };
    for geometry in &mut loaded.0.geometries {
        if let Geometry::Points(cloud) = geometry {
            cloud.scalars.retain(|scalar| scalar.name != PART);
        }
    }
    match content {
        // Rays that meet them are in their coordinates.
        Some(MemoryContent::Points(cloud, _)) => report_degrees(cloud, &loaded.1, &[], progress),
        _ if settings.preparation.reproject != Some(false) => {
            return with_metres(loaded, options, progress);
        }
        _ => {}
    }
    Ok(loaded)
}

fn import_from_file(
    file: &Path,
    settings: &ObjectSettings,
    options: &ImportOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    let columns = if options.keeps_all_columns { ColumnChoice::All } else { settings.columns() };
    let mut load_options = settings.preparation.load_options(columns)?;
    if options.keeps_all_columns {
        // All points stay too: the filter may change, and is applied when they are prepared.
        load_options.filter = None;
    }
    let loaded = if settings.preparation.vertices() {
        surfel_formats::load(file, &load_options, progress)
            .map(|Loaded { cloud, info }| (graph_of(cloud), info))
    } else {
        surfel_formats::load_graph(file, &load_options, progress)
    };
    let loaded = loaded.map_err(|error| reading_error(file, error, &settings.preparation))?;
    progress.end();
    Ok(loaded)
}

/// Moves a cloud in degrees of longitude and latitude to metres; everything else stays as it is.
fn with_metres(
    (mut graph, mut info): (Graph<PointCloud>, FileInfo),
    options: &ImportOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    if let [Geometry::Points(cloud)] = &mut graph.geometries[..] {
        let mut target = options.coordinate_system.as_deref();
        if let Some(crs) = &options.crs {
            let stated = FileInfo { coordinate_system: Some(crs.clone()), ..info.clone() };
            if is_in_degrees(cloud, &stated) {
                info = stated;
            } else {
                target = Some(crs);
            }
        }
        move_to_metres(cloud, &mut info, target, progress)?;
    }
    Ok((graph, info))
}

/// Takes content in memory as if a file held it.
fn import_from_memory(
    content: &MemoryContent,
    settings: &ObjectSettings,
    options: &ImportOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    let mut graph = content.to_graph();
    if !options.keeps_all_columns {
        let file_from_geometries = graph.world_from_geometries();
        for (geometry, file_from_cloud) in graph.geometries.iter_mut().zip(&file_from_geometries) {
            if let Geometry::Points(cloud) = geometry {
                let all = std::mem::take(cloud);
                *cloud = filter_cloud(all, file_from_cloud, &settings.preparation, progress)?;
            }
        }
    }
    Ok((graph, content.info()))
}

/// A graph of one cloud.
pub fn graph_of(cloud: PointCloud) -> Graph<PointCloud> {
    Graph::from_geometry(Geometry::Points(cloud), Material::MATTE)
}

/// Returns the cloud of a graph that holds nothing else, or the graph.
pub fn into_cloud(
    mut graph: Graph<PointCloud>,
) -> std::result::Result<PointCloud, Box<Graph<PointCloud>>> {
    let is_identity = matches!(&graph.nodes[..], [node] if node.transform == Transform::IDENTITY);
    let is_cloud = matches!(graph.geometries[..], [Geometry::Points(_)]);
    if !is_cloud || !is_identity {
        return Err(Box::new(graph));
    }
    match graph.geometries.pop() {
        Some(Geometry::Points(cloud)) => Ok(cloud),
        _ => Err(Box::new(graph)),
    }
}

/// Drops the points of a cloud that the settings do not keep. Filters see the coordinates of the file.
///
/// # Errors
///
/// Fails if the cloud lacks a column of a filter, and if a filter keeps no point.
pub fn filter_cloud(
    mut cloud: PointCloud,
    file_from_cloud: &DAffine3,
    settings: &PreparationSettings,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    if let Some(kept) = kept_points(&cloud, file_from_cloud, settings, progress)? {
        cloud.retain_from(0, &kept);
    }
    Ok(cloud)
}

/// Returns a copy of the points of a cloud that the settings keep. Nothing else of it is copied. Filters see the coordinates
/// of the file.
///
/// # Errors
///
/// Fails as [`filter_cloud`] does.
pub fn filtered_copy(
    cloud: &PointCloud,
    file_from_cloud: &DAffine3,
    settings: &PreparationSettings,
    progress: &dyn Progress,
) -> Result<PointCloud> {
    let Some(kept) = kept_points(cloud, file_from_cloud, settings, progress)? else {
        return Ok(cloud.clone());
    };
    let indices: Vec<u32> =
        (0..).zip(kept).filter_map(|(i, is_kept)| is_kept.then_some(i)).collect();
    Ok(cloud.subset(&indices))
}

/// Returns for each point whether the settings keep it, and reports how many they keep; `None` if they have no filter.
fn kept_points(
    cloud: &PointCloud,
    file_from_cloud: &DAffine3,
    settings: &PreparationSettings,
    progress: &dyn Progress,
) -> Result<Option<Vec<bool>>> {
    let filters = settings.point_filters()?;
    if filters.is_empty() {
        return Ok(None);
    }
    let cloud = in_file(cloud, file_from_cloud);
    let (mut kept, mut n_kept) = (vec![true; cloud.len()], cloud.len());
    for (key, filter) in filters {
        let matches = filter.matches(&cloud, 0);
        let matches = matches.map_err(|error| Invalid::at(key, with_nearest(&error)))?;
        kept.iter_mut().zip(matches).for_each(|(is_kept, matches)| *is_kept &= matches);
        let points = counted(n_kept, "point");
        n_kept = kept.iter().filter(|is_kept| **is_kept).count();
        progress.note(&format!("{n_kept} of {points} meet {}", filter.describe()));
        if n_kept == 0 {
            return Err(no_point_kept(&[], Some(key), &filter, String::new()));
        }
    }
    Ok(Some(kept))
}

fn no_point_kept(
    files: &[PathBuf],
    key: Option<&'static str>,
    filter: &PointFilter,
    hint: String,
) -> Error {
    Error::NoPointKept { files: files.to_vec(), key, filter: filter.to_string(), hint }
}

/// Returns the error of a file that was read under settings; that of a filter names the file, and the setting that it is
/// of.
pub fn reading_error(
    file: &Path,
    error: surfel_formats::Error,
    settings: &PreparationSettings,
) -> Error {
    let surfel_formats::Error::Core(cause @ surfel_core::Error::UnknownName { found, .. }) = &error
    else {
        return error.into();
    };
    let filters = settings.point_filters().unwrap_or_default();
    let mut filters = filters.into_iter();
    let text = format!("{}: {}", file.display(), with_nearest(cause));
    match filters.find(|(_, filter)| filter.columns().contains(&found.as_str())) {
        Some((key, _)) => Error::Unfit(format!("{text} [{key}]")),
        None => Error::Unfit(text),
    }
}

/// Returns a cloud in the coordinates of its file: those of a node may be others.
fn in_file<'c>(cloud: &'c PointCloud, file_from_cloud: &DAffine3) -> Cow<'c, PointCloud> {
    if *file_from_cloud == DAffine3::IDENTITY {
        return Cow::Borrowed(cloud);
    }
    let mut moved = cloud.clone();
    moved.transform(file_from_cloud);
    Cow::Owned(moved)
}

/// Reports the filter of settings with which files gave no point.
///
/// # Errors
///
/// Fails if there is a filter.
pub fn check_empty(files: &[PathBuf], settings: &PreparationSettings) -> Result<()> {
    let Some(filter) = settings.point_filter()? else { return Ok(()) };
    let keys: Vec<&str> = settings.point_filters()?.into_iter().map(|(key, _)| key).collect();
    let key = if let [key] = keys[..] { Some(key) } else { None };
    Err(no_point_kept(files, key, &filter, outside_hint(settings.crop.as_ref(), files)))
}

/// Returns true if a cloud has the values of a colour source, or gets them when it is prepared.
pub fn can_be_colored(cloud: &PointCloud, color: &ColorSource) -> bool {
    let is_computed = match color {
        ColorSource::Normal => true,
        ColorSource::Column(name) => [SURFACE_VARIATION, STRUCTURE].contains(&name.as_str()),
        _ => false,
    };
    is_computed || color.is_available_in(cloud)
}

/// Cleans a cloud, and adds the normals and radii that are missing.
///
/// # Errors
///
/// Fails for a cloud without points, and if cancelled.
pub fn prepare_cloud(
    cloud: PointCloud,
    settings: &ObjectSettings,
    seed: u64,
    progress: &dyn Progress,
) -> surfel_core::Result<PreparedCloud> {
    let (cloud, report) = prepare(cloud, &settings.preparation(seed), progress)?;
    progress.end();
    report_prepared(&report, cloud.normals.is_some(), settings, progress);
    Ok(cloud)
}

/// Gives a prepared cloud its surface and colours. Elevations count along `up`.
pub fn apply_surface_and_color(
    mut cloud: PreparedCloud,
    settings: &ObjectSettings,
    up: Vec3,
    progress: &dyn Progress,
) -> surfel_core::Result<CloudGeometry> {
    cloud.scale_radii(settings.surface.radius_scale() as f32);
    let surface = surface_of(&cloud, settings);
    if surface == SurfaceKind::Gaussian {
        return gaussian_geometry(cloud, settings, up, progress);
    }
    if let Some(indices) = cloud.disc_indices() {
        cloud = cloud.subset(&indices);
    }
    let notes = NotesAsChoices { progress, keys: &["color", "cmap", "range", "gamma"] };
    let coloring = settings.coloring(up);
    let colors = colorize(&cloud, &coloring, &notes)?;
    let source = settings.color.color.clone().unwrap_or_else(|| choose_source(&cloud).0);
    let blends_colors = !source.is_categorical(&cloud);
    let mut geometry = CloudGeometry::new(cloud, colors)?;
    geometry.surface = surface;
    geometry.options = settings.surface.options();
    geometry.blends_colors = blends_colors;
    geometry.support_colors = coloring.support_colors();
    geometry.edge_test = settings.surface.edge_test();
    geometry.octree_depth = settings.surface.octree_depth();
    state_known_sides(&mut geometry, &settings.preparation);
    Ok(geometry)
}

/// Tells a geometry whether the normals of its points tell the sides of the surface.
pub fn state_known_sides(geometry: &mut CloudGeometry, settings: &PreparationSettings) {
    let has_stations = geometry.cloud().has_stations();
    let has_normals = geometry.cloud().normals.is_some();
    geometry.has_outward_normals = settings.orients_outward();
    geometry.has_front_sides = has_normals && settings.knows_front_sides(has_stations);
}

/// Returns the surface of a cloud: that of the settings, or what suits its columns.
pub(super) fn surface_of(cloud: &PointCloud, settings: &ObjectSettings) -> SurfaceKind {
    match settings.surface.surface {
        None if cloud.has_gaussians() => SurfaceKind::Gaussian,
        _ => settings.surface.surface(),
    }
}

/// Makes Gaussians of a prepared cloud, with the colours that they were trained with unless others are asked for.
fn gaussian_geometry(
    cloud: PreparedCloud,
    settings: &ObjectSettings,
    up: Vec3,
    progress: &dyn Progress,
) -> surfel_core::Result<CloudGeometry> {
    if !cloud.has_gaussians() {
        return Err(surfel_core::Error::MissingColumn { column: GAUSSIANS });
    }
    let is_trained = matches!(settings.color.color, None | Some(ColorSource::Rgb));
    let shows_trained_colors = is_trained && settings.color.gamma.is_none();
    let notes = NotesAsChoices { progress, keys: &["color", "cmap", "range", "gamma"] };
    let mut coloring = settings.coloring(up);
    if shows_trained_colors {
        notes.note("colors as trained: lights and materials do not change them");
        // Dark colours stay as they were trained.
        coloring.gamma = Some(1.0);
    }
    let colors = colorize(&cloud, &coloring, &notes)?;
    let mut geometry = CloudGeometry::new(cloud, colors)?;
    geometry.surface = SurfaceKind::Gaussian;
    geometry.shows_trained_colors = shows_trained_colors;
    Ok(geometry)
}

/// Reports where normals and radii come from, of a cloud that has normals or none.
pub fn report_prepared(
    report: &PreparationReport,
    has_normals: bool,
    settings: &ObjectSettings,
    progress: &dyn Progress,
) {
    report_denoise(report, progress);
    if report.normals.is_none() {
        let line = match has_normals {
            true => "normals as in the file",
            false => "no normals: the surface needs none",
        };
        progress.choice(line, &["normals_k"]);
    }
    report_normals(report, progress);
    if report.radii.is_none() {
        report_scaled_radii("radii as in the file", settings, progress);
    }
    report_radii(report, settings, progress);
    if let Some(structure) = &report.structure {
        progress.choice(&structure.line(), &["structure"]);
    }
}

/// Reports how far points were moved onto their surface.
pub fn report_denoise(report: &PreparationReport, progress: &dyn Progress) {
    if let Some(denoise) = &report.denoise {
        progress.choice(&denoise.line(), &["denoise"]);
    }
    if let Some(lines) = &report.lines {
        progress.choice(&lines.line(), &["denoise"]);
    }
}

/// Reports how normals were estimated.
pub fn report_normals(report: &PreparationReport, progress: &dyn Progress) {
    // Those of points without a plane are reported as repairs.
    let normals = report.normals.as_ref().filter(|normals| 0 < normals.n_estimated);
    if let (Some(normals), Some(neighborhood)) = (normals, report.normals_from) {
        let key = match neighborhood {
            Neighborhood::Nearest(_) => "normals_k",
            Neighborhood::Within(_) => "normals_radius",
        };
        let there_are = report.n_points.saturating_sub(1);
        let neighborhood = match neighborhood {
            Neighborhood::Nearest(k) => Neighborhood::Nearest(k.min(there_are)),
            within => within,
        };
        progress.choice(&normals.line(neighborhood), &[key]);
    }
}

/// Reports how radii were chosen, unless the settings give a number.
pub fn report_radii(
    report: &PreparationReport,
    settings: &ObjectSettings,
    progress: &dyn Progress,
) {
    let there_are = report.n_points.saturating_sub(1);
    let radius = match settings.preparation.radius.unwrap_or_default() {
        Radius::Adaptive { k } => Radius::Adaptive { k: k.min(there_are) },
        Radius::Curvature { k } => Radius::Curvature { k: k.min(there_are) },
        other => other,
    };
    let is_single = report.n_points == 1;
    if let (Some(radii), false) = (&report.radii, is_single || matches!(radius, Radius::Fixed(_))) {
        report_scaled_radii(&radii.line(radius), settings, progress);
    }
}

/// Reports radii, and the factor by which the settings multiply them.
fn report_scaled_radii(line: &str, settings: &ObjectSettings, progress: &dyn Progress) {
    match settings.surface.radius_scale() {
        1.0 => progress.choice(line, &["radius"]),
        factor => progress
            .choice(&format!("{line}; all multiplied by {factor}"), &["radius", "radius_scale"]),
    }
}

#[cfg(test)]
mod tests {
    //! Degrees of files in memory are moved, those of arrays are reported.

    use super::*;
    use crate::memory_files::FileContent;
    use crate::progress_log::ProgressLog;
    use std::sync::Arc;
    use surfel_core::math::DVec3;
    use surfel_core::progress::NoProgress;

    #[test]
    fn files_in_memory_are_moved_to_metres_and_arrays_stay() {
        let position = |i: i32| Vec3::new(1e-4 * (i % 30) as f32, 1e-4 * (i / 30) as f32, i as f32);
        let mut cloud = PointCloud::from_positions((0..900).map(position).collect());
        cloud.origin = DVec3::new(11.57, 48.13, 520.0);
        let file = FileContent { graph: graph_of(cloud.clone()), info: FileInfo::default() };
        let contents =
            [MemoryContent::File(Arc::new(file)), MemoryContent::Points(Arc::new(cloud), None)];
        let origins_and_warnings = contents.map(|content| {
            let mut options = ImportOptions::default();
            options.memory.insert("scan", content);
            let log = ProgressLog::new(&NoProgress);
            let settings = ObjectSettings::default();
            let (graph, _) = import(Path::new("scan"), &settings, &options, &log).unwrap();
            let origin = into_cloud(graph).unwrap().origin;
            (origin.y, log.into_records().warnings.len())
        });
        assert!(5e6 < origins_and_warnings[0].0 && origins_and_warnings[0].1 == 0);
        assert_eq!(origins_and_warnings[1], (48.13, 1));
    }
}

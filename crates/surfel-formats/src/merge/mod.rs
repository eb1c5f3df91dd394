//! Merges the clouds of several files.

mod precision;

use std::path::PathBuf;

use surfel_core::points::merge;
use surfel_core::progress::Progress;

use self::precision::CloudPrecision;
use crate::las::common_profile;
use crate::options::{FileInfo, LasProfile, Loaded};

/// Merges the clouds of several files into one, relative to the origin of the largest.
///
/// Columns that some of the files lack are dropped. `progress` gets a note of these, and of files whose points lie too
/// far from the common origin to keep their resolution, and a warning of coordinate systems that differ.
pub fn merge_loaded(mut parts: Vec<Loaded>, paths: &[PathBuf], progress: &dyn Progress) -> Loaded {
    if parts.len() < 2 {
        return parts.pop().unwrap_or_default();
    }
    let infos: Vec<FileInfo> = parts.iter().map(|part| part.info.clone()).collect();
    let precisions: Vec<CloudPrecision> =
        parts.iter().map(|Loaded { cloud, info }| CloudPrecision::new(cloud, info)).collect();
    let (cloud, dropped) = merge(parts.into_iter().map(|part| part.cloud).collect());
    if !dropped.is_empty() {
        progress.note(&format!("not in all files, dropped: {}", dropped.join(", ")));
    }
    for ((path, precision), info) in paths.iter().zip(&precisions).zip(&infos) {
        if let Some(loss) = precision.loss_about_origin(cloud.origin) {
            progress.note(&format!("{}: {loss}", path.display()));
        }
        if info.coordinate_system != infos[0].coordinate_system {
            let line = format!(
                "{}: its coordinate system differs from that of {}, or only one of them names it",
                path.display(),
                paths[0].display()
            );
            progress.warning(&line, &[]);
        }
    }
    Loaded { cloud, info: common_file_info(&infos) }
}

/// Returns the information that holds for all files together: sums of counts, and what they have in common.
pub fn common_file_info(infos: &[FileInfo]) -> FileInfo {
    let Some(first) = infos.first() else { return FileInfo::default() };
    let mut formats: Vec<&str> = infos.iter().map(|info| info.format.as_str()).collect();
    formats.dedup();
    let same_system = infos.iter().all(|info| info.coordinate_system == first.coordinate_system);
    FileInfo {
        format: formats.join("; "),
        n_points: infos.iter().map(|info| info.n_points).sum(),
        n_triangles: infos.iter().map(|info| info.n_triangles).sum(),
        bounds: infos
            .iter()
            .map(|info| info.bounds)
            .reduce(|a, b| a.zip(b).map(|([a, b], [c, d])| [a.min(c), b.max(d)]))
            .flatten(),
        resolution: infos
            .iter()
            .map(|info| info.resolution)
            .reduce(|a, b| Some(a?.min(b?)))
            .flatten(),
        coordinate_system: first.coordinate_system.clone().filter(|_| same_system),
        is_in_metres: infos.iter().all(|info| info.is_in_metres),
        las: common_las_profile(infos, same_system),
        columns: first
            .columns
            .iter()
            .filter(|name| infos.iter().all(|info| info.columns.contains(name)))
            .cloned()
            .collect(),
        harmonics_degree: infos
            .iter()
            .map(|info| info.harmonics_degree)
            .reduce(|a, b| a.max(b))
            .flatten(),
        images: infos.iter().flat_map(|info| info.images.clone()).collect(),
        external_files: infos.iter().flat_map(|info| info.external_files.clone()).collect(),
    }
}

/// Returns the properties that a LAS file of all points keeps; none if some of the files are no LAS.
fn common_las_profile(infos: &[FileInfo], same_system: bool) -> Option<LasProfile> {
    let profiles: Option<Vec<&LasProfile>> = infos.iter().map(|info| info.las.as_ref()).collect();
    let (first, others) =
        profiles?.split_first().map(|(first, others)| ((*first).clone(), others.to_vec()))?;
    let common = others.into_iter().fold(first, common_profile);
    let projection = if same_system { common.projection } else { Vec::new() };
    Some(LasProfile { projection, ..common })
}

//! Writes clouds, in the format that the extension of the name gives.

use std::path::Path;
use std::sync::LazyLock;

use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;
use surfel_core::words::counted;

use crate::error::Result;
use crate::file::{check_output_path, extension, unsupported_extension};
use crate::format::{CloudWriter, FORMATS, list_extensions};
use crate::options::SaveOptions;

static ADVICE: LazyLock<String> =
    LazyLock::new(|| format!("surfel writes clouds as {}", writable_extensions("and")));

/// Writes `cloud` to `path`, whose extension gives the format.
///
/// # Errors
///
/// Fails if the extension is none of [`writable_extensions`], if the format cannot hold the cloud, if the file cannot
/// be written, or if the work is cancelled. A failed write leaves no file, and an old file in its place stays.
pub fn save(
    path: &Path,
    cloud: &PointCloud,
    options: &SaveOptions,
    progress: &dyn Progress,
) -> Result<()> {
    progress.check()?;
    let writer = find_writer(path)?;
    check_output_path(path)?;
    if !writer.keeps_stations && !cloud.stations.is_empty() {
        let keeping = writers().filter(|writer| writer.keeps_stations);
        let keeping = list_extensions(keeping.flat_map(|writer| writer.extensions), "and");
        let stations = counted(cloud.stations.len(), "station");
        let line = format!(
            "{}: name and pose of {stations} are lost; files that keep them: {keeping}",
            path.display()
        );
        progress.warning(&line, &[]);
    }
    (writer.write)(path, cloud, options, progress)
}

/// Checks before any work that a cloud can be written to `path`.
///
/// # Errors
///
/// Fails if the extension is none of [`writable_extensions`], or for the reasons of [`check_output_path`].
pub fn check_cloud_output(path: &Path) -> Result<()> {
    find_writer(path)?;
    check_output_path(path)
}

/// Returns the extensions of the clouds that surfel writes as a list in words, as in ".ply, .las or .laz".
pub fn writable_extensions(conjunction: &str) -> String {
    list_extensions(writers().flat_map(|writer| writer.extensions), conjunction)
}

fn writers() -> impl Iterator<Item = &'static CloudWriter> {
    FORMATS.iter().filter_map(|format| format.writer.as_ref())
}

fn find_writer(path: &Path) -> Result<&'static CloudWriter> {
    let extension = extension(path);
    let writer = writers().find(|writer| writer.extensions.contains(&&*extension));
    writer.ok_or_else(|| unsupported_extension(path, &ADVICE))
}

//! Writes clouds, in the format that the extension of the name gives.

use std::path::Path;

use surfel_core::points::PointCloud;
use surfel_core::progress::Progress;

use crate::error::Result;
use crate::file::{check_output, extension, unsupported_extension};
use crate::las;
use crate::options::SaveOptions;
use crate::ply;

const SUPPORTED: &str = "surfel writes clouds as .ply, .las and .laz";

/// Writes `cloud` to `path`, whose extension gives the format: .ply, .las or .laz.
///
/// # Errors
/// Fails if the extension is none of these, if the format cannot hold the cloud, if the file cannot be written, or
/// if the work is cancelled. A failed write leaves no file, and an old file in its place stays.
pub fn save(
    path: &Path,
    cloud: &PointCloud,
    options: &SaveOptions,
    progress: &dyn Progress,
) -> Result<()> {
    progress.check()?;
    check_output(path)?;
    match extension(path).as_str() {
        "ply" => ply::write(path, cloud, progress),
        "las" | "laz" => las::write(path, cloud, options, progress),
        _ => Err(unsupported_extension(path, SUPPORTED)),
    }
}

//! Writes clouds, in the format that the extension of the name says.

use std::path::Path;

use surfel::math::DVec3;
use surfel::points::PointCloud;
use surfel::progress::Progress;

use crate::atomic::{folder_of, write_failed};
use crate::error::{Error, Result};
use crate::{las, ply};

/// What a cloud itself does not know of the file it came from.
#[derive(Clone, Debug, Default)]
pub struct SaveOptions {
    /// Step between coordinates in LAS and LAZ; chosen from the cloud's size if absent.
    pub resolution: Option<DVec3>,
    /// WKT or "EPSG:" and a code, kept by LAS and LAZ.
    pub coordinate_system: Option<String>,
}

const CLOUDS: &str = "surfel writes clouds as .ply, .las and .laz";
const ANY: &str = "surfel writes pictures as .png and .exr, clouds as .ply, .las and .laz";

/// Writes `cloud` to `path`, whose extension says the format: .ply, .las or .laz.
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
        _ => Err(unsupported(path, CLOUDS)),
    }
}

/// Tells early whether an output of this name can be written: its format is known, its folder exists.
pub fn check_output(path: &Path) -> Result<()> {
    if path == Path::new("-") {
        return Ok(());
    }
    if !["png", "exr", "ply", "las", "laz"].contains(&extension(path).as_str()) {
        return Err(unsupported(path, ANY));
    }
    check_place(path)
}

/// Tells whether a file can stand at `path`: its folder exists, and no folder has its name.
pub fn check_place(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    let problem = if path.is_dir() {
        std::io::ErrorKind::IsADirectory
    } else if !folder.exists() {
        std::io::ErrorKind::NotFound
    } else if !folder.is_dir() {
        std::io::ErrorKind::NotADirectory
    } else {
        return Ok(());
    };
    Err(write_failed(path, problem.into()))
}

/// The lower-case extension, without the dot.
pub(crate) fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

pub(crate) fn unsupported(path: &Path, advice: &'static str) -> Error {
    let found = match extension(path).as_str() {
        "" => "a name without extension".into(),
        extension => format!("the extension `.{extension}`"),
    };
    Error::Unsupported { file: path.display().to_string(), action: "write", found, advice }
}

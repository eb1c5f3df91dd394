//! Reads files of any format as point clouds.

use std::path::{Path, PathBuf};

use surfel_core::progress::Progress;

use crate::error::{Error, Result};
use crate::file::{Input, ResourceResolver};
use crate::filtered::{filter_loaded, read_filtered};
use crate::format::{Reader, detect};
use crate::gltf;
use crate::merge::merge_loaded;
use crate::options::{FileInfo, LoadOptions, Loaded};

/// Reads the points of a file: of a mesh its vertices, of a glTF scene its points and vertices at their places in the
/// world.
///
/// # Errors
///
/// Fails if the file cannot be read, if its format is not supported or broken, if its points do not fit in memory,
/// or if the work is cancelled.
pub fn load(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    read_points(&Input::open(path)?, ResourceResolver::for_file(path), options, progress)
}

/// Reads points from the bytes of a file. `name` is its name in messages, and its extension gives the format of bytes
/// without a signature.
///
/// # Errors
///
/// Fails for the reasons of [`load`], and if the bytes name further files that hold points.
pub fn load_bytes(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    read_points(&Input::from_bytes(name, bytes), ResourceResolver::none(), options, progress)
}

/// Reads several files to one cloud, relative to the origin of the largest, and returns information about each.
///
/// # Errors
///
/// Fails for the reasons of [`load`], and if `paths` is empty.
pub fn load_all(
    paths: &[PathBuf],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Loaded, Vec<FileInfo>)> {
    let parts =
        paths.iter().map(|path| load(path, options, progress)).collect::<Result<Vec<_>>>()?;
    let infos: Vec<FileInfo> = parts.iter().map(|part| part.info.clone()).collect();
    if parts.is_empty() {
        return Err(Error::NoInput);
    }
    Ok((merge_loaded(parts, paths, progress), infos))
}

/// Reads the information that a file states about itself, without its points.
///
/// # Errors
///
/// Fails if the file cannot be read, or if its format is not supported or its header broken.
pub fn inspect(path: &Path) -> Result<FileInfo> {
    let input = Input::open(path)?;
    (detect(&input)?.inspect)(&input)
}

/// Reads the information that the bytes of a file state about it, without its points. `name` is its name in messages, and
/// its extension gives the format of bytes without a signature.
///
/// # Errors
///
/// Fails if the format is not supported or the header broken.
pub fn inspect_bytes(name: &str, bytes: &[u8]) -> Result<FileInfo> {
    let input = Input::from_bytes(name, bytes);
    (detect(&input)?.inspect)(&input)
}

fn read_points(
    input: &Input,
    resolver: ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    progress.check()?;
    match &detect(input)?.read {
        Reader::Points(read_points) | Reader::Mesh { read_points, .. } => {
            read_filtered(*read_points, input, options, progress)
        }
        Reader::Scene(read) => {
            let scene = read(input, resolver, None, progress)?;
            let loaded = gltf::merge_points(input, scene, options.origin)?;
            filter_loaded(input, loaded, options, progress)
        }
    }
}

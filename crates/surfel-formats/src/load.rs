//! Opens files, finds out their format and reads them.

use std::path::{Path, PathBuf};

use surfel::points::merge;
use surfel::progress::Progress;

use crate::error::{Error, Place, Result};
use crate::extent::Extent;
use crate::input::Input;
use crate::options::{LoadOptions, Loaded, Source};
use crate::{bin, gltf, las, obj, ply, stl, text};

const SUPPORTED: &str = "surfel reads .ply, .las, .laz (.copc.laz too), .xyz, .txt, .csv, .asc, .pts, .obj, .stl, .gltf, .glb and .bin; \
     convert the file to one of them";

/// Reads the points of a file.
///
/// Of meshes and glTF scenes these are the vertices and the points, where the scene has them.
pub fn load(path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<Loaded> {
    let input = Input::open(path)?;
    if gltf::is_gltf(&input) {
        return Ok(gltf::points_of(gltf::load_gltf(path, progress)?));
    }
    read(&input, options, progress)
}

/// Reads points from the bytes of a file; `name` stands in messages, and its extension counts.
pub fn load_bytes(
    name: &str,
    bytes: &[u8],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    let input = Input::of_bytes(name, bytes);
    if gltf::is_gltf(&input) {
        return Ok(gltf::points_of(gltf::load_gltf_bytes(name, bytes, progress)?));
    }
    read(&input, options, progress)
}

/// Reads several files to one cloud about the origin of the largest; the sources are in their order.
pub fn load_all(
    paths: &[PathBuf],
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Loaded, Vec<Source>)> {
    let parts =
        paths.iter().map(|path| load(path, options, progress)).collect::<Result<Vec<_>>>()?;
    let sources: Vec<Source> = parts.iter().map(|part| part.source.clone()).collect();
    if parts.is_empty() {
        return Err(Error::NoInput);
    }
    Ok((merge_loaded(parts, paths, progress), sources))
}

/// Makes one cloud of those of several files, about the origin of the largest.
///
/// Columns that some of the files lack are dropped; `progress` is told which, and where the common
/// origin is too far from a file's points to keep their resolution.
pub fn merge_loaded(mut parts: Vec<Loaded>, paths: &[PathBuf], progress: &dyn Progress) -> Loaded {
    if parts.len() < 2 {
        return parts.pop().unwrap_or_default();
    }
    let sources: Vec<Source> = parts.iter().map(|part| part.source.clone()).collect();
    let extents: Vec<Extent> =
        parts.iter().map(|Loaded { cloud, source }| Extent::of(cloud, source)).collect();
    let (cloud, dropped) = merge(parts.into_iter().map(|part| part.cloud).collect());
    if !dropped.is_empty() {
        progress.note(&format!("not in all files, dropped: {}", dropped.join(", ")));
    }
    for ((path, extent), source) in paths.iter().zip(&extents).zip(&sources) {
        if let Some(loss) = extent.loss_about(cloud.origin) {
            progress.note(&format!("{}: {loss}", path.display()));
        }
        if source.coordinate_system != sources[0].coordinate_system {
            progress.note(&format!(
                "{}: its coordinate system differs from that of {}, or only one of them names it",
                path.display(),
                paths[0].display()
            ));
        }
    }
    Loaded { cloud, source: common_source(&sources) }
}

/// What a file says about itself, without reading its points.
pub fn inspect(path: &Path) -> Result<Source> {
    let input = Input::open(path)?;
    if gltf::is_gltf(&input) {
        return gltf::inspect(&input);
    }
    match format_of(&input)? {
        Format::Ply => ply::inspect(&input),
        Format::Las => las::inspect(&input),
        Format::Text => text::inspect(&input),
        Format::Obj => obj::inspect(&input),
        Format::Stl => stl::inspect(&input),
        Format::Bin => bin::inspect(&input),
    }
}

pub(crate) enum Format {
    Ply,
    Las,
    Text,
    Obj,
    Stl,
    Bin,
}

pub(crate) fn read(
    input: &Input,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Loaded> {
    progress.check()?;
    match format_of(input)? {
        Format::Ply => ply::read(input, options, progress),
        Format::Las => las::read(input, options, progress),
        Format::Text => text::read(input, options, progress),
        Format::Obj => obj::read(input, options, progress),
        Format::Stl => stl::read(input, options, progress),
        Format::Bin => bin::read(input, options, progress),
    }
}

/// By the first bytes, and where they say nothing by the extension.
pub(crate) fn format_of(input: &Input) -> Result<Format> {
    let starts = |magic: &[u8]| input.starts_with(magic);
    if input.is_empty() {
        let advice = "write the file again or copy it again from its source";
        return Err(input.malformed(Place::Byte(0), "an empty file", "points", advice));
    }
    if starts(ply::MAGIC) && input.get(3).is_some_and(u8::is_ascii_whitespace) {
        return Ok(Format::Ply);
    }
    if starts(las::MAGIC) {
        return Ok(Format::Las);
    }
    // Before the magics of other formats: a coordinate may begin with the two bytes of one.
    if input.extension() == "bin" {
        return Ok(Format::Bin);
    }
    let known = [
        (&b"ASTM-E57"[..], "an E57 file"),
        (b"# .PCD", "a PCD file"),
        (b"\x89HDF", "an HDF5 file"),
        (b"PK\x03\x04", "a zip archive"),
        (b"\x1f\x8b", "a gzip archive"),
    ];
    if let Some((_, found)) = known.iter().find(|(magic, _)| starts(magic)) {
        return Err(input.unsupported(*found, SUPPORTED));
    }
    let wrong_magic = |expected: &str| {
        let found = format!("`{}`", input[..input.len().min(4)].escape_ascii());
        let advice = "the extension does not fit the content; give the file its right one";
        Err(input.malformed(Place::Byte(0), found, expected, advice))
    };
    match input.extension().as_str() {
        "xyz" | "txt" | "csv" | "asc" | "pts" | "xyzrgb" | "xyzn" => Ok(Format::Text),
        "obj" => Ok(Format::Obj),
        "stl" => Ok(Format::Stl),
        "ply" => wrong_magic("`ply` and the end of the line"),
        "las" | "laz" => wrong_magic("`LASF`"),
        "" => Err(input.unsupported("a name without extension and unknown content", SUPPORTED)),
        other => Err(input.unsupported(format!("the extension `.{other}`"), SUPPORTED)),
    }
}

/// What holds for all the files together.
pub fn common_source(sources: &[Source]) -> Source {
    let Some(first) = sources.first() else { return Source::default() };
    let mut formats: Vec<&str> = sources.iter().map(|source| source.format.as_str()).collect();
    formats.dedup();
    let same_system =
        sources.iter().all(|source| source.coordinate_system == first.coordinate_system);
    Source {
        format: formats.join("; "),
        n_points: sources.iter().map(|source| source.n_points).sum(),
        n_triangles: sources.iter().map(|source| source.n_triangles).sum(),
        resolution: sources
            .iter()
            .map(|source| source.resolution)
            .reduce(|a, b| Some(a?.min(b?)))
            .flatten(),
        coordinate_system: first.coordinate_system.clone().filter(|_| same_system),
        columns: first
            .columns
            .iter()
            .filter(|name| sources.iter().all(|source| source.columns.contains(name)))
            .cloned()
            .collect(),
        beside: sources.iter().flat_map(|source| source.beside.clone()).collect(),
    }
}

//! Reads the meshes of OBJ files, one for each material.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use surfel_core::progress::Progress;
use surfel_core::scene::Material;

use super::build::Columns;
use super::lines::{line_end, split_keyword, words};
use super::mtl::{self, Mtl};
use super::parse::{Parsed, parse};
use super::textures::material_with_textures;
use crate::error::{Location, Result};
use crate::file::{Input, MissingFiles, ResourceResolver, file_key};
use crate::mesh::{Model, TextureLoader, repair_model};
use crate::options::{FileInfo, LoadOptions};
use crate::table::{TextChunk, line_at};

/// Returns true if the file has a face.
pub(crate) fn has_faces(input: &Input) -> bool {
    faces(input).next().is_some()
}

/// Returns the number of triangles of all faces, broken ones among them.
pub(super) fn count_triangles(input: &Input) -> u64 {
    faces(input).map(|corners| (words(corners).count() as u64).saturating_sub(2)).sum()
}

/// Returns the corners of each face as text.
fn faces<'a>(input: &'a Input) -> impl Iterator<Item = &'a [u8]> {
    let lines = TextChunk { text: input, start: 0 }.lines(line_end);
    lines.filter_map(|(_, line)| match split_keyword(line) {
        (b"f" | b"fo", corners) => Some(corners),
        _ => None,
    })
}

/// Reads the faces as meshes of triangles.
pub(crate) fn read_mesh(
    input: &Input,
    resolver: &ResourceResolver,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, FileInfo)> {
    let parsed = parse(input, progress)?;
    let location = parsed.first_polygon.map_or(Location::Byte(0), |at| line_at(input, at));
    let materials = read_libraries(&parsed.libraries, resolver, progress);
    let groups = polygons_by_material(input, &parsed, &materials, progress);
    let info = file_info(&parsed);

    let columns = Columns::new(parsed, options);
    let mut textures = TextureLoader::new(resolver);
    let mut model = Model::default();
    let mut n_short = 0;
    for (material, polygons) in groups {
        progress.check()?;
        let (mesh, n_short_here) = columns.mesh(&polygons);
        n_short += n_short_here;
        let material =
            material.map_or(Material::MATTE, |mtl| material_with_textures(mtl, &mut textures));
        model.parts.push((mesh, material));
    }
    textures.missing.report("a texture is left out", progress);
    model.textures = textures.textures;
    let (model, n_triangles) = repair_model(input, model, n_short, location, progress)?;
    Ok((model, FileInfo { n_triangles: Some(n_triangles), ..info }))
}

/// Returns the information that parsing has found.
fn file_info(parsed: &Parsed) -> FileInfo {
    let present = [
        (true, &["x", "y", "z"][..]),
        (!parsed.colors.is_empty(), &["red", "green", "blue"]),
        (!parsed.normals.is_empty(), &["nx", "ny", "nz"]),
        (!parsed.uvs.is_empty(), &["u", "v"]),
    ];
    let columns = present.iter().filter(|(is_present, _)| *is_present);
    FileInfo {
        format: "OBJ, mesh".into(),
        n_points: Some(parsed.positions.len() as u64),
        columns: columns.flat_map(|(_, names)| *names).map(|name| (*name).into()).collect(),
        ..FileInfo::default()
    }
}

/// Reads the materials of all MTL files, by name; the first of a name takes precedence.
fn read_libraries(
    libraries: &[String],
    resolver: &ResourceResolver,
    progress: &dyn Progress,
) -> HashMap<String, Mtl> {
    let mut materials = HashMap::new();
    let mut missing = MissingFiles::default();
    let mut files = HashSet::new();
    let mut read = |name: &str| {
        let path = resolver.find(name)?;
        let library = Input::open(&path).map_err(|error| error.to_string())?;
        // A library that has several names is read once.
        if !files.insert(file_key(&path)) {
            return Ok(());
        }
        let (read, fault) = mtl::parse(&library);
        if let Some(fault) = fault {
            progress.note(&format!("{}; left out", fault.into_error(&library)));
        }
        for mtl in read {
            materials.entry(mtl.name.clone()).or_insert(mtl);
        }
        Ok::<(), String>(())
    };
    let mut seen = HashSet::new();
    for library in libraries.iter().filter(|library| seen.insert(*library)) {
        // The line may have several names, or one that contains spaces.
        let Err(reason) = read(library) else { continue };
        let names: Vec<&[u8]> = words(library.as_bytes()).collect();
        let n_read =
            names.iter().filter(|name| read(&String::from_utf8_lossy(name)).is_ok()).count();
        if n_read == 0 {
            missing.add(reason);
        }
    }
    missing.report("materials are plain", progress);
    materials
}

/// Groups polygons by material, in the order of first use; `None` is the default material.
fn polygons_by_material<'a>(
    input: &Input,
    parsed: &Parsed,
    materials: &'a HashMap<String, Mtl>,
    progress: &dyn Progress,
) -> Vec<(Option<&'a Mtl>, Vec<Range<usize>>)> {
    let mut groups: Vec<(Option<&Mtl>, Vec<Range<usize>>)> = Vec::new();
    let mut group_of_name: HashMap<Option<&str>, usize> = HashMap::new();
    let mut unknown = HashSet::new();
    let mut missing = MissingFiles::default();
    let n_polygons = parsed.polygon_ends.len();
    let mut start = 0;
    let mut name = None;
    let switches = parsed.materials.iter().map(|(polygon, name)| (*polygon, Some(name.as_str())));
    for (end, next) in switches.chain([(n_polygons, None)]) {
        if start < end {
            let mtl = name.and_then(|name: &str| materials.get(name));
            let group = *group_of_name.entry(mtl.and(name)).or_insert_with(|| {
                groups.push((mtl, Vec::new()));
                groups.len() - 1
            });
            if let Some(name) = name.filter(|name| mtl.is_none() && unknown.insert(*name)) {
                missing.add(format!("{}: no MTL file has `{name}`", input.name));
            }
            groups[group].1.push(start..end);
        }
        (start, name) = (end, next);
    }
    missing.report("a material is plain", progress);
    groups
}

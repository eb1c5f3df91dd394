//! Meshes of OBJ files, one for each material.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use surfel::progress::Progress;
use surfel::scene::Material;

use super::build::Columns;
use super::lines::{keyword, line_end, words};
use super::mtl::{self, Mtl};
use super::parse::{Parsed, parse};
use super::textures::textured;
use crate::beside::{Beside, Missing, Textures};
use crate::error::{Place, Result};
use crate::input::Input;
use crate::mesh::{Model, finish};
use crate::options::{LoadOptions, Source};
use crate::pieces::{Piece, line_of};

pub(crate) fn has_faces(input: &Input) -> bool {
    let mut lines = Piece { text: input, start: 0 }.lines(line_end);
    lines.any(|(_, line)| matches!(keyword(line).0, b"f" | b"fo"))
}

pub(crate) fn read_mesh(
    input: &Input,
    beside: &Beside,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Model, Source)> {
    let parsed = parse(input, progress)?;
    let place = parsed.first_polygon.map_or(Place::Byte(0), |at| line_of(input, at));
    let materials = read_libraries(&parsed.libraries, beside, progress);
    let groups = polygons_by_material(input, &parsed, &materials, progress);
    let source = source(&parsed);

    let columns = Columns::of(parsed, options);
    let mut textures = Textures::new(beside);
    let mut model = Model::default();
    let mut n_short = 0;
    for (material, polygons) in groups {
        progress.check()?;
        let (mesh, n_short_here) = columns.mesh(&polygons);
        n_short += n_short_here;
        let material = material.map_or(Material::MATTE, |mtl| textured(mtl, &mut textures));
        model.parts.push((mesh, material));
    }
    textures.missing.tell("a texture is left out", progress);
    model.textures = textures.all;
    let (model, n_triangles) = finish(input, model, n_short, place, progress)?;
    Ok((model, Source { n_triangles: Some(n_triangles), ..source }))
}

fn source(parsed: &Parsed) -> Source {
    let present = [
        (true, &["x", "y", "z"][..]),
        (!parsed.colors.is_empty(), &["red", "green", "blue"]),
        (!parsed.normals.is_empty(), &["nx", "ny", "nz"]),
        (!parsed.uvs.is_empty(), &["u", "v"]),
    ];
    let columns = present.iter().filter(|(is_present, _)| *is_present);
    Source {
        format: "OBJ, mesh".into(),
        n_points: Some(parsed.positions.len() as u64),
        columns: columns.flat_map(|(_, names)| *names).map(|name| (*name).into()).collect(),
        ..Source::default()
    }
}

/// The materials of all MTL files by their names; of two with one name the first counts.
fn read_libraries(
    libraries: &[String],
    beside: &Beside,
    progress: &dyn Progress,
) -> HashMap<String, Mtl> {
    let mut materials = HashMap::new();
    let mut missing = Missing::default();
    let mut read = |name: &str| {
        let library = beside.open(name)?;
        let (read, fault) = mtl::parse(&library);
        if let Some(fault) = fault {
            progress.note(&format!("{}; left out", fault.told_of(&library)));
        }
        for mtl in read {
            materials.entry(mtl.name.clone()).or_insert(mtl);
        }
        Ok::<(), String>(())
    };
    let mut seen = HashSet::new();
    for library in libraries.iter().filter(|library| seen.insert(*library)) {
        // Several names in a line, or one with spaces in it.
        let Err(reason) = read(library) else { continue };
        let names: Vec<&[u8]> = words(library.as_bytes()).collect();
        let n_read =
            names.iter().filter(|name| read(&String::from_utf8_lossy(name)).is_ok()).count();
        if n_read == 0 {
            missing.add(reason);
        }
    }
    missing.tell("materials are plain", progress);
    materials
}

/// Which polygons have which material, in the order of first use; `None` is a plain one.
fn polygons_by_material<'a>(
    input: &Input,
    parsed: &Parsed,
    materials: &'a HashMap<String, Mtl>,
    progress: &dyn Progress,
) -> Vec<(Option<&'a Mtl>, Vec<Range<usize>>)> {
    let mut groups: Vec<(Option<&Mtl>, Vec<Range<usize>>)> = Vec::new();
    let mut group_of_name: HashMap<Option<&str>, usize> = HashMap::new();
    let mut unknown = HashSet::new();
    let mut missing = Missing::default();
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
    missing.tell("a material is plain", progress);
    groups
}

//! Primitives: triangles and points. Those over the same numbers are held once.

use std::collections::{BTreeSet, HashMap};

use surfel::image::encode_srgb;
use surfel::math::{Vec3, Vec4};
use surfel::points::PointCloud;
use surfel::scene::{Geometry, Mesh, Morph, Points};

use super::accessor::Accessor;
use super::attributes::Vertices;
use super::document::Document;
use super::extensions;
use super::json::Json;
use super::triangles::{Mode, assemble, compact};
use crate::error::Result;
use crate::mend::{drop_unusable, mend_normals};

/// The geometry that nodes have asked for so far.
pub(super) struct Primitives<'d, 'a> {
    document: &'d Document<'a>,
    pub geometries: Vec<Geometry>,
    /// Index of the geometry by what it is made of; none where there is nothing to see.
    known: HashMap<String, Option<usize>>,
    /// Names of all attributes.
    pub columns: BTreeSet<String>,
}

impl<'d, 'a> Primitives<'d, 'a> {
    pub fn new(document: &'d Document<'a>) -> Self {
        Self { document, geometries: Vec::new(), known: HashMap::new(), columns: BTreeSet::new() }
    }

    /// Index of what a primitive shows, if it shows anything.
    pub fn refer(&mut self, primitive: &Json<'a>) -> Result<Option<usize>> {
        let parts = ["mode", "indices", "attributes", "targets"].map(|key| primitive.get(key));
        let key = parts.map(|part| part.map_or(String::new(), |part| part.source())).join(" ");
        if let Some(known) = self.known.get(&key) {
            return Ok(*known);
        }
        self.document.progress.check()?;
        let attributes = primitive.need("attributes")?;
        let names = attributes.members()?.map(|(name, _)| name.to_owned());
        self.columns.extend(names);
        let index = self.read(primitive, &attributes)?.map(|geometry| {
            self.geometries.push(geometry);
            self.geometries.len() - 1
        });
        self.known.insert(key, index);
        Ok(index)
    }

    fn read(&self, primitive: &Json<'a>, attributes: &Json<'a>) -> Result<Option<Geometry>> {
        let document = self.document;
        let left_out = |what: &str| {
            document.note(format!("{what} left out"));
            Ok(None)
        };
        const TRIANGLES: u64 = 4;
        let mode = match primitive.unsigned_or("mode", TRIANGLES)? {
            0 => None,
            1..=3 => return left_out("lines, which surfel does not draw, are"),
            TRIANGLES => Some(Mode::List),
            5 => Some(Mode::Strip),
            6 => Some(Mode::Fan),
            _ => return Err(primitive.need("mode")?.unlike("a mode from 0 to 6")),
        };
        let Some(position) = attributes.get("POSITION") else {
            return left_out("a mesh without positions is");
        };
        let position = Accessor::open(document, &position)?;
        extensions::refuse_compressed(primitive, &position)?;
        let count = position.count;
        let indices =
            primitive.get("indices").map(|indices| read_indices(document, &indices, count));
        let indices = indices.transpose()?;
        let vertices = |picked| Vertices { document, primitive, attributes, count, picked };
        let geometry = match mode {
            None => read_points(&vertices(indices.as_deref()))?.map(Geometry::Points),
            Some(mode) => {
                let corners = match indices {
                    Some(indices) => indices,
                    None => counted(document, &position)?,
                };
                // A strip or a fan has a triangle for nearly every corner.
                document.charge(primitive, corners.len(), size_of::<[u32; 3]>())?;
                let mut triangles = assemble(mode, &corners);
                if mode == Mode::List && !corners.len().is_multiple_of(3) {
                    document
                        .note("corners at the end of a mesh that make no triangle are left out");
                }
                let used = compact(&mut triangles, count);
                read_mesh(&vertices(used.as_deref()), triangles)?.map(Geometry::Triangles)
            }
        };
        if geometry.is_none() { left_out("a mesh with nothing in it is") } else { Ok(geometry) }
    }
}

/// 0, 1, 2 and so on: the corners of what has no indices.
fn counted(document: &Document, position: &Accessor) -> Result<Vec<u32>> {
    document.charge(&position.json, position.count, size_of::<u32>())?;
    let n = u32::try_from(position.count)
        .map_err(|_| position.json.error(format!("{} positions", position.count), "4294967295"))?;
    Ok((0..n).collect())
}

/// Corners, each of which is one of `count` positions.
fn read_indices<'a>(
    document: &Document<'a>,
    reference: &Json<'a>,
    count: usize,
) -> Result<Vec<u32>> {
    let accessor = Accessor::open(document, reference)?;
    let indices = accessor.integers::<1>(document, None)?;
    let beyond = indices.iter().position(|[index]| count <= *index as usize);
    if let Some(at) = beyond {
        let found = format!("{} at {at}", indices[at][0]);
        return Err(reference.error(found, format!("less than the {count} positions")));
    }
    Ok(indices.into_iter().map(|[index]| index).collect())
}

fn read_mesh(vertices: &Vertices, triangles: Vec<[u32; 3]>) -> Result<Option<Mesh>> {
    if triangles.is_empty() {
        return Ok(None);
    }
    let mut mesh = Mesh {
        positions: vertices.positions()?,
        triangles,
        normals: vertices.normals()?,
        tangents: vertices.tangents()?,
        uvs: [vertices.uvs("TEXCOORD_0")?, vertices.uvs("TEXCOORD_1")?],
        colors: vertices.colors()?,
        morphs: vertices.morphs()?,
        skin: vertices.skin()?,
        ..Mesh::default()
    };
    // Those without an area are left out untold: programs write many, and nobody misses them.
    let n_lost = drop_unusable(&mut mesh).n_lost;
    if 0 < n_lost {
        let line = format!(
            "{n_lost} triangles with a corner that is not finite or beyond 1e15 are left out"
        );
        vertices.document.note(line);
    }
    let n_mended = mend_normals(&mut mesh);
    if 0 < n_mended {
        let line = format!("{n_mended} normals without direction follow from the triangles");
        vertices.document.note(line);
    }
    let (has_normals, has_tangents) = (mesh.normals.is_some(), mesh.tangents.is_some());
    forget_columns_of_nothing(&mut mesh.morphs, has_normals, has_tangents);
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

fn read_points(vertices: &Vertices) -> Result<Option<Points>> {
    let document = vertices.document;
    let mut cloud = PointCloud::from_positions(vertices.positions()?);
    cloud.normals = vertices.normals()?;
    cloud.morphs = vertices.morphs()?;
    cloud.skin = vertices.skin()?;
    if cloud.normals.iter().flatten().any(|normal| normal.length_squared() == 0.0) {
        document.note("normals of points are left out: some have no direction");
        cloud.normals = None;
    }
    // Linear in glTF, sRGB-encoded in clouds.
    let encode = |color: Vec4| {
        let channels = color.truncate().to_array();
        channels.map(|channel| (65535.0 * encode_srgb(channel) + 0.5) as u16)
    };
    cloud.colors = vertices.colors()?.map(|colors| colors.into_iter().map(encode).collect());
    let n_all = cloud.len();
    forget_columns_of_nothing(&mut cloud.morphs, cloud.normals.is_some(), false);
    let is_finite = |i: &u32| {
        let at = [cloud.positions[*i as usize]].into_iter();
        at.chain(cloud.morphs.iter().map(|morph| morph.positions[*i as usize])).all(Vec3::is_finite)
    };
    if !(0..n_all as u32).all(|i| is_finite(&i)) {
        let found: Vec<u32> = (0..n_all as u32).filter(is_finite).collect();
        cloud = cloud.subset(&found);
        let n_lost = n_all - cloud.len();
        document.note(format!("{n_lost} points that are not finite are left out"));
    }
    Ok((!cloud.is_empty()).then(|| Points { cloud, ..Points::default() }))
}

/// Leaves out of morph targets what there is nothing that it could be added to.
fn forget_columns_of_nothing(morphs: &mut [Morph], has_normals: bool, has_tangents: bool) {
    for morph in morphs {
        morph.normals = morph.normals.take().filter(|_| has_normals);
        morph.tangents = morph.tangents.take().filter(|_| has_tangents);
    }
}

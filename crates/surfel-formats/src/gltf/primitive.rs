//! Primitives: triangles and points. Primitives with the same accessors share one geometry.

use std::collections::{BTreeSet, HashMap};
use surfel_core::words::counted;

use surfel_core::math::Vec3;
use surfel_core::points::PointCloud;
use surfel_core::scene::{Geometry, Mesh, Morph};

use super::accessor::Accessor;
use super::attributes::VertexAttributes;
use super::document::Document;
use super::extensions;
use super::json::Json;
use super::point_cloud::encode_color;
use super::triangulate::{TriangleTopology, compact_vertices, triangulate};
use crate::error::Result;
use crate::mesh::{drop_invalid_triangles, repair_normals};

/// The geometries that meshes have referred to so far.
pub(super) struct GeometryCache<'d, 'a> {
    document: &'d Document<'a>,
    /// Loaded geometries.
    pub all: Vec<Geometry<PointCloud>>,
    /// Index of the geometry by its mode and accessors; `None` if it is empty or unsupported.
    by_source: HashMap<String, Option<usize>>,
    /// Names of all vertex attributes.
    pub attribute_names: BTreeSet<String>,
}

impl<'d, 'a> GeometryCache<'d, 'a> {
    /// Creates a reader of the document's primitives.
    pub fn new(document: &'d Document<'a>) -> Self {
        Self {
            document,
            all: Vec::new(),
            by_source: HashMap::new(),
            attribute_names: BTreeSet::new(),
        }
    }

    /// Returns the index of the geometry of a primitive, if it has any.
    pub fn load(&mut self, primitive: &Json<'a>) -> Result<Option<usize>> {
        let parts = ["mode", "indices", "attributes", "targets"].map(|key| primitive.get(key));
        let key =
            parts.map(|part| part.map_or(String::new(), |part| part.to_json_string())).join(" ");
        if let Some(index) = self.by_source.get(&key) {
            return Ok(*index);
        }
        self.document.progress.check()?;
        let attributes = primitive.require("attributes")?;
        let names = attributes.object()?.map(|(name, _)| name.to_owned());
        self.attribute_names.extend(names);
        let index = self.read(primitive, &attributes)?.map(|geometry| {
            self.all.push(geometry);
            self.all.len() - 1
        });
        self.by_source.insert(key, index);
        Ok(index)
    }

    fn read(
        &self,
        primitive: &Json<'a>,
        attributes: &Json<'a>,
    ) -> Result<Option<Geometry<PointCloud>>> {
        let document = self.document;
        let skip = |what: &str| {
            document.warn(format!("{what} skipped"));
            Ok(None)
        };
        const TRIANGLES: u64 = 4;
        let mode = match primitive.unsigned_or("mode", TRIANGLES)? {
            0 => None,
            1..=3 => return skip("lines, which surfel does not draw, are"),
            TRIANGLES => Some(TriangleTopology::List),
            5 => Some(TriangleTopology::Strip),
            6 => Some(TriangleTopology::Fan),
            _ => return Err(primitive.require("mode")?.type_error("a mode from 0 to 6")),
        };
        let Some(position) = attributes.get("POSITION") else {
            return skip("a mesh without positions is");
        };
        let position = Accessor::open(document, &position)?;
        extensions::reject_compressed(primitive, &position)?;
        let count = position.count;
        let indices =
            primitive.get("indices").map(|indices| read_indices(document, &indices, count));
        let indices = indices.transpose()?;
        let vertices =
            |selected| VertexAttributes { document, primitive, attributes, count, selected };
        let geometry = match mode {
            None => read_points(&vertices(indices.as_deref()))?.map(Geometry::Points),
            Some(mode) => {
                let corners = match indices {
                    Some(indices) => indices,
                    None => sequential_indices(document, &position)?,
                };
                // A strip or a fan has almost as many triangles as indices.
                document.reserve(primitive, corners.len(), size_of::<[u32; 3]>())?;
                let mut triangles = triangulate(mode, &corners);
                if mode == TriangleTopology::List && !corners.len().is_multiple_of(3) {
                    document.warn(
                        "extra indices at the end of a mesh are skipped: they form no triangle",
                    );
                }
                let used = compact_vertices(&mut triangles, count);
                read_mesh(&vertices(used.as_deref()), triangles)?.map(Geometry::Triangles)
            }
        };
        if geometry.is_none() { skip("a mesh with nothing in it is") } else { Ok(geometry) }
    }
}

/// Returns 0, 1, 2 and so on: the indices of a primitive without indices.
fn sequential_indices(document: &Document, position: &Accessor) -> Result<Vec<u32>> {
    document.reserve(&position.json, position.count, size_of::<u32>())?;
    let n = u32::try_from(position.count)
        .map_err(|_| position.json.error(format!("{} positions", position.count), "4294967295"))?;
    Ok((0..n).collect())
}

/// Reads indices and checks that each is one of `count` positions.
fn read_indices<'a>(
    document: &Document<'a>,
    reference: &Json<'a>,
    count: usize,
) -> Result<Vec<u32>> {
    let accessor = Accessor::open(document, reference)?;
    let indices = accessor.integers::<1>(document, None)?;
    let out_of_range = indices.iter().position(|[index]| count <= *index as usize);
    if let Some(at) = out_of_range {
        let found = format!("{} at {at}", indices[at][0]);
        return Err(reference.error(found, format!("less than the {}", counted(count, "position"))));
    }
    Ok(indices.into_iter().map(|[index]| index).collect())
}

fn read_mesh(vertices: &VertexAttributes, triangles: Vec<[u32; 3]>) -> Result<Option<Mesh>> {
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
    // Degenerate triangles are dropped without a warning: exporters write many, and they are invisible.
    let n_lost = drop_invalid_triangles(&mut mesh).n_invalid;
    if 0 < n_lost {
        let line = format!(
            "skipped {} with a corner that is not finite or beyond 1e15",
            counted(n_lost, "triangle")
        );
        vertices.document.warn(line);
    }
    let n_repaired = repair_normals(&mut mesh);
    if 0 < n_repaired {
        let line = format!(
            "replaced {} of length zero by those of the triangles",
            counted(n_repaired, "normal")
        );
        vertices.document.warn(line);
    }
    let (has_normals, has_tangents) = (mesh.normals.is_some(), mesh.tangents.is_some());
    drop_unused_target_columns(&mut mesh.morphs, has_normals, has_tangents);
    Ok((!mesh.triangles.is_empty()).then_some(mesh))
}

fn read_points(vertices: &VertexAttributes) -> Result<Option<PointCloud>> {
    let document = vertices.document;
    let mut cloud = PointCloud::from_positions(vertices.positions()?);
    cloud.normals = vertices.normals()?;
    cloud.morphs = vertices.morphs()?;
    cloud.skin = vertices.skin()?;
    if cloud.normals.iter().flatten().any(|normal| normal.length_squared() == 0.0) {
        document.warn("normals of points are skipped: some have length zero");
        cloud.normals = None;
    }
    // Colours are linear in glTF and sRGB-encoded in clouds.
    cloud.colors = vertices.colors()?.map(|colors| colors.into_iter().map(encode_color).collect());
    let n_all = cloud.len();
    drop_unused_target_columns(&mut cloud.morphs, cloud.normals.is_some(), false);
    let is_finite = |i: &u32| {
        let at = [cloud.positions[*i as usize]].into_iter();
        at.chain(cloud.morphs.iter().map(|morph| morph.positions[*i as usize])).all(Vec3::is_finite)
    };
    if !(0..n_all as u32).all(|i| is_finite(&i)) {
        let finite: Vec<u32> = (0..n_all as u32).filter(is_finite).collect();
        cloud = cloud.subset(&finite);
        let n_lost = n_all - cloud.len();
        document.warn(format!("skipped {} without a finite position", counted(n_lost, "point")));
    }
    Ok((!cloud.is_empty()).then_some(cloud))
}

/// Drops normals and tangents of morph targets if the base has none that they could be added to.
fn drop_unused_target_columns(morphs: &mut [Morph], has_normals: bool, has_tangents: bool) {
    for morph in morphs {
        morph.normals = morph.normals.take().filter(|_| has_normals);
        morph.tangents = morph.tangents.take().filter(|_| has_tangents);
    }
}

//! Builds meshes from the polygons of an OBJ file.

use std::ops::Range;

use surfel_core::image::decode_srgb;
use surfel_core::math::{DVec3, Vec2, Vec3, Vec4};
use surfel_core::scene::Mesh;

use super::parse::{ABSENT, Corner, Parsed};
use crate::mesh::{relative_to_origin, weld};
use crate::options::LoadOptions;
use crate::table::{ColorRange, Tolerance};

/// The columns of a file, converted to those of meshes.
pub(super) struct Columns {
    origin: DVec3,
    positions: Vec<Vec3>,
    /// Linear colours; empty if there are none.
    colors: Vec<Vec4>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    corners: Vec<Corner>,
    polygon_ends: Vec<usize>,
}

impl Columns {
    /// Converts the columns of a parsed file.
    pub fn new(parsed: Parsed, options: &LoadOptions) -> Self {
        let (origin, positions) =
            relative_to_origin(&parsed.positions, Tolerance::UNSTATED, options);
        let Parsed { colors, uvs, normals, corners, polygon_ends, .. } = parsed;
        let channels = colors.iter().flat_map(|color| color.to_array());
        let range = ColorRange::from_floats(channels.map(f64::from));
        let scale = (range.scale() / 65535.0) as f32;
        // A vertex without colour is white if others have one.
        let linear = |channel: f32| if channel.is_nan() { 1.0 } else { decode(scale * channel) };
        let colors =
            colors.iter().map(|color| Vec3::from(color.to_array().map(linear)).extend(1.0));
        let colors = colors.collect();
        Self { origin, positions, colors, uvs, normals, corners, polygon_ends }
    }

    /// Builds a mesh of the polygons in these ranges, with vertices of its own.
    ///
    /// Returns also the number of polygons with fewer than three corners.
    pub fn mesh(&self, polygons: &[Range<usize>]) -> (Mesh, u64) {
        let ends = || polygons.iter().flat_map(|range| self.corner_ranges(range.clone()));
        let corners: Vec<Corner> = ends().flat_map(|range| &self.corners[range]).copied().collect();
        let welded = weld(&corners);
        let mut triangles = Vec::new();
        let mut n_short = 0;
        let mut rest = welded.vertex_of_corner.as_slice();
        for range in ends() {
            let (polygon, after) = rest.split_at(range.len());
            rest = after;
            if let [first, others @ ..] = polygon {
                triangles.extend(others.array_windows().map(|[a, b]| [*first, *a, *b]));
            }
            n_short += u64::from(polygon.len() < 3);
        }
        let vertices: Vec<Corner> =
            welded.first_corners.iter().map(|corner| corners[*corner as usize]).collect();
        let mesh = Mesh {
            origin: self.origin,
            positions: vertices.iter().map(|vertex| self.positions[vertex[0] as usize]).collect(),
            triangles,
            normals: column(&vertices, 2, &self.normals),
            uvs: [column(&vertices, 1, &self.uvs), None],
            colors: column(&vertices, 0, &self.colors),
            ..Mesh::default()
        };
        (mesh, n_short)
    }

    /// Yields the range of the corners of each polygon.
    fn corner_ranges(&self, polygons: Range<usize>) -> impl Iterator<Item = Range<usize>> {
        polygons.map(|i| {
            let start = i.checked_sub(1).map_or(0, |before| self.polygon_ends[before]);
            start..self.polygon_ends[i]
        })
    }
}

/// Gathers the values of a column for these vertices, zero for a vertex without; `None` if no vertex has a value.
fn column<T: Copy + Default>(vertices: &[Corner], kind: usize, values: &[T]) -> Option<Vec<T>> {
    let has_values = !values.is_empty() && vertices.iter().any(|vertex| vertex[kind] != ABSENT);
    let value = |vertex: &Corner| values.get(vertex[kind] as usize).copied().unwrap_or_default();
    has_values.then(|| vertices.iter().map(value).collect())
}

fn decode(encoded: f32) -> f32 {
    decode_srgb(encoded.clamp(0.0, 1.0))
}

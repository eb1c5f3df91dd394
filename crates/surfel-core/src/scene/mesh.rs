//! Triangle meshes as columns.

use crate::math::{Aabb, DVec3, Vec2, Vec3, Vec4};
use crate::points::{Morph, Skin};
use std::collections::HashMap;

/// Triangles over shared vertices. Each vertex column that is present has one entry for each position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Object coordinates of the origin of `positions`.
    pub origin: DVec3,
    /// Vertex positions relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Three vertex indices for each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Unit vertex normals; without them triangles are flat.
    pub normals: Option<Vec<Vec3>>,
    /// Unit vertex tangents along the first texture coordinate; w is the sign of the bitangent.
    pub tangents: Option<Vec<Vec4>>,
    /// Up to two sets of texture coordinates; (0, 0) is the upper left corner of a texture.
    pub uvs: [Option<Vec<Vec2>>; 2],
    /// Linear vertex colours with alpha, which multiply the material's base colour.
    pub colors: Option<Vec<Vec4>>,
    /// Morph targets.
    pub morphs: Vec<Morph>,
    /// Joints and weights of each vertex.
    pub skin: Option<Skin>,
}

impl Mesh {
    /// Returns the bounds of the positions that triangles use, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        let used = self.triangles.as_flattened();
        Aabb::of_points(used.iter().map(|&vertex| self.positions[vertex as usize]))
    }

    /// Returns the corners of a triangle, relative to `origin`.
    pub fn corners(&self, triangle_idx: usize) -> [Vec3; 3] {
        self.triangles[triangle_idx].map(|vertex| self.positions[vertex as usize])
    }

    /// Sets each vertex normal to the mean normal of the triangles around it, weighted by their angles at the
    /// vertex (Thürmer and Wüthrich 1998), so that it does not depend on the triangulation.
    ///
    /// Vertices at one position share a normal, so that texture seams do not show. A vertex that no triangle
    /// with an area uses gets +Z. Tangents are removed, for they belong to the previous normals.
    pub fn smooth_normals(&mut self) {
        let representatives = self.representatives();
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for triangle in &self.triangles {
            let corners = triangle.map(|vertex| self.positions[vertex as usize].as_dvec3());
            let [a, b, c] = corners;
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            for (i, vertex) in triangle.iter().enumerate() {
                let sides = [1, 2].map(|step| corners[(i + step) % 3] - corners[i]);
                sums[representatives[*vertex as usize] as usize] +=
                    sides[0].angle_between(sides[1]) * normal;
            }
        }
        let normal = |vertex: &u32| sums[*vertex as usize].normalize_or(DVec3::Z).as_vec3();
        self.normals = Some(representatives.iter().map(normal).collect());
        self.tangents = None;
    }

    /// Returns the first vertex at the position of each vertex.
    fn representatives(&self) -> Vec<u32> {
        let mut firsts = HashMap::with_capacity(self.positions.len());
        let positions = (0..).zip(&self.positions);
        // Adding zero maps -0 to +0.
        let first = |(vertex, position): (u32, &Vec3)| {
            *firsts.entry((*position + 0.0).to_array().map(f32::to_bits)).or_insert(vertex)
        };
        positions.map(first).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Smooth normals depend on the surface alone, not on its vertices and triangles.

    use super::*;

    /// A cube about zero; the number of diagonals at its corners differs.
    fn cube() -> Mesh {
        let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
        let corner = |i: u32| Vec3::new(sign(i & 1), sign(i & 2), sign(i & 4));
        let sides =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
            ..Mesh::default()
        }
    }

    #[test]
    fn smooth_normals_do_not_depend_on_diagonals() {
        let mut mesh = cube();
        mesh.tangents = Some(vec![Vec4::X; 8]);
        mesh.smooth_normals();
        for (normal, position) in mesh.normals.unwrap().into_iter().zip(mesh.positions) {
            assert!((normal - position.normalize()).length() < 1e-6, "{normal} at {position}");
        }
        assert_eq!(mesh.tangents, None);
    }

    #[test]
    fn vertices_at_one_position_share_their_smooth_normal() {
        let mut whole = cube();
        // Each triangle gets vertices of its own, and zeros get both signs.
        let corners = whole.triangles.as_flattened().iter();
        let mut split = Mesh {
            positions: corners.map(|vertex| whole.positions[*vertex as usize]).collect(),
            triangles: (0..12).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..Mesh::default()
        };
        for mesh in [&mut whole, &mut split] {
            mesh.positions.iter_mut().for_each(|position| position.x += 1.0);
        }
        split.positions.iter_mut().skip(1).filter(|p| p.x == 0.0).for_each(|p| p.x = -0.0);
        whole.smooth_normals();
        split.smooth_normals();
        let (whole_normals, split_normals) = (whole.normals.unwrap(), split.normals.unwrap());
        for (corner, vertex) in whole.triangles.as_flattened().iter().enumerate() {
            let difference = split_normals[corner] - whole_normals[*vertex as usize];
            assert!(difference.length() < 1e-6, "{corner}");
        }
    }

    #[test]
    fn vertices_without_an_area_get_a_default_normal() {
        let positions = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, Vec3::NAN, Vec3::Y];
        let mut mesh = Mesh {
            positions: positions.to_vec(),
            triangles: vec![[0, 1, 2], [0, 0, 1], [0, 1, 3]],
            ..Mesh::default()
        };
        mesh.smooth_normals();
        assert_eq!(mesh.normals, Some(vec![Vec3::Z; 5]));
        let mut none = Mesh::default();
        none.smooth_normals();
        assert_eq!(none.normals, Some(vec![]));
    }
}

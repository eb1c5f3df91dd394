//! Triangles as columns, and what deforms them.

use crate::math::{Aabb, DVec3, Vec2, Vec3, Vec4};

/// Triangles over shared vertices. Every column of vertices that is present has one entry for each position.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Object coordinates of the zero of `positions`.
    pub origin: DVec3,
    /// Relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Three positions each; the front is where they go round counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Unit; triangles are flat where there are none.
    pub normals: Option<Vec<Vec3>>,
    /// Unit, along the first texture coordinate; w is the sign of the bitangent.
    pub tangents: Option<Vec<Vec4>>,
    /// Texture coordinates, two sets at most: (0, 0) is the upper left corner of a texture.
    pub uvs: [Option<Vec<Vec2>>; 2],
    /// Linear, with alpha; they multiply the material's base colour.
    pub colors: Option<Vec<Vec4>>,
    pub morphs: Vec<Morph>,
    pub skin: Option<Skin>,
}

/// What a morph target adds to each vertex at weight 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Morph {
    pub positions: Vec<Vec3>,
    pub normals: Option<Vec<Vec3>>,
}

/// Up to four joints that carry each vertex; the joints themselves are named by nodes (`Node::joints`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    pub joints: Vec<[u16; 4]>,
    /// They add up to 1.
    pub weights: Vec<[f32; 4]>,
}

impl Mesh {
    /// Bounds of the positions that triangles use, relative to `origin`.
    pub fn bounds(&self) -> Aabb {
        let used = self.triangles.as_flattened();
        Aabb::of_points(used.iter().map(|&vertex| self.positions[vertex as usize]))
    }

    /// Corners of a triangle, relative to `origin`.
    pub fn corners(&self, triangle_idx: usize) -> [Vec3; 3] {
        self.triangles[triangle_idx].map(|vertex| self.positions[vertex as usize])
    }
}

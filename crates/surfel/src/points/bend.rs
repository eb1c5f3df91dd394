//! What bends points and vertices: morph targets, then the joints that carry them.

use crate::math::Vec3;

/// What a morph target adds to each point or vertex at weight 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Morph {
    pub positions: Vec<Vec3>,
    pub normals: Option<Vec<Vec3>>,
    /// To the directions of a mesh's tangents, whose signs stay.
    pub tangents: Option<Vec<Vec3>>,
    /// Of points.
    pub radii: Option<Vec<f32>>,
}

/// Up to four joints that carry each point or vertex; the joints themselves are named by nodes
/// (`Node::joints`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    pub joints: Vec<[u16; 4]>,
    /// They add up to 1.
    pub weights: Vec<[f32; 4]>,
}

impl Morph {
    /// Of those that `indices` names, in that order.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self {
            positions: pick(&self.positions, indices),
            normals: self.normals.as_ref().map(|column| pick(column, indices)),
            tangents: self.tangents.as_ref().map(|column| pick(column, indices)),
            radii: self.radii.as_ref().map(|column| pick(column, indices)),
        }
    }
}

impl Skin {
    /// Of those that `indices` names, in that order.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self { joints: pick(&self.joints, indices), weights: pick(&self.weights, indices) }
    }
}

pub(super) fn pick<T: Copy>(column: &[T], indices: &[u32]) -> Vec<T> {
    indices.iter().map(|&i| column[i as usize]).collect()
}

//! Columns that deform clouds and meshes: morph targets, and joints for skinning.

use crate::math::Vec3;

/// A morph target: the offsets that it adds to points or vertices at weight 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Morph {
    /// Offsets of positions.
    pub positions: Vec<Vec3>,
    /// Offsets of normals.
    pub normals: Option<Vec<Vec3>>,
    /// Offsets of the directions of a mesh's tangents, whose signs stay.
    pub tangents: Option<Vec<Vec3>>,
    /// Offsets of the radii of points.
    pub radii: Option<Vec<f32>>,
}

/// The joints that move each point or vertex, up to four. Joint indices refer to `Node::joints`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Joint indices of each point or vertex.
    pub joints: Vec<[u16; 4]>,
    /// Weights of these joints, which add up to 1.
    pub weights: Vec<[f32; 4]>,
}

impl Morph {
    /// Returns the offsets at `indices`, in that order.
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
    /// Returns the joints and weights at `indices`, in that order.
    pub fn subset(&self, indices: &[u32]) -> Self {
        Self { joints: pick(&self.joints, indices), weights: pick(&self.weights, indices) }
    }
}

/// Returns the entries of a column at `indices`, in that order.
pub(super) fn pick<T: Copy>(column: &[T], indices: &[u32]) -> Vec<T> {
    indices.iter().map(|&i| column[i as usize]).collect()
}

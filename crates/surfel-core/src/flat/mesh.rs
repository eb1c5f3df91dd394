//! Meshes in the form that kernels and shading read: triangles and the attributes of their vertices.

use super::block_tree::Slot;
use super::deform::Deformed;
use super::refit::Refit;
use super::triangles::FlatTriangles;
use crate::error::Result;
use crate::math::{Vec2, Vec3, Vec4};
use crate::progress::Progress;
use crate::scene::Mesh;

/// A triangle mesh with the attributes of its vertices. A column that the mesh lacks is empty.
#[derive(Clone, Debug, Default)]
pub struct FlatMesh {
    /// Triangles relative to the mesh's origin.
    pub triangles: FlatTriangles,
    /// Indices of the vertices of each triangle of the mesh. It is empty if vertices have positions only.
    pub vertex_indices: Vec<[u32; 3]>,
    /// Unit normals of the vertices.
    pub normals: Vec<Vec3>,
    /// Unit tangents of the vertices, with the sign of the bitangent in W as in glTF.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates of the vertices.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA colours of the vertices.
    pub colors: Vec<Vec4>,
}

impl FlatMesh {
    /// Sorts the triangles into a tree and copies the attributes.
    ///
    /// # Errors
    ///
    /// Fails if there are too many triangles for 32-bit indices, or if `progress` is cancelled.
    pub fn new(mesh: &Mesh, progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            triangles: FlatTriangles::new(&mesh.positions, &mesh.triangles, progress)?,
            normals: mesh.normals.clone().unwrap_or_default(),
            tangents: mesh.tangents.clone().unwrap_or_default(),
            ..Self::undeformed_columns(mesh)
        })
    }

    /// Sorts the deformed triangles into a tree.
    pub(super) fn deformed(
        mesh: &Mesh,
        deformed: Deformed,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Ok(Self {
            triangles: FlatTriangles::new(&deformed.positions, &mesh.triangles, progress)?,
            normals: deformed.normals,
            tangents: deformed.tangents,
            ..Self::undeformed_columns(mesh)
        })
    }

    /// Copies the columns that deformation does not change.
    fn undeformed_columns(mesh: &Mesh) -> Self {
        let [first, second] = &mesh.uvs;
        Self {
            vertex_indices: if has_vertex_attributes(mesh) {
                mesh.triangles.clone()
            } else {
                Vec::new()
            },
            uvs: [first.clone().unwrap_or_default(), second.clone().unwrap_or_default()],
            colors: mesh.colors.clone().unwrap_or_default(),
            ..Self::default()
        }
    }

    /// Moves the vertices to their deformed positions without changing the tree's structure. If the tree needs a
    /// rebuild, returns a new mesh in a tree of its own.
    pub(super) fn refit(
        &mut self,
        mesh: &Mesh,
        deformed: Deformed,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        if self.triangles.refit(&deformed.positions, &mesh.triangles) == Refit::NeedsRebuild {
            return Self::deformed(mesh, deformed, progress).map(Some);
        }
        (self.normals, self.tangents) = (deformed.normals, deformed.tangents);
        Ok(None)
    }

    /// Interpolates a column of vertex attributes in the triangle at `slot`. Returns none if the column is empty.
    pub fn interpolate<T>(&self, column: &[T], slot: Slot, barycentrics: [f32; 3]) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        if column.is_empty() {
            return None;
        }
        let [a, b, c] = self.vertex_indices[self.triangles.id(slot) as usize];
        let [a, b, c] = [a, b, c].map(|vertex| column[vertex as usize]);
        Some(a * barycentrics[0] + b * barycentrics[1] + c * barycentrics[2])
    }
}

fn has_vertex_attributes(mesh: &Mesh) -> bool {
    let has_uvs = mesh.uvs.iter().any(Option::is_some);
    has_uvs || mesh.normals.is_some() || mesh.tangents.is_some() || mesh.colors.is_some()
}

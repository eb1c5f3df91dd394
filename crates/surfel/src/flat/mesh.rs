//! A mesh as kernels and shading read it: its triangles, and what their corners carry.

use super::deform::Bent;
use super::points::Slot;
use super::refit::Refit;
use super::triangles::FlatTriangles;
use crate::error::Result;
use crate::math::{Vec2, Vec3, Vec4};
use crate::progress::Progress;
use crate::scene::Mesh;

/// Columns as those of `Mesh`, empty where it has none.
#[derive(Clone, Debug, Default)]
pub struct FlatMesh {
    /// Relative to the mesh's origin.
    pub triangles: FlatTriangles,
    /// The vertices of each triangle of the mesh; empty where these carry nothing but their places.
    pub corners: Vec<[u32; 3]>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec4>,
    pub uvs: [Vec<Vec2>; 2],
    pub colors: Vec<Vec4>,
}

impl FlatMesh {
    pub fn new(mesh: &Mesh, progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            triangles: FlatTriangles::new(&mesh.positions, &mesh.triangles, progress)?,
            normals: mesh.normals.clone().unwrap_or_default(),
            tangents: mesh.tangents.clone().unwrap_or_default(),
            ..Self::of_what_stays(mesh)
        })
    }

    /// `mesh` as it is bent.
    pub(super) fn bent(mesh: &Mesh, bent: Bent, progress: &dyn Progress) -> Result<Self> {
        Ok(Self {
            triangles: FlatTriangles::new(&bent.positions, &mesh.triangles, progress)?,
            normals: bent.normals,
            tangents: bent.tangents,
            ..Self::of_what_stays(mesh)
        })
    }

    /// The columns that bending leaves as they are.
    fn of_what_stays(mesh: &Mesh) -> Self {
        let [first, second] = &mesh.uvs;
        Self {
            corners: if carries_columns(mesh) { mesh.triangles.clone() } else { Vec::new() },
            uvs: [first.clone().unwrap_or_default(), second.clone().unwrap_or_default()],
            colors: mesh.colors.clone().unwrap_or_default(),
            ..Self::default()
        }
    }

    /// Moves the vertices to where they are bent to now, in the tree that they have. If that is unfit, gives
    /// them in a tree of their own.
    pub(super) fn refit(
        &mut self,
        mesh: &Mesh,
        bent: Bent,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        if self.triangles.refit(&bent.positions, &mesh.triangles) == Refit::Unfit {
            return Self::bent(mesh, bent, progress).map(Some);
        }
        (self.normals, self.tangents) = (bent.normals, bent.tangents);
        Ok(None)
    }

    /// What a column of vertices has at a place in the triangle at `slot`; none if it is empty.
    pub fn at<T>(&self, column: &[T], slot: Slot, shares: [f32; 3]) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        if column.is_empty() {
            return None;
        }
        let [a, b, c] = self.corners[self.triangles.id(slot) as usize];
        let [a, b, c] = [a, b, c].map(|vertex| column[vertex as usize]);
        Some(a * shares[0] + b * shares[1] + c * shares[2])
    }
}

fn carries_columns(mesh: &Mesh) -> bool {
    let has_uvs = mesh.uvs.iter().any(Option::is_some);
    has_uvs || mesh.normals.is_some() || mesh.tangents.is_some() || mesh.colors.is_some()
}

//! The hits of rays on a scene, with all that the geometry knows about them.

use crate::flat::{FlatCloud, FlatMesh, Instance, Slot};
use crate::math::{Ray, Vec3, Vec4};
use crate::surface::{SurfaceKind, triangle};
use crate::trace::query::hit::Hit;
use crate::trace::query::surface_hit::SurfaceHit;

/// The hit of a ray on a scene, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneHit {
    /// Distance along the ray, infinite if nothing was hit.
    pub distance: f32,
    /// Index of the instance in the scene.
    pub instance: u32,
    /// Index of the nearest point in its cloud, or of the triangle in its mesh.
    pub id: u32,
    /// Slot of the triangle, or of the point in the tree of its kind of surface.
    pub slot: Slot,
    /// Barycentric coordinates of the triangle's second and third corners.
    pub barycentrics: (f32, f32),
    /// Radius of the nearest point, 0 for triangles.
    pub radius: f32,
    /// The radius from which the distance follows that new rays skip, 0 for triangles.
    pub spawn_radius: f32,
    /// Unit shading normal, facing the ray's origin; interpolated between the corners of a triangle that has
    /// normals.
    pub normal: Vec3,
    /// Unit normal of the triangle's plane, facing the ray's origin; for points it equals `normal`.
    pub geometric_normal: Vec3,
    /// Linear colour of the geometry.
    pub color: Vec3,
    /// Alpha of the geometry.
    pub alpha: f32,
    /// The kind of the surface that was hit; `None` for triangles.
    pub surface: Option<SurfaceKind>,
    /// True if the ray hits the back of the surface, as far as its orientation is known.
    pub is_backface: bool,
}

impl SceneHit {
    /// The result of a ray that hits nothing.
    pub const MISS: Self = Self {
        distance: f32::INFINITY,
        instance: u32::MAX,
        id: u32::MAX,
        slot: 0,
        barycentrics: (0.0, 0.0),
        radius: 0.0,
        spawn_radius: 0.0,
        normal: Vec3::ZERO,
        geometric_normal: Vec3::ZERO,
        color: Vec3::ZERO,
        alpha: 0.0,
        surface: None,
        is_backface: false,
    };

    /// True if nothing was hit.
    pub fn is_miss(&self) -> bool {
        self.instance == u32::MAX
    }
}

/// Completes a hit on an instance of a cloud, but for distance and instance.
#[inline]
pub fn point_hit(cloud: &FlatCloud, hit: &SurfaceHit, instance: &Instance) -> SceneHit {
    let normal = instance.world_normal(hit.normal);
    let radius = hit.radius * instance.max_scale;
    SceneHit {
        id: hit.id,
        slot: hit.slot,
        radius,
        spawn_radius: cloud.options.spawn_factor(hit.surface) * radius,
        normal,
        geometric_normal: normal,
        color: hit.color,
        alpha: 1.0,
        surface: Some(hit.surface),
        is_backface: cloud.has_outward_normals && hit.is_backface,
        ..SceneHit::MISS
    }
}

/// Completes a hit on an instance of a mesh by a ray in object space, but for distance and instance.
pub fn triangle_hit(mesh: &FlatMesh, hit: &Hit, ray: &Ray, instance: &Instance) -> SceneHit {
    let corners = mesh.triangles.triangle(hit.slot);
    let barycentrics =
        triangle::barycentrics(corners.map(|corner| corner - ray.origin), ray.direction);
    let [a, b, c] = corners;
    let outward = unit((b - a).cross(c - a));
    let is_backface = 0.0 < outward.dot(ray.direction);
    let side = if is_backface { -1.0 } else { 1.0 };
    let geometric_normal = instance.world_normal(side * outward);
    let interpolated =
        mesh.interpolate(&mesh.normals, hit.slot, barycentrics).and_then(Vec3::try_normalize);
    let normal = match interpolated {
        Some(interpolated) => {
            let normal = instance.world_normal(interpolated);
            // `is_backface` does not decide: some programs write normals against the winding order.
            if normal.dot(geometric_normal) < 0.0 { -normal } else { normal }
        }
        None => geometric_normal,
    };
    let color = mesh.interpolate(&mesh.colors, hit.slot, barycentrics).unwrap_or(Vec4::ONE);
    SceneHit {
        id: mesh.triangles.id(hit.slot),
        slot: hit.slot,
        barycentrics: (barycentrics[1], barycentrics[2]),
        normal,
        geometric_normal,
        color: color.truncate(),
        alpha: color.w,
        is_backface,
        ..SceneHit::MISS
    }
}

/// Returns a vector of unit length, also where squares are beyond the range of f32.
fn unit(vector: Vec3) -> Vec3 {
    (vector / vector.abs().max_element()).normalize()
}

//! Shading parameters at a hit: the material with its textures and the geometry's colours applied.

use crate::flat::{FlatGeometry, FlatMesh, FlatScene, Instance};
use crate::math::{Basis, Ray, Vec2, Vec3, Vec4};
use crate::scene::{AlphaMode, TextureEncoding, TextureRef};
use crate::surface::SurfaceKind;
use crate::trace::SceneHit;

/// Least cosine between a shading normal and the direction to the viewer.
pub const MIN_FACING_COS: f32 = 1e-3;

/// Position, normals and material parameters of a surface at a hit.
#[derive(Clone, Copy, Debug)]
pub struct Shading {
    /// Position of the hit, relative to the scene's origin.
    pub position: Vec3,
    /// Shading normal, with the normal map applied: unit, facing the viewer.
    pub normal: Vec3,
    /// Geometric normal, along which new rays are offset: unit, facing the viewer.
    pub geometric_normal: Vec3,
    /// Linear base colour.
    pub base_color: Vec3,
    /// Opacity from 0 to 1, with the material's alpha mode applied.
    pub alpha: f32,
    /// Metalness from 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness from 0 to 1.
    pub roughness: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Fraction of the entering light that is transmitted.
    pub transmission: f32,
    /// True if the surface is a thin slab without an interior.
    pub is_thin: bool,
    /// Emitted radiance, linear.
    pub emission: Vec3,
    /// True if the surface shows its base colour whatever the light.
    pub is_unlit: bool,
    /// The radius of a point, in world units, from which the distance follows that new rays skip; 0 for triangles.
    spawn_radius: f32,
    /// The kind of surface of points; `None` for triangles.
    surface: Option<SurfaceKind>,
    /// Largest absolute coordinate of the hit and of the ray's origin, which bounds rounding errors.
    coordinate_magnitude: f32,
}

/// Returns the base colour at a hit, linear.
///
/// # Panics
///
/// Panics for a miss.
pub fn albedo(scene: &FlatScene, ray: &Ray, hit: &SceneHit) -> Vec3 {
    Shading::new(scene, ray, hit).base_color
}

impl Shading {
    /// Evaluates the material at a hit, which must not be a miss.
    #[inline]
    pub fn new(scene: &FlatScene, ray: &Ray, hit: &SceneHit) -> Self {
        let instance = &scene.instances[hit.instance as usize];
        let material = &scene.materials[instance.material_idx as usize];
        let position = ray.at(hit.distance);
        let mut shading = Self {
            position,
            normal: hit.normal,
            geometric_normal: hit.geometric_normal,
            base_color: material.color_over(hit.color),
            alpha: material.alpha * hit.alpha,
            metallic: material.metallic,
            roughness: material.roughness,
            ior: material.ior,
            transmission: material.transmission,
            // A leaf has no inside.
            is_thin: material.is_thin || hit.surface == Some(SurfaceKind::Leaves),
            emission: material.emissive,
            is_unlit: material.is_unlit,
            spawn_radius: hit.spawn_radius,
            surface: hit.surface,
            coordinate_magnitude: position.abs().max(ray.origin.abs()).max_element(),
        };
        if let FlatGeometry::Mesh(mesh) = scene.geometry(instance) {
            shading.apply_textures(scene, &TrianglePoint { mesh, hit, instance });
        }
        shading.emission += material.emissive_strength * shading.base_color;
        shading.alpha = match material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f32::from(cutoff <= shading.alpha),
            AlphaMode::Blend => shading.alpha.clamp(0.0, 1.0),
        };
        shading.faceforward(ray.direction);
        shading
    }

    fn apply_textures(&mut self, scene: &FlatScene, point: &TrianglePoint) {
        let textures = &scene.materials[point.instance.material_idx as usize].textures;
        let sample = |reference: &TextureRef, encoding| {
            let uv = point.uv(reference.uv_set)?;
            Some(scene.textures[reference.texture].sample(uv, reference, encoding))
        };
        let texel =
            |reference: &Option<TextureRef>, encoding| sample(reference.as_ref()?, encoding);
        if let Some(texel) = texel(&textures.base_color, TextureEncoding::Srgb) {
            self.base_color *= texel.truncate();
            self.alpha *= texel.w;
        }
        if let Some(texel) = texel(&textures.metallic_roughness, TextureEncoding::Linear) {
            self.roughness *= texel.y;
            self.metallic *= texel.z;
        }
        if let Some(texel) = texel(&textures.emissive, TextureEncoding::Srgb) {
            self.emission *= texel.truncate();
        }
        if let Some(texel) = texel(&textures.transmission, TextureEncoding::Linear) {
            self.transmission *= texel.x;
        }
        if let Some((reference, scale)) = &textures.normal
            && let Some(texel) = sample(reference, TextureEncoding::Linear)
        {
            let local = (2.0 * texel.truncate() - 1.0) * Vec3::new(*scale, *scale, 1.0);
            self.normal = point.normal_mapped(self.normal, local, reference);
        }
    }

    /// Tilts a shading normal that faces away from the viewer until it just faces the viewer.
    ///
    /// Interpolated normals can face away at silhouettes.
    fn faceforward(&mut self, direction: Vec3) {
        let away = self.normal.dot(direction);
        if -MIN_FACING_COS < away {
            self.normal = (self.normal - (away + MIN_FACING_COS) * direction)
                .normalize_or(self.geometric_normal);
        }
    }

    /// True if the surface bounds a solid transmissive body.
    pub fn is_solid_dielectric(&self) -> bool {
        0.0 < self.transmission && !self.is_thin
    }

    /// Makes a ray in `direction`, offset to that side so that it does not hit the surface again.
    pub fn spawn(&self, direction: Vec3) -> Ray {
        let is_outward = 0.0 <= self.geometric_normal.dot(direction);
        let side = if is_outward { self.geometric_normal } else { -self.geometric_normal };
        match self.surface {
            Some(surface) => surface.spawn_ray(
                self.position,
                self.coordinate_magnitude,
                side,
                self.spawn_radius,
                direction,
            ),
            None => {
                // The position is wrong by a few roundings of the coordinates that it was computed from.
                let origin = self.position + 32.0 * f32::EPSILON * self.coordinate_magnitude * side;
                Ray { t_min: 0.0, ..Ray::new(origin, direction) }
            }
        }
    }

    /// Makes a ray toward a light, in `direction`: the steeper it leaves the surface, the nearer it begins.
    pub fn spawn_to_light(&self, direction: Vec3) -> Ray {
        let ray = self.spawn(direction);
        let steepness = self.surface.map_or(0.0, SurfaceKind::light_steepness);
        let along = (1.0 - steepness * self.geometric_normal.dot(direction)).max(0.0);
        Ray { t_min: along * ray.t_min, ..ray }
    }
}

/// A point on a triangle.
struct TrianglePoint<'s> {
    mesh: &'s FlatMesh,
    hit: &'s SceneHit,
    instance: &'s Instance,
}

impl TrianglePoint<'_> {
    /// Interpolates a vertex column; `None` if the mesh does not have it.
    fn interpolate<T>(&self, column: &[T]) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let (b, c) = self.hit.barycentrics;
        self.mesh.interpolate(column, self.hit.slot, [1.0 - b - c, b, c])
    }

    fn uv(&self, set: usize) -> Option<Vec2> {
        self.interpolate(&self.mesh.uvs[set])
    }

    /// Returns `normal` with the tangent-space normal `local` of a normal map applied.
    fn normal_mapped(&self, normal: Vec3, local: Vec3, reference: &TextureRef) -> Vec3 {
        let tangent =
            self.interpolate(&self.mesh.tangents).or_else(|| self.tangent_of_uvs(reference));
        let (tangent, sign) = match tangent {
            Some(tangent) => {
                let world = self.instance.world_from_object.transform_vector3(tangent.truncate());
                (world - world.dot(normal) * normal, 1f32.copysign(tangent.w))
            }
            None => (Basis::around(normal).tangent, 1.0),
        };
        let Some(tangent) = tangent.try_normalize() else { return normal };
        // The bitangent flips where the normal was flipped, as on a backface, and where the transform
        // mirrors.
        let own =
            self.interpolate(&self.mesh.normals).map(|normal| self.instance.world_normal(normal));
        let is_flipped = own.map_or(self.hit.is_backface, |own| own.dot(normal) < 0.0);
        let is_mirrored = self.instance.world_from_object.matrix3.determinant() < 0.0;
        let side = if is_flipped != is_mirrored { -1.0 } else { 1.0 };
        let bitangent = side * sign * normal.cross(tangent);
        (local.x * tangent + local.y * bitangent + local.z * normal).normalize_or(normal)
    }

    /// Returns the triangle's tangent along its texture coordinates, with the sign of the bitangent.
    fn tangent_of_uvs(&self, reference: &TextureRef) -> Option<Vec4> {
        let corners = self.mesh.triangles.triangle(self.hit.slot);
        let uvs = &self.mesh.uvs[reference.uv_set];
        let vertices = self.mesh.vertex_indices[self.hit.id as usize];
        let [a, b, c] = vertices.map(|vertex| uvs.get(vertex as usize).copied());
        let (to_b, to_c) = (b? - a?, c? - a?);
        let area = to_b.perp_dot(to_c);
        let edges = [corners[1] - corners[0], corners[2] - corners[0]];
        let tangent = (to_c.y * edges[0] - to_b.y * edges[1]) / area;
        // The second texture coordinate points down, the bitangent of a normal map up.
        let tangent = tangent.try_normalize()?;
        Some(tangent.extend(if area < 0.0 { 1.0 } else { -1.0 }))
    }
}

//! What a surface is made of where a ray has hit it: material, textures and the geometry's colours.

use crate::flat::{FlatGeometry, FlatMesh, FlatScene, Instance};
use crate::math::{Frame, Ray, Vec2, Vec3, Vec4};
use crate::scene::{AlphaMode, Encoding, TextureRef};
use crate::surface::SurfaceKind;
use crate::trace::SceneHit;

#[derive(Clone, Copy, Debug)]
pub struct Shading {
    pub position: Vec3,
    /// Unit, facing the viewer: for light.
    pub normal: Vec3,
    /// Unit, facing the viewer: for leaving the surface.
    pub facet: Vec3,
    /// Linear.
    pub base_color: Vec3,
    /// Share of the surface that is there.
    pub alpha: f32,
    pub metallic: f32,
    pub roughness: f32,
    pub ior: f32,
    pub transmission: f32,
    pub is_thin: bool,
    pub emission: Vec3,
    pub is_unlit: bool,
    /// Of the point, in world units; 0 for triangles.
    pub radius: f32,
    /// Of points.
    surface: Option<SurfaceKind>,
    /// How large coordinates are hereabouts, for roundings.
    reach: f32,
}

impl Shading {
    /// Of a hit that is no miss.
    #[inline]
    pub fn new(scene: &FlatScene, ray: &Ray, hit: &SceneHit) -> Self {
        let instance = &scene.instances[hit.instance as usize];
        let material = &scene.materials[instance.material as usize];
        let position = ray.at(hit.distance);
        let color = if material.ignores_colors { Vec3::ONE } else { hit.color };
        let mut shading = Self {
            position,
            normal: hit.normal,
            facet: hit.facet,
            base_color: material.base_color * color,
            alpha: material.alpha * hit.alpha,
            metallic: material.metallic,
            roughness: material.roughness,
            ior: material.ior,
            transmission: material.transmission,
            is_thin: material.is_thin,
            emission: material.emissive,
            is_unlit: material.is_unlit,
            radius: hit.radius,
            surface: None,
            reach: position.abs().max(ray.origin.abs()).max_element(),
        };
        match scene.geometry(instance) {
            FlatGeometry::Cloud(cloud) => shading.surface = Some(cloud.surface),
            FlatGeometry::Mesh(mesh) => {
                shading.add_textures(scene, &Place { mesh, hit, instance });
            }
        }
        shading.emission += material.glow * shading.base_color;
        shading.alpha = match material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(least) => f32::from(least <= shading.alpha),
            AlphaMode::Blend => shading.alpha.clamp(0.0, 1.0),
        };
        shading.face(ray.direction);
        shading
    }

    fn add_textures(&mut self, scene: &FlatScene, place: &Place) {
        let textures = &scene.materials[place.instance.material as usize].textures;
        let at = |reference: &TextureRef, encoding| {
            let uv = place.uv(reference.uv_set)?;
            Some(scene.textures[reference.texture].at(uv, reference, encoding))
        };
        let texel = |reference: &Option<TextureRef>, encoding| at(reference.as_ref()?, encoding);
        if let Some(texel) = texel(&textures.base_color, Encoding::Srgb) {
            self.base_color *= texel.truncate();
            self.alpha *= texel.w;
        }
        if let Some(texel) = texel(&textures.metallic_roughness, Encoding::Linear) {
            self.roughness *= texel.y;
            self.metallic *= texel.z;
        }
        if let Some(texel) = texel(&textures.emissive, Encoding::Srgb) {
            self.emission *= texel.truncate();
        }
        if let Some(texel) = texel(&textures.transmission, Encoding::Linear) {
            self.transmission *= texel.x;
        }
        if let Some((reference, scale)) = &textures.normal
            && let Some(texel) = at(reference, Encoding::Linear)
        {
            let local = (2.0 * texel.truncate() - 1.0) * Vec3::new(*scale, *scale, 1.0);
            self.normal = place.bumped(self.normal, local, reference);
        }
    }

    /// A normal that faces away, as those between corners may at a silhouette, is turned to the side.
    fn face(&mut self, direction: Vec3) {
        const LEAST: f32 = 1e-3;
        let away = self.normal.dot(direction);
        if -LEAST < away {
            self.normal = (self.normal - (away + LEAST) * direction).normalize_or(self.facet);
        }
    }

    /// Whether light goes on inside of what the surface is around.
    pub fn has_inside(&self) -> bool {
        0.0 < self.transmission && !self.is_thin
    }

    /// A ray that leaves on the side to which `direction` points and does not meet the surface again at once.
    pub fn spawn(&self, direction: Vec3) -> Ray {
        let is_outward = 0.0 <= self.facet.dot(direction);
        let side = if is_outward { self.facet } else { -self.facet };
        match self.surface {
            Some(surface) => surface.spawn_ray(self.position, side, self.radius, direction),
            None => {
                // A hit is off by a few roundings of the coordinates that went into it.
                let origin = self.position + 32.0 * f32::EPSILON * self.reach * side;
                Ray { t_min: 0.0, ..Ray::new(origin, direction) }
            }
        }
    }
}

/// A place on a triangle.
struct Place<'s> {
    mesh: &'s FlatMesh,
    hit: &'s SceneHit,
    instance: &'s Instance,
}

impl Place<'_> {
    fn at<T>(&self, column: &[T]) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let (b, c) = self.hit.shares;
        self.mesh.at(column, self.hit.slot, [1.0 - b - c, b, c])
    }

    fn uv(&self, set: usize) -> Option<Vec2> {
        self.at(&self.mesh.uvs[set])
    }

    /// `normal` bent by a normal map's `local` one.
    fn bumped(&self, normal: Vec3, local: Vec3, reference: &TextureRef) -> Vec3 {
        let tangent = self.at(&self.mesh.tangents).or_else(|| self.tangent_of_uvs(reference));
        let (along, sign) = match tangent {
            Some(tangent) => {
                let along = self.instance.world_from_object.transform_vector3(tangent.truncate());
                (along - along.dot(normal) * normal, 1f32.copysign(tangent.w))
            }
            None => (Frame::around(normal).tangent, 1.0),
        };
        let Some(along) = along.try_normalize() else { return normal };
        // Where the normal is turned, as on the back of a triangle, or space mirrored, left is not right.
        let own = self.at(&self.mesh.normals).map(|normal| self.instance.world_normal(normal));
        let is_turned = own.map_or(self.hit.is_inner, |own| own.dot(normal) < 0.0);
        let is_mirrored = self.instance.world_from_object.matrix3.determinant() < 0.0;
        let side = if is_turned != is_mirrored { -1.0 } else { 1.0 };
        let across = side * sign * normal.cross(along);
        (local.x * along + local.y * across + local.z * normal).normalize_or(normal)
    }

    /// Where texture coordinates run, of the triangle as a whole.
    fn tangent_of_uvs(&self, reference: &TextureRef) -> Option<Vec4> {
        let corners = self.mesh.triangles.triangle(self.hit.slot);
        let uvs = &self.mesh.uvs[reference.uv_set];
        let vertices = self.mesh.corners[self.hit.id as usize];
        let [a, b, c] = vertices.map(|vertex| uvs.get(vertex as usize).copied());
        let (to_b, to_c) = (b? - a?, c? - a?);
        let area = to_b.perp_dot(to_c);
        let edges = [corners[1] - corners[0], corners[2] - corners[0]];
        let tangent = (to_c.y * edges[0] - to_b.y * edges[1]) / area;
        // Coordinates run down a texture, normal maps up.
        let tangent = tangent.try_normalize()?;
        Some(tangent.extend(if area < 0.0 { 1.0 } else { -1.0 }))
    }
}

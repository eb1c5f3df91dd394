//! Geometry where it stands in the world, and the tree over all of it.

use crate::bvh::{self, NO_PRIMITIVE, Node, Primitive};
use crate::error::Result;
use crate::math::{Aabb, Affine3A, DAffine3, DVec3, LANES, Mat3, Ray, Vec3};
use crate::progress::Silent;

/// Geometry seen at one place. Coordinates of the world are relative to the scene's origin here.
#[derive(Clone, Debug)]
pub struct Instance {
    pub object_from_world: Affine3A,
    pub world_from_object: Affine3A,
    /// Turns normals: the inverse transpose, so that they stay upright where scales differ.
    pub world_from_normal: Mat3,
    /// What lengths along the object's axes grow by, at most.
    pub scale: f32,
    /// Whether object and world are the same.
    pub is_in_place: bool,
    /// Of the world.
    pub bounds: Aabb,
    pub geometry: u32,
    pub material: u32,
    /// Of the graph.
    pub node: u32,
    /// Whether light may go through it.
    pub is_see_through: bool,
}

/// Where geometry is to stand.
pub(super) struct Placement {
    pub world_from_object: DAffine3,
    /// Object coordinates of the zero of the geometry's own.
    pub object_origin: DVec3,
    /// Relative to that zero.
    pub object_bounds: Aabb,
    pub scene_origin: DVec3,
}

impl Instance {
    /// The first geometry, made of the first material, at a place; none where the transform is not finite or
    /// leaves no volume.
    pub(super) fn new(placement: Placement) -> Option<Self> {
        let Placement { world_from_object, object_origin, object_bounds, scene_origin } = placement;
        let matrix3 = world_from_object.matrix3;
        let translation = world_from_object.transform_point3(object_origin) - scene_origin;
        let place = DAffine3 { matrix3, translation };
        let inverse = place.inverse();
        if !(place.is_finite() && inverse.is_finite()) {
            return None;
        }
        let is_in_place = place == DAffine3::IDENTITY;
        let world_from_object = affine(place);
        let lengths = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis].map(DVec3::length);
        Some(Self {
            object_from_world: affine(inverse),
            world_from_object,
            world_from_normal: inverse.matrix3.transpose().as_mat3(),
            scale: lengths.into_iter().fold(0.0, f64::max) as f32,
            is_in_place,
            bounds: if is_in_place {
                object_bounds
            } else {
                moved(object_bounds, world_from_object)
            },
            geometry: 0,
            material: 0,
            node: 0,
            is_see_through: false,
        })
    }

    /// The ray in the object's coordinates, its direction unit again, and how many of the object's lengths
    /// make one of the world's along it.
    #[inline]
    pub fn object_ray(&self, ray: &Ray) -> (Ray, f32) {
        if self.is_in_place {
            return (*ray, 1.0);
        }
        let direction = self.object_from_world.transform_vector3(ray.direction);
        let scale = direction.length();
        let ray = Ray {
            origin: self.object_from_world.transform_point3(ray.origin),
            direction: direction / scale,
            t_min: ray.t_min * scale,
            t_max: ray.t_max * scale,
        };
        (ray, scale)
    }

    pub fn world_position(&self, position: Vec3) -> Vec3 {
        if self.is_in_place { position } else { self.world_from_object.transform_point3(position) }
    }

    pub fn world_normal(&self, normal: Vec3) -> Vec3 {
        if self.is_in_place { normal } else { (self.world_from_normal * normal).normalize() }
    }
}

/// Around the corners of a box, a little widened for rounding.
fn moved(object: Aabb, world_from_object: Affine3A) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| [object.min, object.max][i >> axis & 1][axis];
        world_from_object.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    };
    let bounds = Aabb::of_points((0..8).map(corner));
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    let rounding = Vec3::splat(8.0 * f32::EPSILON * reach);
    Aabb { min: bounds.min - rounding, max: bounds.max + rounding }
}

fn affine(place: DAffine3) -> Affine3A {
    Affine3A::from_mat3_translation(place.matrix3.as_mat3(), place.translation.as_vec3())
}

/// The tree over instances; blocks hold their indices.
#[derive(Clone, Debug, Default)]
pub struct TopTree {
    pub nodes: Vec<Node>,
    pub blocks: Vec<[u32; LANES]>,
}

impl TopTree {
    pub(super) fn new(instances: &[Instance]) -> Result<Self> {
        let primitive =
            |(i, instance): (usize, &Instance)| Primitive::new(instance.bounds, i as u32, 0.0);
        let tree =
            bvh::build(instances.iter().enumerate().map(primitive).collect(), |_| true, &Silent)?;
        let mut top = Self { nodes: tree.nodes, blocks: tree.blocks };
        let Self { nodes, blocks } = &mut top;
        bvh::fit_boxes(nodes, |block| {
            let members = blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE);
            members.map(|&i| instances[i as usize].bounds).fold(Aabb::EMPTY, Aabb::union)
        });
        Ok(top)
    }
}

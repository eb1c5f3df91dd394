//! Instances of geometry in the world, and the tree over all of them.

use crate::bvh::{self, Bvh, BvhPrimitive, NO_PRIMITIVE};
use crate::error::Result;
use crate::math::{Aabb, Affine3A, DAffine3, DVec3, Mat3, Ray, Vec3};
use crate::progress::NoProgress;

/// One occurrence of a geometry in the world. World coordinates are relative to the scene's origin here.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Transform from world to object coordinates.
    pub object_from_world: Affine3A,
    /// Transform from object to world coordinates.
    pub world_from_object: Affine3A,
    /// Inverse transpose of the object's transform, which keeps normals perpendicular under non-uniform scales.
    pub world_from_normal: Mat3,
    /// Largest scale factor along the object's axes.
    pub max_scale: f32,
    /// True if object and world coordinates are the same.
    pub is_identity: bool,
    /// Bounding box in world coordinates.
    pub bounds: Aabb,
    /// Index of the geometry in the flat scene.
    pub geometry_idx: u32,
    /// Index of the material in the flat scene.
    pub material_idx: u32,
    /// Index of the node in the graph.
    pub node_idx: u32,
    /// Index of the geometry in the graph, of which the flat scene has another for each node that deforms it.
    pub graph_geometry_idx: u32,
    /// True if light can pass through the material.
    pub is_transmissive: bool,
    /// True if the geometry is Gaussians, which emit light and have no surface.
    pub is_gaussian: bool,
}

/// The transform and bounds of an instance.
pub(super) struct Placement {
    /// Transform from object to world coordinates.
    pub world_from_object: DAffine3,
    /// Object coordinates of the origin of the geometry's coordinates.
    pub object_origin: DVec3,
    /// Bounding box relative to `object_origin`.
    pub object_bounds: Aabb,
    /// World coordinates of the scene's origin.
    pub scene_origin: DVec3,
}

impl Instance {
    /// Returns an instance of the first geometry with the first material. Returns none if the transform or
    /// its inverse is not finite as f32.
    pub(super) fn new(placement: Placement) -> Option<Self> {
        let Placement { world_from_object, object_origin, object_bounds, scene_origin } = placement;
        let matrix3 = world_from_object.matrix3;
        let translation = world_from_object.transform_point3(object_origin) - scene_origin;
        let transform = DAffine3 { matrix3, translation };
        let inverse = transform.inverse();
        let is_identity = transform == DAffine3::IDENTITY;
        let (world_from_object, object_from_world) = (to_f32(transform), to_f32(inverse));
        if !(world_from_object.is_finite() && object_from_world.is_finite()) {
            return None;
        }
        let lengths = [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis].map(DVec3::length);
        Some(Self {
            object_from_world,
            world_from_object,
            world_from_normal: inverse.matrix3.transpose().as_mat3(),
            max_scale: lengths.into_iter().fold(0.0, f64::max) as f32,
            is_identity,
            bounds: transformed_bounds(object_bounds, &world_from_object),
            geometry_idx: 0,
            material_idx: 0,
            node_idx: 0,
            graph_geometry_idx: 0,
            is_transmissive: false,
            is_gaussian: false,
        })
    }

    /// Transforms a ray to object coordinates, where its direction has unit length again. Returns it with the
    /// factor by which distances along it grow from the world to the object.
    #[inline]
    pub fn object_ray(&self, ray: &Ray) -> (Ray, f32) {
        if self.is_identity {
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

    /// Transforms a position from object to world coordinates.
    pub fn world_position(&self, position: Vec3) -> Vec3 {
        if self.is_identity { position } else { self.world_from_object.transform_point3(position) }
    }

    /// Transforms a unit normal from object to world coordinates, where it has unit length again.
    pub fn world_normal(&self, normal: Vec3) -> Vec3 {
        if self.is_identity { normal } else { (self.world_from_normal * normal).normalize() }
    }
}

/// Returns the world bounds of an object's bounding box, with a margin that exceeds the rounding errors of
/// transformed positions and of rays transformed back to the object.
fn transformed_bounds(object: Aabb, world_from_object: &Affine3A) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| [object.min, object.max][i >> axis & 1][axis];
        world_from_object.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    };
    let bounds = Aabb::of_points((0..8).map(corner));
    // The margin is relative to the summands, because their sum can be small if they cancel.
    let Affine3A { matrix3, translation } = world_from_object;
    let farthest = matrix3.abs() * object.min.abs().max(object.max.abs());
    let farthest = farthest + Vec3::from(translation.abs());
    let rounding = Vec3::splat(8.0 * f32::EPSILON * farthest.max_element());
    Aabb { min: bounds.min - rounding, max: bounds.max + rounding }
}

fn to_f32(transform: DAffine3) -> Affine3A {
    Affine3A::from_mat3_translation(transform.matrix3.as_mat3(), transform.translation.as_vec3())
}

/// Builds the tree over the bounding boxes of all instances. Its blocks hold indices of instances.
pub(super) fn build_tlas(instances: &[Instance]) -> Result<Bvh> {
    let primitive =
        |(i, instance): (usize, &Instance)| BvhPrimitive::new(instance.bounds, i as u32, 0.0);
    let mut tlas =
        bvh::build(instances.iter().enumerate().map(primitive).collect(), |_| true, &NoProgress)?;
    let Bvh { nodes, blocks } = &mut tlas;
    bvh::refit_boxes(nodes, |block| {
        let indices = blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE);
        indices.map(|&i| instances[i as usize].bounds).fold(Aabb::EMPTY, Aabb::union)
    });
    Ok(tlas)
}

#[cfg(test)]
mod tests {
    //! Bounds of instances far from the origin.

    use super::*;

    #[test]
    fn bounds_contain_the_corners_although_summands_cancel() {
        let object_bounds =
            Aabb { min: Vec3::splat(5e6), max: Vec3::splat(5e6) + Vec3::splat(9.0) };
        let rotation = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
        let middle = rotation.transform_point3(DVec3::splat(5e6 + 4.5));
        let world_from_object = DAffine3::from_translation(-middle) * rotation;
        let placement = Placement {
            world_from_object,
            object_origin: DVec3::ZERO,
            object_bounds,
            scene_origin: DVec3::ZERO,
        };
        let bounds = Instance::new(placement).unwrap().bounds;
        for i in 0..8 {
            let pick = |axis: usize| [object_bounds.min, object_bounds.max][i >> axis & 1][axis];
            let corner = DVec3::new(pick(0).into(), pick(1).into(), pick(2).into());
            let corner = world_from_object.transform_point3(corner).as_vec3();
            assert!(bounds.contains(Aabb { min: corner, max: corner }), "{bounds:?} {corner}");
        }
    }
}

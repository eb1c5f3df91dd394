//! Geometry where it stands in the world, and the tree over all of it.

use crate::bvh::{self, Bvh, NO_PRIMITIVE, Primitive};
use crate::error::Result;
use crate::math::{Aabb, Affine3A, DAffine3, DVec3, Mat3, Ray, Vec3};
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
            bounds: moved(object_bounds, &world_from_object),
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

/// Around a box where it stands, widened by more than the rounding there, and of rays that are taken back.
fn moved(object: Aabb, world_from_object: &Affine3A) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| [object.min, object.max][i >> axis & 1][axis];
        world_from_object.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    };
    let bounds = Aabb::of_points((0..8).map(corner));
    // Of what is added up: the sum may be small beside it.
    let Affine3A { matrix3, translation } = world_from_object;
    let farthest = matrix3.abs() * object.min.abs().max(object.max.abs());
    let farthest = farthest + Vec3::from(translation.abs());
    let rounding = Vec3::splat(8.0 * f32::EPSILON * farthest.max_element());
    Aabb { min: bounds.min - rounding, max: bounds.max + rounding }
}

fn affine(place: DAffine3) -> Affine3A {
    Affine3A::from_mat3_translation(place.matrix3.as_mat3(), place.translation.as_vec3())
}

pub(super) fn tree_over(instances: &[Instance]) -> Result<Bvh> {
    let primitive =
        |(i, instance): (usize, &Instance)| Primitive::new(instance.bounds, i as u32, 0.0);
    let mut top =
        bvh::build(instances.iter().enumerate().map(primitive).collect(), |_| true, &Silent)?;
    let Bvh { nodes, blocks } = &mut top;
    bvh::fit_boxes(nodes, |block| {
        let members = blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE);
        members.map(|&i| instances[i as usize].bounds).fold(Aabb::EMPTY, Aabb::union)
    });
    Ok(top)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_holds_its_corners_though_they_cancel() {
        let object_bounds =
            Aabb { min: Vec3::splat(5e6), max: Vec3::splat(5e6) + Vec3::splat(9.0) };
        let turn = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
        let middle = turn.transform_point3(DVec3::splat(5e6 + 4.5));
        let world_from_object = DAffine3::from_translation(-middle) * turn;
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

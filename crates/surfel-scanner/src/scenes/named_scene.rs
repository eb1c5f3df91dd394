//! Scenes whose objects have names, with cameras for them.

use crate::sdf::{Sdf, SdfScene};
use surfel_core::math::DVec3;

/// A scene whose SDFs belong to objects with names.
#[derive(Default)]
pub struct NamedScene {
    /// The SDFs.
    pub sdf: SdfScene,
    /// The kind of object that each SDF belongs to.
    pub object_names: Vec<&'static str>,
    /// Cameras that show the scene.
    pub views: Vec<SceneView>,
}

/// A camera for a scene; its up direction is +Z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneView {
    /// Position of the camera in the scene.
    pub position: DVec3,
    /// Position that the camera looks at.
    pub focal_point: DVec3,
    /// Vertical field of view in degrees.
    pub view_angle_deg: f64,
}

impl NamedScene {
    /// Adds an SDF of an object.
    pub fn add(&mut self, object_name: &'static str, sdf: impl Sdf + 'static) {
        self.sdf.add(sdf);
        self.object_names.push(object_name);
    }

    /// Adds a camera with a vertical field of view of 50 degrees.
    pub fn look(&mut self, position: [f64; 3], focal_point: [f64; 3]) {
        let [position, focal_point] = [position, focal_point].map(DVec3::from_array);
        self.views.push(SceneView { position, focal_point, view_angle_deg: 50.0 });
    }

    /// Returns the names of all kinds of objects, each once.
    pub fn object_kinds(&self) -> Vec<&'static str> {
        let mut kinds = Vec::new();
        for name in &self.object_names {
            if !kinds.contains(name) {
                kinds.push(*name);
            }
        }
        kinds
    }
}

#[cfg(test)]
pub mod checks {
    //! Properties that every scene has.

    use super::*;
    use crate::sdf::DRay;
    use surfel_core::math::Random;

    /// Panics unless every kind of object shows in one of the views and distances are never much too long: a step of
    /// sphere tracing must not pass through a surface.
    pub fn check(scene: &NamedScene) {
        let kinds = scene.object_kinds();
        let mut is_seen = vec![false; kinds.len()];
        let mut random = Random::new(5, 0);
        for view in &scene.views {
            for _ in 0..4000 {
                let spread = DVec3::from_array([(); 3].map(|()| random.next_gaussian()));
                let toward = view.focal_point - view.position;
                let direction = (toward + 0.25 * toward.length() * spread).normalize();
                let ray = DRay { origin: view.position, direction };
                let Some(hit) = scene.sdf.first_hit(&ray, 500.0) else { continue };
                let name = scene.object_names[hit.part_idx];
                is_seen[kinds.iter().position(|kind| *kind == name).unwrap()] = true;
                check_lipschitz(scene, hit.part_idx, &ray, hit.distance, &mut random);
            }
        }
        let unseen = kinds.iter().zip(&is_seen).filter(|(_, seen)| !**seen);
        assert_eq!(unseen.count(), 0, "{kinds:?} {is_seen:?}");
    }

    /// Panics if the distance of a point before the surface exceeds that to the surface.
    fn check_lipschitz(
        scene: &NamedScene,
        part_idx: usize,
        ray: &DRay,
        distance: f64,
        random: &mut Random,
    ) {
        let before = distance * random.next_f64();
        let bound = scene.sdf.part(part_idx).distance(ray.origin + before * ray.direction);
        let name = scene.object_names[part_idx];
        let gap = distance - before;
        assert!(bound <= 1.02 * gap + 1e-3, "{name}: {bound} where the surface is {gap} away");
    }
}

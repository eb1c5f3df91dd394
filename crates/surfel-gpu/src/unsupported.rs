//! The features of scenes that no kernel draws yet.

use crate::numbers::MAX_PLANES;
use crate::surface::Surface;
use surfel_core::flat::{FlatCloud, FlatGeometry, FlatScene};
use surfel_core::surface::SurfaceKind;

/// Returns what of a picture cannot be rendered on a GPU, in words; nothing if all can.
pub fn unsupported(scene: &FlatScene) -> Vec<String> {
    let mut found = Vec::new();
    let mut add = |is_found: bool, what: String| {
        if is_found && !found.contains(&what) {
            found.push(what);
        }
    };
    for instance in &scene.instances {
        if let FlatGeometry::Cloud(cloud) = scene.geometry(instance) {
            let is_traced = Surface::of_kind(cloud.surface, cloud).is_some();
            add(!is_traced && cloud.surface != SurfaceKind::Gaussian, surface_name(cloud));
        }
    }
    add(MAX_PLANES < scene.camera_planes.len(), format!("more than {MAX_PLANES} planes"));
    found
}

/// Returns the surface of a cloud in words.
pub fn surface_name(cloud: &FlatCloud) -> String {
    let without = if cloud.fits_balls() { " of points without normals" } else { "" };
    format!("the surface {}{without}", cloud.surface.name())
}

/// Returns the trees of a cloud with the kinds of surface that their points have.
pub fn trees(cloud: &FlatCloud) -> [(SurfaceKind, &surfel_core::flat::FlatPoints); 3] {
    [
        (cloud.surface, &cloud.points),
        (SurfaceKind::Capsule, &cloud.lines),
        (cloud.scatter_kind(), &cloud.scatter),
    ]
}

#[cfg(test)]
mod tests {
    //! Surfaces that no kernel traces have a name; all others are rendered.

    use super::*;
    use crate::test_support::{scene_of_points, scene_of_points_without_normals};

    #[test]
    fn surfaces_that_no_kernel_traces_are_named() {
        let found = |kind| unsupported(&scene_of_points(kind));
        assert_eq!(found(SurfaceKind::Points), ["the surface points"]);
        assert!(found(SurfaceKind::Splat).is_empty());
        assert!(found(SurfaceKind::SplatFit).is_empty());
    }

    #[test]
    fn fitted_planes_of_points_without_normals_are_named() {
        let found = |kind| unsupported(&scene_of_points_without_normals(kind));
        let expected = ["the surface splat-fit of points without normals"];
        assert_eq!(found(SurfaceKind::SplatFit), expected);
        assert!(found(SurfaceKind::Sphere).is_empty());
    }
}

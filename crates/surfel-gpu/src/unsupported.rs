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
            let kind = cloud.surface;
            let what = format!("the surface {}", kind.name());
            let is_traced = Surface::of_kind(kind, cloud).is_some();
            add(!is_traced && kind != SurfaceKind::Gaussian, what);
        }
    }
    add(MAX_PLANES < scene.camera_planes.len(), format!("more than {MAX_PLANES} planes"));
    found
}

/// Returns the trees of a cloud with the kinds of surface that their points have.
pub fn trees(cloud: &FlatCloud) -> [(SurfaceKind, &surfel_core::flat::FlatPoints); 3] {
    [
        (cloud.surface, &cloud.points),
        (SurfaceKind::Capsule, &cloud.lines),
        (SurfaceKind::Sphere, &cloud.scatter),
    ]
}

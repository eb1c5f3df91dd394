//! The features of scenes that no kernel draws yet.

use crate::records::MAX_PLANES;
use crate::shader::Surface;
use surfel_core::flat::{FlatCloud, FlatGeometry, FlatScene};
use surfel_core::scene::{AlphaMode, Light, Material, MaterialTextures};
use surfel_core::surface::SurfaceKind;

/// Maximum number of instances: each is a pass over all rays.
const MAX_INSTANCES: usize = 32;

/// Returns what of a picture cannot be rendered on a GPU, in words; nothing if all can.
pub fn unsupported(scene: &FlatScene) -> Vec<String> {
    let mut found = Vec::new();
    let mut add = |is_found: bool, what: String| {
        if is_found && !found.contains(&what) {
            found.push(what);
        }
    };
    for instance in &scene.instances {
        match scene.geometry(instance) {
            FlatGeometry::Mesh(_) => {}
            FlatGeometry::Cloud(cloud) => {
                let kind = cloud.surface;
                let what = format!("the surface {}{}", kind.name(), structure(kind));
                add(Surface::of_kind(kind).is_none(), what);
                add(cloud.options.changes(kind), "options of the surface".into());
                add(cloud.support_colors.is_some(), "colours by support".into());
            }
        }
        let material = &scene.materials[instance.material_idx as usize];
        add(is_specular(material), "materials that reflect or transmit".into());
        add(material.alpha_mode != AlphaMode::Opaque, "alpha".into());
        add(material.textures != MaterialTextures::default(), "textures".into());
    }
    let n_instances = scene.instances.len();
    add(MAX_INSTANCES < n_instances, format!("more than {MAX_INSTANCES} instances"));
    for light in &scene.lights {
        add(matches!(light, Light::Environment(_)), "environment maps".into());
    }
    add(MAX_PLANES < scene.camera_planes.len(), format!("more than {MAX_PLANES} planes"));
    found
}

/// Returns words for the structure of a surface that no kernel traverses.
fn structure(kind: SurfaceKind) -> &'static str {
    match kind {
        SurfaceKind::Implicit => " (a kd-tree)",
        SurfaceKind::Octree | SurfaceKind::OctreeSplat => " (an octree)",
        _ => "",
    }
}

/// True if light is reflected or refracted in single directions, which takes more than one ray for each camera ray.
fn is_specular(material: &Material) -> bool {
    material.metallic != 0.0 || material.ior != 1.0 || material.transmission != 0.0
}

/// Returns the trees of a cloud with the kinds of surface that their points have.
pub fn trees(cloud: &FlatCloud) -> [(SurfaceKind, &surfel_core::flat::FlatPoints); 3] {
    [
        (cloud.surface, &cloud.points),
        (SurfaceKind::Capsule, &cloud.lines),
        (SurfaceKind::Sphere, &cloud.scatter),
    ]
}

//! The complete description of a picture: nothing is left to be chosen from the data.

use super::appearance::{material_of_file, material_of_object};
use super::loaded::LoadedScene;
use super::{AutoSettings, description_camera};
use crate::description::{KeyedSettings, LightKind, ObjectDescription, SceneDescription};
use std::path::Path;
use surfel_core::scene::Light;
use surfel_core::scene::color::{ColorSource, choose_source};

/// Returns the description with everything that was chosen written into it. It makes the same picture, byte for byte.
pub fn complete_description(
    scene: &LoadedScene,
    auto: &AutoSettings,
    description: &SceneDescription,
) -> SceneDescription {
    let mut complete = description.clone();
    fill_defaults(&mut complete.picture);
    complete.objects_default.surface.surface.get_or_insert_default();
    complete.objects_default.surface.edge_test.get_or_insert_default();
    complete.light.exposure = Some(description.light.exposure());
    complete.world.up = Some(auto.up);
    complete.camera = description_camera(scene, auto, description);
    let color = &mut complete.objects_default.color.color;
    *color = color.clone().or_else(|| common_color(scene, description));
    complete_lights(&mut complete, auto);
    let of_files = file_objects(scene, description);
    let of_scene = description.objects.iter().map(|object| {
        let material = material_of_object(description, object).cloned();
        ObjectDescription { material, ..object.clone() }
    });
    complete.objects = of_files.chain(of_scene).collect();
    complete.files.clear();
    complete.materials.clear();
    complete
}

fn fill_defaults(settings: &mut dyn KeyedSettings) {
    for key in settings.keys() {
        if let (None, Some(default)) = (settings.get(key.name), &key.default) {
            // A default is valid by its own rule.
            let _ = settings.set(key.name, default, Path::new(""));
        }
    }
}

fn complete_lights(complete: &mut SceneDescription, auto: &AutoSettings) {
    complete.light.light = Some(complete.light.kinds()).filter(|kinds| !kinds.is_empty());
    (complete.sun, complete.sky) = Default::default();
    (complete.light.environment_rotation, complete.light.environment_strength) = (None, None);
    let original = &auto.description;
    if let ([Light::Headlight(_)], None) = (&auto.lights[..], &original.light.light) {
        complete.light.light = Some(vec![LightKind::Headlight]);
    }
    for light in &auto.lights {
        match light {
            Light::Sun(_) => {
                complete.sun = original.sun.clone();
                fill_defaults(&mut complete.sun);
                complete.sun.azimuth = Some(auto.sun_azimuth_deg);
            }
            Light::Sky(sky) => {
                complete.sky = original.sky.clone();
                fill_defaults(&mut complete.sky);
                complete.sky.ao_distance = Some(sky.ao_distance.into());
            }
            Light::Environment(_) => {
                complete.light.environment_rotation = Some(original.light.environment_rotation());
                complete.light.environment_strength = Some(original.light.environment_strength());
            }
            Light::Headlight(_) => {}
        }
    }
}

/// The colour of all clouds that leave it open, if it is the same.
fn common_color(scene: &LoadedScene, description: &SceneDescription) -> Option<ColorSource> {
    let open =
        scene.clouds().filter(|(i, _)| scene.settings_of(*i, description).color.color.is_none());
    let mut chosen = open.map(|(_, cloud)| choose_source(cloud).0);
    let first = chosen.next()?;
    chosen.all(|other| other == first).then_some(first)
}

/// The files without an object, as objects.
fn file_objects(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> impl Iterator<Item = ObjectDescription> {
    scene.file_groups().map(|files| {
        let mut object = ObjectDescription {
            files: files.iter().map(|file| file.to_path_buf()).collect(),
            merge: (1 < files.len()).then_some(true),
            ..ObjectDescription::default()
        };
        let last = files[files.len() - 1];
        object.material = material_of_file(description, last).map(|choice| choice.material.clone());
        object
    })
}

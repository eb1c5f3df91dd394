//! The complete description of a picture: nothing is left to be chosen from the data.

use super::appearance::{material_of_file, material_of_object};
use super::loaded::LoadedScene;
use super::{AutoSettings, description_camera};
use crate::description::{KeyedSettings, ObjectDescription, ObjectOverride, SceneDescription};
use std::path::Path;
use surfel_core::scene::color::ColorSource;

/// Returns the description with everything that was chosen written into it. It makes the same picture, byte for byte.
/// The lights of `description` are chosen already.
pub fn complete_description(
    scene: &LoadedScene,
    auto: &AutoSettings,
    description: &SceneDescription,
) -> SceneDescription {
    let mut complete = description.clone();
    complete.picture.fill_defaults();
    // Clouds of trained splats beside others choose their surface again.
    if !scene.clouds().any(|(_, cloud)| cloud.has_gaussians()) {
        complete.objects_default.surface.surface.get_or_insert_default();
    }
    complete.objects_default.surface.edge_test.get_or_insert_default();
    complete.light.exposure.get_or_insert_default();
    complete.world.up = Some(auto.up);
    complete.camera = description_camera(scene, auto, description);
    let color = &mut complete.objects_default.color.color;
    *color = color.take().or_else(|| Some(common_color(scene, description)?.0));
    let of_files = file_objects(scene, description);
    let of_scene = description.objects.iter().map(|object| ObjectDescription {
        material: material_of_object(description, object).cloned(),
        ..object.clone()
    });
    complete.objects = of_files.chain(of_scene).collect();
    complete.files.clear();
    (complete.materials, complete.overrides) = Default::default();
    complete.overrides.object_settings = labels_within_objects(scene, description);
    complete
}

/// Returns the colour of all clouds that leave it open, if it is the same, and the reason for the choice.
pub fn common_color(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> Option<(ColorSource, String)> {
    let open =
        scene.clouds().filter(|(i, _)| scene.settings_of(*i, description).color.color.is_none());
    let mut chosen = open.map(|(i, cloud)| scene.suitable_color(i, cloud, description));
    let (first, reason) = chosen.next()?;
    chosen.all(|(other, _)| other == first).then_some((first, reason))
}

/// The labels of files that are parts of one object.
fn labels_within_objects(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> Option<Vec<ObjectOverride>> {
    let several: Vec<Vec<&Path>> = scene.file_groups().filter(|files| 1 < files.len()).collect();
    let is_part = |one: &&ObjectOverride| several.iter().flatten().any(|file| one.names_file(file));
    let labels = description.overrides.all().iter().filter(|one| one.is_label()).filter(is_part);
    let labels: Vec<ObjectOverride> = labels.cloned().collect();
    (!labels.is_empty()).then_some(labels)
}

/// Returns the label of a file, if it has one.
fn label_of(description: &SceneDescription, file: &Path) -> Option<String> {
    let mut labels = description.overrides.all().iter().filter(|one| one.is_label());
    let label = labels.rfind(|one| one.names_file(file))?;
    Some(label.value.as_str()?.to_owned())
}

/// The files without an object, as objects.
fn file_objects(
    scene: &LoadedScene,
    description: &SceneDescription,
) -> impl Iterator<Item = ObjectDescription> {
    scene.file_groups().map(|files| {
        let material = files.last().and_then(|file| material_of_file(description, file));
        ObjectDescription {
            files: files.iter().map(|file| file.to_path_buf()).collect(),
            label: if files.len() == 1 { label_of(description, files[0]) } else { None },
            merge: (1 < files.len()).then_some(true),
            material: material.map(|choice| choice.material.clone()),
            ..ObjectDescription::default()
        }
    })
}

#[cfg(test)]
mod tests {
    //! The colours of a description are those of its picture.

    use crate::SceneDescription;
    use crate::memory_files::MemoryContent;
    use crate::resolve::resolve;
    use std::sync::Arc;
    use surfel_core::math::Vec3;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::Geometry;
    use surfel_core::scene::color::ColorSource;

    #[test]
    fn points_that_are_dropped_choose_no_colors() {
        // A plane with colours, and more points of noise that are black.
        let point = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0);
        let mut cloud = PointCloud::from_positions((0..1000).map(point).collect());
        let is_noise = |i: u32| 400 <= i;
        let color = |i: u32| if is_noise(i) { [0; 3] } else { [0x8080, 0x4040, 0x2020] };
        cloud.classification = Some((0..1000).map(|i| if is_noise(i) { 7 } else { 2 }).collect());
        cloud.colors = Some((0..1000).map(color).collect());
        let mut description = SceneDescription::of_files(["memory:plane"]);
        description.memory.insert("memory:plane", MemoryContent::Points(Arc::new(cloud), None));
        description.objects_default.color.gamma = Some(1.0);
        let resolved = resolve(&description, &NoProgress).unwrap();
        let chosen = resolved.description.objects_default.color.color;
        assert_eq!(chosen, Some(ColorSource::Rgb));
        let Geometry::Points(points) = &resolved.scene.graph.geometries[0] else { panic!() };
        assert!(points.colors().iter().all(|color| *color == [0x80, 0x40, 0x20]));
    }
}

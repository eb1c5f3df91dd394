//! Hashes of the parts of a description that decide what is read, prepared and built.

use crate::cache::hash_of;
use crate::description::{
    LightKind, ObjectDescription, PreparationSettings, SceneDescription, twins, write_parts,
};
use crate::resolve::AutoSettings;
use serde_json::{Value, json};
use std::path::PathBuf;

/// A hash of everything that decides how clouds are prepared.
pub fn preparation_key(description: &SceneDescription) -> u64 {
    let settings = &description.objects_default;
    let prepared = settings.preparation(0);
    let by_surface =
        (prepared.keep_variation, prepared.estimates_normals, prepared.structure.to_string());
    let [_, preparation, _] = settings.parts();
    let parts = json!([
        write_parts(&[preparation]),
        description.picture.seed(),
        by_surface,
        object_settings(description),
        grouping_key(description),
    ]);
    hash_of(&parts)
}

/// A hash of everything that decides which points are there.
pub fn filter_key(description: &SceneDescription) -> u64 {
    let scene = &description.objects_default.preparation;
    let objects = description.objects.iter().map(|object| &object.settings.preparation);
    let filters = std::iter::once(scene).chain(objects).map(PreparationSettings::filter_values);
    hash_of(&json!([filters.collect::<Vec<Value>>(), grouping_key(description)]))
}

/// A hash of everything that decides which files are read as one, which apart, and which geometries are shared.
pub fn grouping_key(description: &SceneDescription) -> u64 {
    let objects = description.objects.iter().zip(twins(&description.objects));
    let objects = objects.map(|(object, twin)| json!([object.files, twin]));
    // Of several clouds, those with a material of their own are apart.
    let choices = description.materials.choices();
    let has_material = |file: &&PathBuf| choices.iter().any(|choice| choice.names(file));
    let is_one_of_several = 1 < description.files.len();
    let with_material: Vec<&PathBuf> =
        description.files.iter().filter(|_| is_one_of_several).filter(has_material).collect();
    hash_of(&json!([description.files, with_material, objects.collect::<Vec<Value>>()]))
}

/// A hash of everything that decides what the trees hold.
pub fn tree_key(
    description: &SceneDescription,
    preparation: u64,
    auto: &AutoSettings,
    frames: &[usize],
) -> u64 {
    let light = &description.light;
    let is_lit = !light.has(LightKind::None) || light.environment.is_some();
    let planes = auto.hidden_walls.iter();
    let walls: Vec<[[f64; 3]; 2]> =
        planes.map(|plane| [plane.point.to_array(), plane.normal.to_array()]).collect();
    let parts = json!([
        preparation,
        write_parts(&description.objects_default.parts()),
        description.get("material"),
        description.objects.iter().map(ObjectDescription::visible).collect::<Vec<bool>>(),
        is_lit,
        auto.up.to_array(),
        walls,
        frames,
    ]);
    hash_of(&parts)
}

fn object_settings(description: &SceneDescription) -> Vec<Value> {
    let settings = description.objects.iter().map(|object| &object.settings);
    settings.map(|settings| Value::Object(write_parts(&settings.parts()))).collect()
}

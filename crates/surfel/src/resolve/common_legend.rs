//! The legend of a picture, in which clouds may have colours of their own.

use super::loaded::LoadedScene;
use crate::description::SceneDescription;
use surfel_core::math::Vec3;
use surfel_core::points::PreparedCloud;
use surfel_core::scene::color::{Legend, legend};

/// Returns the legend of the first shown cloud that has one, by the settings of its object. Legends of classes, and
/// those of labels of one name, are joined.
pub fn common_legend(
    scene: &LoadedScene,
    clouds: &[PreparedCloud],
    description: &SceneDescription,
    up: Vec3,
) -> Legend {
    let geometries = scene.clouds().map(|(i, _)| i).zip(clouds);
    let shown = geometries.filter(|(i, _)| scene.is_shown(*i, description));
    let legends = shown.filter_map(|(i, cloud)| {
        let found = legend(cloud, &scene.settings_of(i, description).coloring(up)).ok()?;
        (found != Legend::None).then_some(found)
    });
    let joined = legends.reduce(|first, other| match (first, other) {
        (Legend::Classes(mut classes), Legend::Classes(others)) => {
            classes.extend(others);
            classes.sort_unstable_by_key(|row| row.class);
            classes.dedup_by(|later, first| {
                let is_same = later.class == first.class;
                first.n_points += if is_same { later.n_points } else { 0 };
                is_same
            });
            Legend::Classes(classes)
        }
        (
            Legend::Labels { title, mut entries },
            Legend::Labels { title: other, entries: others },
        ) if title == other => {
            entries.extend(others);
            entries.sort_unstable();
            entries.dedup();
            Legend::Labels { title, entries }
        }
        (first, _) => first,
    });
    joined.unwrap_or(Legend::None)
}

#[cfg(test)]
mod tests {
    //! Legends of objects that are coloured in different ways.

    use super::*;
    use crate::memory_files::MemoryContent;
    use crate::resolve::KeepOptions;
    use serde_json::{Value, json};
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    /// Returns the legend of objects with these keys and the classes 2 and `classes[i]`, in a scene of a colour.
    fn legend_of(scene_color: &str, objects: &[Value], classes: &[u8]) -> Legend {
        let mut description = SceneDescription::default();
        description.set("color", &json!(scene_color), Path::new("")).unwrap();
        for (i, (keys, class)) in objects.iter().zip(classes).enumerate() {
            let corner = |n: u32| Vec3::new((n % 9) as f32, (n / 9) as f32, (n % 2) as f32);
            let mut cloud = PointCloud::from_positions((0..81).map(corner).collect());
            cloud.classification = Some((0..81).map(|n| [2, *class][n % 2]).collect());
            let name = format!("memory:{i}");
            description.memory.insert(&name, MemoryContent::Points(Arc::new(cloud), None));
            let mut table = keys.as_object().unwrap().clone();
            table.insert("file".into(), json!(name));
            description.add_object(&table, Path::new("")).unwrap();
        }
        let mut loaded =
            LoadedScene::read(&description, KeepOptions::default(), &NoProgress).unwrap();
        let clouds = loaded.take_prepared(&description, &NoProgress).unwrap();
        common_legend(&loaded, &clouds, &description, Vec3::Z)
    }

    fn classes(legend: Legend) -> Vec<u8> {
        match legend {
            Legend::Classes(classes) => classes.iter().map(|row| row.class).collect(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_object_has_the_legend_of_its_own_color() {
        let plain = json!({});
        let by_class = json!({ "color": "class" });
        let found = legend_of("normal", &[plain.clone(), by_class.clone()], &[9, 6]);
        assert_eq!(classes(found), [2, 6]);
        assert_eq!(legend_of("normal", std::slice::from_ref(&plain), &[9]), Legend::None);
        let found = legend_of("class", &[json!({ "color": "elevation" }), plain], &[9, 6]);
        assert!(
            matches!(found, Legend::Map { ref title, .. } if title == "elevation"),
            "{found:?}"
        );
        let hidden = json!({ "color": "elevation", "visible": false });
        assert_eq!(classes(legend_of("normal", &[hidden, by_class], &[9, 6])), [2, 6]);
    }

    #[test]
    fn classes_of_all_clouds_are_listed() {
        let plain = json!({});
        let found = legend_of("class", &[plain.clone(), plain.clone(), plain], &[9, 2, 6]);
        let Legend::Classes(rows) = &found else { panic!("{found:?}") };
        assert_eq!(rows.iter().map(|row| row.n_points).collect::<Vec<_>>(), [163, 40, 40]);
        assert_eq!(classes(found), [2, 6, 9]);
    }
}

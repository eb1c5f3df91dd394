//! One range of values for all clouds that a colour map colours alike, so that one legend holds for all of them.

use super::loaded::LoadedScene;
use crate::description::SceneDescription;
use std::borrow::Cow;
use surfel_core::image::Colormap;
use surfel_core::math::Vec3;
use surfel_core::points::PreparedCloud;
use surfel_core::progress::Progress;
use surfel_core::scene::color::{ColorSource, choose_source, common_range};

/// Clouds whose values are mapped to colours in the same way.
struct Group<'c> {
    source: ColorSource,
    colormap: Option<Colormap>,
    /// The clouds with the indices of their geometries.
    clouds: Vec<(usize, &'c PreparedCloud)>,
}

/// Returns the description with the range of each colour map written into it where it is open and several clouds have the
/// same source and map. The files of a sequence take the range of the first.
pub fn with_common_ranges<'d>(
    scene: &LoadedScene,
    clouds: &[PreparedCloud],
    description: &'d SceneDescription,
    up: Vec3,
    progress: &dyn Progress,
) -> Cow<'d, SceneDescription> {
    let groups = groups(scene, clouds, description);
    let is_sequence = |geometry: &usize| {
        scene.sequences.iter().any(|sequence| sequence.slots.geometries.contains(geometry))
    };
    let is_shared = |group: &Group| {
        1 < group.clouds.len() || group.clouds.iter().any(|(geometry, _)| is_sequence(geometry))
    };
    if !groups.iter().any(is_shared) {
        return Cow::Borrowed(description);
    }
    let is_of_file = |geometry: usize| scene.owner(geometry).is_none();
    let of_files = groups.iter().filter(|group| group.clouds.iter().any(|(i, _)| is_of_file(*i)));
    let n_of_files = of_files.count();
    let mut with_ranges = description.clone();
    for group in &groups {
        let shown = group.clouds.iter().filter(|(i, _)| scene.is_shown(*i, description));
        let shown: Vec<&_> = shown.map(|(_, cloud)| &***cloud).collect();
        let settings = scene.settings_of(group.clouds[0].0, description);
        let Some((range, line)) = common_range(&shown, &settings.coloring(up), &group.source)
        else {
            continue;
        };
        if is_shared(group) {
            progress.choice(&line, &["range"]);
        }
        for (geometry, _) in &group.clouds {
            match scene.owner(*geometry) {
                Some(object) => with_ranges.objects[object].settings.color.range = Some(range),
                // Files without an object have one range.
                None if n_of_files == 1 => with_ranges.objects_default.color.range = Some(range),
                None => {}
            }
        }
    }
    Cow::Owned(with_ranges)
}

/// Returns the clouds whose values are mapped to colours and whose range is open, by source and map.
fn groups<'c>(
    scene: &LoadedScene,
    clouds: &'c [PreparedCloud],
    description: &SceneDescription,
) -> Vec<Group<'c>> {
    let mut groups: Vec<Group> = Vec::new();
    for (geometry, cloud) in scene.clouds().map(|(i, _)| i).zip(clouds) {
        let color = scene.settings_of(geometry, description).color;
        let source = color.color.unwrap_or_else(|| choose_source(cloud).0);
        if !source.is_mapped() || color.range.is_some() {
            continue;
        }
        let colormap = color.cmap;
        let is_alike = |group: &&mut Group| group.source == source && group.colormap == colormap;
        match groups.iter_mut().find(is_alike) {
            Some(group) => group.clouds.push((geometry, cloud)),
            None => groups.push(Group { source, colormap, clouds: vec![(geometry, cloud)] }),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    //! Ranges of objects that are coloured alike and apart.

    use super::*;
    use crate::memory_files::MemoryContent;
    use crate::resolve::KeepOptions;
    use serde_json::{Value, json};
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    type Range = Option<(f64, f64)>;

    /// Returns the ranges of objects with these keys, the points of the i-th of which are `10 * i` high and higher.
    fn ranges(objects: &[Value]) -> Vec<Range> {
        let mut description = SceneDescription::default();
        description.set("color", &json!("elevation"), Path::new("")).unwrap();
        for (i, keys) in objects.iter().enumerate() {
            let height = |n: u32| 10.0 * i as f32 + (n % 9) as f32;
            let point = |n: u32| Vec3::new((n % 9) as f32, (n / 9) as f32, height(n));
            let mut cloud = PointCloud::from_positions((0..81).map(point).collect());
            cloud.intensity = Some((0..81).map(|n| n as f32).collect());
            let name = format!("memory:{i}");
            description.memory.insert(&name, MemoryContent::Points(Arc::new(cloud), None));
            let mut table = keys.as_object().unwrap().clone();
            table.insert("file".into(), json!(name));
            description.add_object(&table, Path::new("")).unwrap();
        }
        let keep = KeepOptions::default();
        let mut loaded = LoadedScene::read(&description, keep, &NoProgress).unwrap();
        let clouds = loaded.take_prepared(&description, &NoProgress).unwrap();
        let found = with_common_ranges(&loaded, &clouds, &description, Vec3::Z, &NoProgress);
        found.objects.iter().map(|object| object.settings.color.range).collect()
    }

    #[test]
    fn clouds_of_one_map_have_one_range() {
        let plain = json!({});
        let by_intensity = json!({ "color": "intensity" });
        let red = json!({ "color": "red" });
        let found = ranges(&[plain.clone(), by_intensity.clone(), plain.clone(), red.clone()]);
        let Some((low, high)) = found[0] else { panic!("no range") };
        assert!(low < 1.0 && 27.0 < high, "{low} {high}");
        assert_eq!((found[2], found[3]), (found[0], None));
        assert!(found[1].is_some_and(|(_, high)| 70.0 < high), "{found:?}");
        // Clouds of other maps and with ranges of their own have nothing in common.
        let own =
            [json!({ "range": [0, 1] }), json!({ "cmap": "turbo" }), plain, by_intensity, red];
        assert_eq!(ranges(&own), [Some((0.0, 1.0)), None, None, None, None]);
    }
}

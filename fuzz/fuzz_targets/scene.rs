//! Fuzzes scene descriptions: JSON if the first byte is odd, TOML otherwise. What is read is written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use surfel::SceneDescription;
use surfel_core::scene::Track;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, text)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    let folder = Path::new("/no/such/folder");
    let Ok(scene) = SceneDescription::parse(text, first % 2 == 1, folder) else { return };
    let again = SceneDescription::from_table(&scene.to_table(), folder).unwrap();
    assert_eq!(again, scene);
    for object in &scene.objects {
        assert!(!object.files.is_empty());
        let placements = object.instances.iter().chain([&object.placement]);
        assert!(placements.map(|p| p.transform().unwrap().matrix()).all(|m| m.is_finite()));
        object.material.iter().for_each(|material| _ = material.material());
    }
    assert!(scene.lamps.iter().all(|lamp| lamp.node().unwrap().transform.matrix().is_finite()));
    // Animated values are finite at and around every key.
    let animations = scene.animations.iter().filter(|animation| !animation.is_of_camera());
    let tracks = animations.flat_map(|animation| animation.object_motion().unwrap().tracks);
    for track in tracks.take(50) {
        let times = track.times_secs();
        assert!(times.is_sorted() && times.iter().all(|time| time.is_finite()));
        for time in times.iter().take(20).flat_map(|time| [time - 1e-3, *time, time + 1e-3]) {
            assert!(match &track {
                Track::Translation(keys) | Track::Scale(keys) => keys.at(time).is_finite(),
                Track::Rotation(keys) => keys.at(time).is_finite(),
                Track::MorphWeights(_) | Track::Visible(_) => true,
            });
        }
    }
});

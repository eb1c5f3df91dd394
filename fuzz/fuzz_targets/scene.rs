//! Any text as a scene file: TOML, or JSON where the first byte is odd.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use surfel::scene::Track;
use surfel_cli::scene_file::SceneFile;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, text)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(text) else { return };
    let Ok(scene) = SceneFile::parse(text, first % 2 == 1, Path::new("/no/such/folder")) else {
        return;
    };
    for object in &scene.objects {
        assert!(!object.files.is_empty());
        let places = object.copies.iter().chain([&object.transform]);
        assert!(places.map(|place| place.matrix()).all(|matrix| matrix.is_finite()));
    }
    assert!(scene.lamps.iter().all(|node| node.transform.matrix().is_finite()));
    // At every key and between them, what moves is somewhere.
    let tracks = scene.motions.iter().flat_map(|motion| &motion.tracks);
    for track in tracks.take(50) {
        let times = track.times_secs();
        assert!(times.is_sorted() && times.iter().all(|time| time.is_finite()));
        for time in times.iter().take(20).flat_map(|time| [time - 1e-3, *time, time + 1e-3]) {
            assert!(match track {
                Track::Translation(keys) | Track::Scale(keys) => keys.at(time).is_finite(),
                Track::Rotation(keys) => keys.at(time).is_finite(),
                Track::MorphWeights(_) | Track::Visible(_) => true,
            });
        }
    }
});

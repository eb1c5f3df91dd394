//! Fuzzes areas whose points are kept: as text of an option, and as a file of polygons.
#![no_main]

use std::fs;
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use surfel::SceneDescription;
use surfel::description::Crop;
use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, PointFilter};

fuzz_target!(|bytes: &[u8]| {
    let file = std::env::temp_dir().join(format!("surfel-fuzz-area-{}", std::process::id()));
    fs::write(&file, bytes).unwrap();
    if let Ok(filter) = Crop::File(file).filter() {
        check(&filter);
    }
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let scene = serde_json::json!({ "crop": text }).to_string();
    let Ok(scene) = SceneDescription::parse(&scene, true, Path::new("/no/such/folder")) else {
        return;
    };
    match &scene.objects_default.preparation.crop {
        Some(Crop::File(_)) | None => {}
        Some(area) => check(&area.filter().unwrap()),
    }
});

/// Checks that a filter keeps the same points whether they are alone or among others.
fn check(filter: &PointFilter) {
    let points = [[0.5, 0.5, 0.0], [1.0, 0.0, 3.0], [-7.0, 2.0, 1e9], [f32::NAN, 0.0, 1.0]];
    let points: Vec<Vec3> = points.map(Vec3::from_array).to_vec();
    let cloud = PointCloud::from_positions(points.clone());
    let all = filter.matches(&cloud, 0).unwrap();
    for (point, is_kept) in points.into_iter().zip(all) {
        let single = PointCloud::from_positions(vec![point]);
        assert_eq!(filter.matches(&single, 0).unwrap(), [is_kept]);
    }
}

//! Clouds that are written as text: headers, digits, and columns that read back equal.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_formats::{SaveOptions, check_cloud_output, save, writable_extensions};

use crate::common::{
    Folder, Listener, colors_in_file, encode_cloud, full_cloud, largest_difference, round_trip,
};

fn text(cloud: &PointCloud, extension: &str) -> String {
    String::from_utf8(encode_cloud(cloud, extension)).unwrap()
}

/// Returns a cloud whose coordinates are the f32 of a file.
fn small_cloud() -> PointCloud {
    PointCloud {
        colors: Some(vec![[0, 128 * 257, 65535], [257, 514, 771]]),
        intensity: Some(vec![7.0, 0.5]),
        ..PointCloud::from_positions(vec![Vec3::new(0.1, -2.0, 1e-3), Vec3::new(1e9, 0.25, -0.0)])
    }
}

#[test]
fn each_form_has_its_first_line_and_order() {
    let cloud = small_cloud();
    let spaces = "//X Y Z R G B Intensity\n0.1 -2 0.001 0 128 255 7\n1000000000 0.25 0 1 2 3 0.5\n";
    for extension in ["xyz", "txt", "asc"] {
        assert_eq!(text(&cloud, extension), spaces, "{extension}");
    }
    let csv = "x,y,z,red,green,blue,intensity\n0.1,-2,0.001,0,128,255,7\n";
    assert!(text(&cloud, "csv").starts_with(csv), "{}", text(&cloud, "csv"));
    let pts = "2\n0.1 -2 0.001 7 0 128 255\n1000000000 0.25 0 0.5 1 2 3\n";
    assert_eq!(text(&cloud, "pts"), pts);
    assert_eq!(text(&PointCloud::default(), "xyz"), "//X Y Z\n");
}

#[test]
fn every_column_of_text_round_trips() {
    for n in [1, 2, 120_000] {
        let mut cloud = full_cloud(n);
        cloud.scalars[2].name = "two, \"quoted\" words".into();
        for extension in ["xyz", "txt", "asc", "csv"] {
            let options =
                SaveOptions { resolution: Some(DVec3::splat(0.001)), ..Default::default() };
            let back = round_trip(&cloud, extension, &options).cloud;
            assert!(largest_difference(&cloud, &back).max_element() < 1e-4, "{extension} {n}");
            assert!(back.normals == cloud.normals, "{extension} {n}");
            assert!(back.radii == cloud.radii, "{extension} {n}");
            assert!(back.colors == colors_in_file(&cloud, extension), "{extension} {n}");
            assert!(back.intensity == cloud.intensity, "{extension} {n}");
            assert!(back.classification == cloud.classification, "{extension} {n}");
            assert_eq!(back.scalars.len(), cloud.scalars.len());
            for (found, expected) in back.scalars.iter().zip(&cloud.scalars) {
                // Scalars of text are f64, and those of f32 have the digits of f32.
                let is_equal = |i| found.values.get(i) as f32 == expected.values.get(i) as f32;
                assert!((0..n).all(is_equal), "{extension} {n} {}", expected.name);
            }
            assert_eq!(back.scalars[2].name, "two___quoted__words");
        }
    }
}

#[test]
fn pts_holds_intensity_and_colour_and_names_the_rest() {
    let folder = Folder::new("pts-output");
    let (path, listener) = (folder.path("a.pts"), Listener::default());
    let cloud = full_cloud(1000);
    save(&path, &cloud, &SaveOptions::default(), &listener).unwrap();
    assert!(listener.has_note("left out: normals, radii, classes, return_number, gps_time"));
    assert!(listener.has_note("colours of 16 bits are rounded to 8"));
    let back = round_trip(&cloud, "pts", &SaveOptions::default()).cloud;
    assert_eq!((back.len(), &back.intensity), (1000, &cloud.intensity));
    assert_eq!(back.colors, colors_in_file(&cloud, "pts"));
}

#[test]
fn coordinates_have_the_digits_of_their_source_and_no_more() {
    let mut cloud = PointCloud::from_positions(vec![Vec3::new(0.123, 10.5, -300.25)]);
    cloud.origin = DVec3::new(500_000.0, 4_900_000.0, 0.0);
    assert_eq!(text(&cloud, "xyz"), "//X Y Z\n500000.123 4900010.5 -300.25\n");
    let line = |step: f64| {
        let folder = Folder::new(&format!("digits-{step}"));
        let resolution = Some(DVec3::splat(step));
        let options = SaveOptions { resolution, ..SaveOptions::default() };
        save(&folder.path("a.xyz"), &cloud, &options, &NoProgress).unwrap();
        let text = std::fs::read_to_string(folder.path("a.xyz")).unwrap();
        text.lines().nth(1).unwrap().to_owned()
    };
    assert_eq!(line(0.01), "500000.12 4900010.50 -300.25");
    assert_eq!(line(0.00025), "500000.12300 4900010.50000 -300.25000");
    assert_eq!(line(1.0), "500000 4900011 -300");
    // The stated step is finer than f32 resolves 10 and 300 units from the origin.
    assert_eq!(line(1e-9), "500000.12300000 4900010.500000 -300.25000");
}

#[test]
fn failed_writes_of_text_keep_the_old_file() {
    let folder = Folder::new("text-output");
    let path = folder.path("a.csv");
    std::fs::write(&path, "old").unwrap();
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    save(&path, &full_cloud(10), &SaveOptions::default(), &listener).unwrap_err();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(folder.names(), ["a.csv"]);
}

#[test]
fn messages_list_the_extensions_that_can_be_written() {
    let error = check_cloud_output(std::path::Path::new("a.e57")).unwrap_err().to_string();
    for extension in [".ply", ".las", ".laz", ".xyz", ".txt", ".csv", ".asc", ".pts"] {
        assert!(error.contains(extension), "{error}");
    }
    assert!(writable_extensions("or").ends_with(".asc or .pts"));
}

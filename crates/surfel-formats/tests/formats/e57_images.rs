//! Pictures and bounds that E57 files state.

use std::io::Cursor;

use e57::{
    E57Writer, ImageFormat, PinholeImageProperties, Quaternion, Record, RecordValue,
    SphericalImageProperties, Transform, Translation, VisualReferenceImageProperties,
};
use surfel_core::math::DVec3;
use surfel_formats::{EmbeddedImage, FileInfo, ImageCamera, inspect};

use crate::common::{Folder, shared};
use crate::e57_writer::{replace, small_file};

/// Returns the information in a file; each test has a folder of its own.
fn inspected(test: &str, bytes: &[u8]) -> FileInfo {
    let folder = Folder::new(test);
    let path = folder.path("a.e57");
    std::fs::write(&path, bytes).unwrap();
    inspect(&path).unwrap()
}

#[test]
fn bounds_are_those_of_all_scans_in_the_world() {
    let [low, high] = inspected("e57-bounds", &small_file()).bounds.unwrap();
    // The hall spans (0, 0, -4) to (7, 2, 1.02), and its quarter turn takes x to y and y to -x.
    assert!(low.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-6, "{low}");
    assert!(high.distance(DVec3::new(500_000.0, 4_900_007.0, 11.02)) < 1e-6, "{high}");
    // One of the two scans does not state its bounds.
    let unknown = replace(&small_file(), "<xMinimum", "<xMinimim");
    let unknown = replace(&unknown, "</xMinimum", "</xMinimim");
    assert_eq!(inspected("e57-bounds", &unknown).bounds, None);
}

#[test]
fn pictures_are_listed_with_camera_size_and_scan() {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    let axes = vec![Record::CARTESIAN_X_F32, Record::CARTESIAN_Y_F32, Record::CARTESIAN_Z_F32];
    let mut scan = writer.add_pointcloud("guid of the hall", axes).unwrap();
    scan.set_name(Some("hall".into()));
    scan.add_point([1.0, 2.0, 3.0].map(RecordValue::Single).to_vec()).unwrap();
    scan.finalize().unwrap();

    let mut image = writer.add_image("first").unwrap();
    image.set_name("north");
    image.set_pointcloud_guid("guid of the hall");
    image.set_transform(Transform {
        rotation: Quaternion::default(),
        translation: Translation { x: 5e5, y: -2.0, z: 1.5 },
    });
    let properties = PinholeImageProperties {
        width: 640,
        height: 480,
        focal_length: 0.01,
        pixel_width: 1e-5,
        pixel_height: 1e-5,
        principal_x: 320.0,
        principal_y: 240.0,
    };
    image.add_pinhole(ImageFormat::Jpeg, &mut &[7; 99][..], properties, None).unwrap();
    image.finalize().unwrap();
    let mut image = writer.add_image("second").unwrap();
    let properties =
        SphericalImageProperties { width: 20, height: 10, pixel_width: 0.3, pixel_height: 0.3 };
    image.add_spherical(ImageFormat::Png, &mut &[7; 5][..], properties, None).unwrap();
    let properties = VisualReferenceImageProperties { width: 2, height: 1 };
    image.add_visual_reference(ImageFormat::Png, &mut &[7; 3][..], properties, None).unwrap();
    image.finalize().unwrap();
    writer.finalize().unwrap();
    drop(writer);

    let north = EmbeddedImage {
        name: "north".into(),
        camera: ImageCamera::Pinhole,
        width: 640,
        height: 480,
        n_bytes: 99,
        position: Some(DVec3::new(5e5, -2.0, 1.5)),
        scan: Some("hall".into()),
    };
    let panorama = EmbeddedImage {
        name: "image 2".into(),
        camera: ImageCamera::Spherical,
        width: 20,
        height: 10,
        n_bytes: 5,
        position: None,
        scan: None,
    };
    assert_eq!(inspected("e57-images", &bytes.into_inner()).images, [north, panorama]);
}

#[test]
fn a_real_scan_states_its_bounds_and_picture() {
    let Some(path) = shared("clouds/pumpA.e57") else { return };
    let info = inspect(&path).unwrap();
    let [low, high] = info.bounds.unwrap();
    assert!(low.distance(DVec3::new(-2.9, -5.3, -1.9)) < 0.2, "{low}");
    assert!(high.distance(DVec3::new(1.7, -0.8, 1.8)) < 0.2, "{high}");
    assert_eq!(info.images.len(), 1);
    assert_eq!(info.images[0].camera, ImageCamera::VisualReference);
}

//! BIN files: records of floats without a header, which are told by their values.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::progress::NoProgress;
use surfel_formats::{Column, ColumnChoice, LoadOptions, inspect, load, load_bytes};

use crate::common::{Folder, read};

fn file(records: &[[f32; 7]]) -> Vec<u8> {
    records.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn records_are_read_bit_exactly() {
    let n = 70_000;
    let normal = |i: usize| Vec3::new(i as f32, 1.0, -3.0).normalize();
    let record = |i: usize| {
        let Vec3 { x, y, z } = normal(i);
        [0.1 * i as f32, -1.0 / (i + 1) as f32, 7.0, 0.01 + 1e-5 * i as f32, x, y, z]
    };
    let cloud = read("a.bin", file(&(0..n).map(record).collect::<Vec<_>>())).unwrap().cloud;
    assert_eq!((cloud.len(), cloud.origin), (n, DVec3::ZERO));
    let (normals, radii) = (cloud.normals.unwrap(), cloud.radii.unwrap());
    for i in 0..n {
        let [x, y, z, radius, ..] = record(i);
        assert_eq!(cloud.positions[i], Vec3::new(x, y, z), "{i}");
        assert_eq!((normals[i], radii[i]), (normal(i), radius), "{i}");
    }
}

#[test]
fn inspect_reports_points_and_columns() {
    let folder = Folder::new("bin");
    let path = folder.path("A.BIN");
    std::fs::write(&path, file(&[[1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 1.0]; 3])).unwrap();
    let info = inspect(&path).unwrap();
    assert_eq!((info.format.as_str(), info.n_points), ("BIN, records of 7 f32", Some(3)));
    assert_eq!(info.columns, ["x", "y", "z", "radius", "nx", "ny", "nz"]);
    assert_eq!(load(&path, &LoadOptions::default(), &NoProgress).unwrap().info, info);
}

#[test]
fn only_requested_columns_are_loaded() {
    let columns = ColumnChoice::Only(vec![Column::Radii]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    let bytes = file(&[[1.0, 2.0, 3.0, 0.5, 0.0, 0.0, 1.0]]);
    let cloud = load_bytes("a.bin", &bytes, &options, &NoProgress).unwrap().cloud;
    assert_eq!((cloud.normals, cloud.radii), (None, Some(vec![0.5])));
}

#[test]
fn returns_of_a_spinning_scanner_are_told_by_their_values() {
    // 7 * 4 * 5 records, so that all lengths fit.
    let point = |i: usize| {
        let (sin, cos) = (0.3 * i as f32).sin_cos();
        [12.0 * cos, 12.0 * sin, 0.01 * i as f32 - 1.7]
    };
    let intensity = |i: usize| (i % 10) as f32 / 10.0;
    let floats =
        |values: Vec<f32>| -> Vec<u8> { values.into_iter().flat_map(f32::to_le_bytes).collect() };
    let kitti = (0..140).flat_map(|i| [&point(i)[..], &[intensity(i)]].concat());
    let loaded = read("000000.bin", floats(kitti.collect())).unwrap();
    assert_eq!(loaded.info.format, "BIN, records of 4 f32");
    assert_eq!(loaded.info.columns, ["x", "y", "z", "intensity"]);
    assert_eq!((loaded.cloud.len(), loaded.cloud.normals.is_none()), (140, true));
    assert_eq!(loaded.cloud.positions[139], Vec3::from(point(139)));
    let laser = |i: usize| (i % 32) as f32;
    let nuscenes =
        (0..140).flat_map(|i| [&point(i)[..], &[100.0 * intensity(i), laser(i)]].concat());
    let loaded = read("lidar.pcd.bin", floats(nuscenes.collect())).unwrap();
    assert_eq!(loaded.info.columns, ["x", "y", "z", "intensity", "ring"]);
    assert_eq!(loaded.cloud.positions[77], Vec3::from(point(77)));
    assert_eq!(loaded.cloud.scalar("ring").unwrap().get(77), 13.0);
    let surfels = (0..140).flat_map(|i| [&point(i)[..], &[0.1, 0.0, 0.6, 0.8]].concat());
    let loaded = read("a.bin", floats(surfels.collect())).unwrap();
    assert_eq!(loaded.info.format, "BIN, records of 7 f32");
}

#[test]
fn large_coordinates_get_an_origin() {
    let cloud = read("a.bin", file(&[[5e6, 1e7, 2.5, 1.0, 0.0, 0.0, 1.0]; 2])).unwrap().cloud;
    assert_eq!(cloud.world_position(0), DVec3::new(5e6, 1e7, 2.5));
    assert_eq!(cloud.origin, DVec3::new(5e6, 1e7, 0.0));
}

#[test]
fn non_finite_values_are_kept_for_cleaning() {
    let records = [[f32::NAN, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 2.0, 0.0, 3.0, 0.0]];
    let cloud = read("a.bin", file(&records)).unwrap().cloud;
    assert!(cloud.positions[0].is_nan() && cloud.positions[1] == Vec3::ONE);
    assert_eq!(cloud.radii.unwrap(), [-1.0, 2.0]);
    assert_eq!(cloud.normals.unwrap(), [Vec3::ZERO, 3.0 * Vec3::Y]);
}

#[test]
fn a_partial_record_is_an_error() {
    let bytes = file(&[[1.0; 7]; 2]);
    let error = read("a.bin", &bytes[..47]).unwrap_err().to_string();
    assert_eq!(
        error,
        "a.bin: byte 28: found a record of 19 bytes, expected 28: x y z radius nx ny nz, 20: x y z \
         intensity ring, or 16: x y z intensity, as little-endian f32; copy the file again from its source, or convert it if it has other records"
    );
    let far = file(&[[5e6, 1e7, 2.5, 1.0, 5e6, 1e7, 2.5]; 40]);
    let error = read("a.bin", &far[..69 * 16]).unwrap_err().to_string();
    assert!(error.contains("fit no known records"), "{error}");
    let positions = file(&[[5e6, 1e7, 2.5, 1.0, 5e6, 1e7, 2.5]; 70]);
    let error = read("a.bin", &positions).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("a normal of length 1"), "{error}");
    assert!(read("a.bin", "").unwrap_err().to_string().contains("an empty file"));
    // These coordinate bits begin with the magic bytes of gzip.
    let coordinate = f32::from_bits(0x3f00_8b1f);
    assert_eq!(read("a.bin", file(&[[coordinate; 7]])).unwrap().cloud.positions[0].x, coordinate);
}

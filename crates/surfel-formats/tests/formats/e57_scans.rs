//! E57 files: poses, encodings of numbers, invalid points, normals, and broken files.

use e57::{E57Reader, Record, RecordDataType, RecordName, RecordValue};
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{STATION, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{
    Column, ColumnChoice, Error, LoadOptions, inspect, inspect_bytes, load, load_bytes,
};

use crate::common::{Folder, Listener, read, shared};
use crate::e57_writer::{Scan, replace, small_file, with_checksums, write};

fn record(name: RecordName, data_type: RecordDataType) -> Record {
    Record { name, data_type }
}

/// Returns the fields of a point: its coordinates and further ones.
fn prototype<const N: usize>(further: [Record; N]) -> Vec<Record> {
    let axes = [Record::CARTESIAN_X_F64, Record::CARTESIAN_Y_F64, Record::CARTESIAN_Z_F64];
    axes.into_iter().chain(further).collect()
}

#[test]
fn scans_are_moved_to_world_coordinates() {
    let loaded = read("a.e57", small_file()).unwrap();
    let cloud = loaded.cloud;
    // The integers mean 0.01 each above 1, and the quarter turn takes x to y.
    let expected = [
        DVec3::new(500_000.0 - 2.0, 4_900_000.0 + 1.0, 10.0 - 4.0),
        DVec3::new(500_000.0 - 1.01, 4_900_000.0 + 7.0, 10.0 + 1.02),
        DVec3::new(500_000.0, 4_900_000.0, 10.0),
        DVec3::new(1.0, 2.0, 3.0),
        DVec3::new(4.0, 5.0, 6.0),
    ];
    for (i, expected) in expected.into_iter().enumerate() {
        let difference = (cloud.world_position(i) - expected).abs().max_element();
        // The second scan is far from the origin of the first.
        let tolerance = if i < 3 { 1e-6 } else { 0.5 };
        assert!(difference < tolerance, "{i}: {difference}");
    }
    assert_eq!(cloud.colors.as_ref().unwrap()[3], [65535, 0, 128 * 257]);
    assert_eq!(cloud.scalar(STATION), Some(&Values::U16(vec![0, 0, 0, 1, 1])));
    let (hall, yard) = (cloud.station_of(2).unwrap(), cloud.station_of(3).unwrap());
    assert_eq!((hall.name.as_str(), yard.name.as_str()), ("hall", "yard"));
    assert_eq!(hall.position, Some(DVec3::new(500_000.0, 4_900_000.0, 10.0)));
    assert_eq!(yard.position, None);
    assert!((hall.rotation * DVec3::X).distance(DVec3::Y) < 1e-6, "{}", hall.rotation);
}

#[test]
fn a_field_named_station_is_not_taken_for_the_stations_of_points() {
    let scan = |name| Scan {
        name,
        pose: None,
        prototype: prototype([record(
            RecordName::Unknown { namespace: "nor".into(), name: "station".into() },
            RecordDataType::Integer { min: 0, max: 1000 },
        )]),
        points: vec![[vec![RecordValue::Double(1.0); 3], vec![RecordValue::Integer(7)]].concat()],
    };
    let cloud = read("a.e57", write(&[scan("hall"), scan("yard")])).unwrap().cloud;
    assert_eq!(cloud.scalar(STATION), Some(&Values::U16(vec![0, 1])));
    assert_eq!(cloud.scalars.len(), 1);
    let single = read("a.e57", write(&[scan("hall")])).unwrap().cloud;
    assert_eq!(single.station_of(0).unwrap().name, "hall");
}

#[test]
fn an_extension_stands_beside_the_standard_field_of_its_meaning() {
    let field = |name| {
        let data_type = RecordDataType::Integer { min: -100, max: 1000 };
        record(name, data_type)
    };
    let reflectance = RecordName::Unknown { namespace: "nor".into(), name: "reflectance".into() };
    let values = [RecordValue::Integer(-7), RecordValue::Integer(812)];
    let scan = Scan {
        name: "hall",
        pose: None,
        prototype: prototype([field(reflectance), field(RecordName::Intensity)]),
        points: vec![[vec![RecordValue::Double(1.0); 3], values.to_vec()].concat()],
    };
    let cloud = read("a.e57", write(&[scan])).unwrap().cloud;
    assert_eq!(cloud.intensity, Some(vec![812.0]));
    assert_eq!(cloud.scalar("reflectance").unwrap().get(0), -7.0);
}

#[test]
fn scans_that_share_their_points_are_refused() {
    let scan = |name| Scan {
        name,
        pose: None,
        prototype: prototype([]),
        points: vec![vec![RecordValue::Double(1.0); 3]],
    };
    let bytes = write(&[scan("a"), scan("b"), scan("c")]);
    let text = String::from_utf8_lossy(&bytes);
    let places = text.split("fileOffset=\"").skip(1);
    let offsets: Vec<&str> = places.filter_map(|rest| rest.split('"').next()).collect();
    let [.., b, c] = offsets[..] else { panic!("{offsets:?}") };
    let shared = replace(&bytes, &format!("fileOffset=\"{c}\""), &format!("fileOffset=\"{b}\""));
    let message = read("a.e57", shared).map(|_| ()).unwrap_err().to_string();
    assert!(message.contains("two scans whose points begin at byte"), "{message}");
}

#[test]
fn inspect_reads_the_xml_alone() {
    let folder = Folder::new("e57");
    let path = folder.path("a.e57");
    std::fs::write(&path, small_file()).unwrap();
    let info = inspect(&path).unwrap();
    assert_eq!((info.format.as_str(), info.n_points), ("E57 1.0, 2 scans", Some(5)));
    assert_eq!(info.columns, ["x", "y", "z", "red", "green", "blue"]);
}

#[test]
fn integers_of_any_number_of_bits_are_decoded() {
    let n_points = 40_000i64;
    for n_bits in [1, 3, 7, 8, 9, 13, 31, 33, 57, 62, 63] {
        let min = -(1i64 << (n_bits - 1));
        let max = min + ((1u64 << n_bits) - 1) as i64;
        let name = RecordName::Unknown { namespace: "nor".into(), name: "value".into() };
        let value = |i: i64| {
            let hash = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            min + (hash >> (64 - n_bits)) as i64
        };
        let scan = Scan {
            name: "a",
            pose: None,
            prototype: prototype([record(name, RecordDataType::Integer { min, max })]),
            points: (0..n_points)
                .map(|i| {
                    let mut point = vec![RecordValue::Double(i as f64); 3];
                    point.push(RecordValue::Integer(value(i)));
                    point
                })
                .collect(),
        };
        let cloud = read("a.e57", write(&[scan])).unwrap().cloud;
        let values = cloud.scalar("value").unwrap();
        for i in 0..n_points {
            let (at, position) = (i as usize, DVec3::splat(i as f64));
            assert_eq!(cloud.world_position(at), position, "{n_bits} {i}");
            assert_eq!(values.get(at), value(i) as f64, "{n_bits} {i}");
        }
    }
}

#[test]
fn spherical_coordinates_are_converted_and_invalid_points_skipped() {
    let state = |name| record(name, RecordDataType::Integer { min: 0, max: 2 });
    let scan = Scan {
        name: "a",
        pose: None,
        prototype: vec![
            Record::SPHERICAL_RANGE_F64,
            Record::SPHERICAL_AZIMUTH_F64,
            Record::SPHERICAL_ELEVATION_F64,
            state(RecordName::SphericalInvalidState),
        ],
        points: [[2.0, 0.0, 0.0], [3.0, 90.0, 0.0], [4.0, 0.0, 90.0], [5.0, 0.0, 0.0]]
            .into_iter()
            .zip([0, 0, 0, 2])
            .map(|([range, azimuth, elevation], state)| {
                let angles =
                    [azimuth, elevation].map(|angle: f64| RecordValue::Double(angle.to_radians()));
                [
                    vec![RecordValue::Double(range)],
                    angles.to_vec(),
                    vec![RecordValue::Integer(state)],
                ]
                .concat()
            })
            .collect(),
    };
    let listener = Listener::default();
    let bytes = write(&[scan]);
    let cloud = load_bytes("a.e57", &bytes, &LoadOptions::default(), &listener).unwrap().cloud;
    let expected = [2.0 * Vec3::X, 3.0 * Vec3::Y, 4.0 * Vec3::Z];
    assert_eq!(cloud.len(), 3);
    assert_eq!(cloud.stations[0].position, Some(DVec3::ZERO));
    assert!(cloud.positions.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-6));
    assert!(listener.has_note("skipped 1 of 4 points: no valid position"));
}

#[test]
fn the_rays_of_a_grid_tell_the_station_of_a_scan_without_a_pose() {
    let bytes_from = |station: [f64; 3]| {
        let index = RecordDataType::Integer { min: 0, max: 39 };
        let point = |cell: i64| {
            let (row, column) = (cell / 40, cell % 40);
            let range = 2.0 + (row * column % 5) as f64;
            let [azimuth, elevation] = [column, row].map(|index| 0.01 * (index - 20) as f64);
            let ((sin, cos), (up, level)) = (azimuth.sin_cos(), elevation.sin_cos());
            let offset = [level * cos, level * sin, up].map(|value| range * value);
            let position = [0, 1, 2].map(|axis| station[axis] + offset[axis]);
            let indices = [row, column].map(RecordValue::Integer);
            [position.map(RecordValue::Double).to_vec(), indices.to_vec()].concat()
        };
        write(&[Scan {
            name: "hall",
            pose: None,
            prototype: prototype([
                record(RecordName::RowIndex, index.clone()),
                record(RecordName::ColumnIndex, index),
            ]),
            points: (0..1600).map(point).collect(),
        }])
    };
    let listener = Listener::default();
    let options = LoadOptions::default();
    let cloud = load_bytes("a.e57", &bytes_from([0.0; 3]), &options, &listener).unwrap().cloud;
    assert_eq!(cloud.stations[0].position, Some(DVec3::ZERO));
    assert!(listener.has_note("1 scan without a pose: the rays of the grid start at 0,0,0"));
    let moved = read("a.e57", bytes_from([0.5, -0.5, 0.2])).unwrap().cloud;
    assert_eq!((moved.stations[0].position, moved.stations[0].grid), (None, Some([40, 40])));
}

#[test]
fn normals_are_turned_by_the_pose() {
    let normal = |name: &str| {
        let name = RecordName::Unknown { namespace: "nor".into(), name: name.into() };
        record(name, RecordDataType::F32)
    };
    let scan = Scan {
        name: "a",
        pose: Some(([0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()], [7.0, 0.0, 0.0])),
        prototype: vec![
            Record::CARTESIAN_X_F32,
            Record::CARTESIAN_Y_F32,
            Record::CARTESIAN_Z_F32,
            normal("normalX"),
            normal("normalY"),
            normal("normalZ"),
        ],
        points: vec![[1.0, 0.0, 0.0, 0.6, 0.0, 0.8].map(RecordValue::Single).to_vec()],
    };
    let bytes = write(&[scan]);
    let cloud = read("a.e57", &bytes).unwrap().cloud;
    assert!(cloud.positions[0].distance(Vec3::new(7.0, 1.0, 0.0)) < 1e-6);
    assert!(cloud.normals.unwrap()[0].distance(Vec3::new(0.0, 0.6, 0.8)) < 1e-6);
    let columns = ColumnChoice::Only(vec![Column::Colors]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    assert!(load_bytes("a.e57", &bytes, &options, &NoProgress).unwrap().cloud.normals.is_none());
}

#[test]
fn broken_files_are_rejected() {
    let bytes = small_file();
    let message = |bytes: &[u8]| read("a.e57", bytes).unwrap_err().to_string();
    assert!(message(&bytes[..20]).contains("expected a header of 48 bytes"));
    let length = bytes.len();
    let cut = message(&bytes[..length - 1024]);
    assert!(
        cut.contains(&format!("expected {length} bytes; the description of the scans")),
        "{cut}"
    );
    let mut flipped = bytes.clone();
    flipped[100] ^= 1;
    let error = message(&flipped);
    assert!(error.contains("byte 0: found a page whose checksum is wrong"), "{error}");
    let error = message(&replace(&bytes, "recordCount=\"3\"", "recordCount=\"9\""));
    assert!(error.contains("3 of 9 points are complete"), "{error}");
    let error = message(&replace(&bytes, "<cartesianX", "<cartesianW"));
    assert!(error.contains("found an error"), "{error}");
    let both = replace(&bytes, "cartesianX ", "cartesianW ");
    let both = replace(&both, "/cartesianX", "/cartesianW");
    assert!(message(&both).contains("found scan 0 without coordinates"), "{}", message(&both));
    assert!(message(&replace(&bytes, "<e57Root ", "<e57Rood ")).contains("found an error"));
    let far = message(&replace(&bytes, "fileOffset=\"48\"", "fileOffset=\"99\""));
    assert!(far.contains("found section") || far.contains("packet"), "{far}");
}

#[test]
fn entities_are_not_expanded() {
    let bytes = small_file();
    let declaration = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>";
    let bomb = "<!DOCTYPE a [<!ENTITY b \"bbbbbb\">]>";
    let padded = format!("{bomb:<width$}", width = declaration.len());
    assert_eq!(padded.len(), declaration.len());
    let error = read("a.e57", replace(&bytes, declaration, &padded)).unwrap_err().to_string();
    assert!(error.contains("DTD"), "{error}");
}

#[test]
fn files_with_any_changed_byte_and_valid_checksums_do_not_panic() {
    let mut bytes = small_file();
    for at in 0..bytes.len() {
        for value in [0, 0x7f, 0xff, bytes[at] ^ 0x10, bytes[at].wrapping_add(1)] {
            let old = std::mem::replace(&mut bytes[at], value);
            if let Ok(loaded) = read("a.e57", with_checksums(&bytes)) {
                assert!(loaded.cloud.len() <= bytes.len() * 8, "{at} {value}");
            }
            bytes[at] = old;
        }
    }
}

#[test]
fn real_scan_agrees_with_the_e57_crate_and_with_pts() {
    let Some(path) = shared("clouds/pumpA.e57") else { return };
    let cloud = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    assert_eq!(cloud.len(), 155_201);
    let mut reader = E57Reader::from_file(&path).unwrap();
    let scan = reader.pointclouds().remove(0);
    for (i, point) in reader.pointcloud_simple(&scan).unwrap().enumerate() {
        let point = point.unwrap();
        let e57::CartesianCoordinate::Valid { x, y, z } = point.cartesian else {
            panic!("{i} is invalid")
        };
        assert!(cloud.world_position(i).distance(DVec3::new(x, y, z)) < 1e-6, "{i}");
        let color = point.color.unwrap();
        let channels = [color.red, color.green, color.blue].map(|v| (v * 65535.0).round() as u16);
        assert_eq!(cloud.colors.as_ref().unwrap()[i], channels, "{i}");
    }
    let pts =
        load(&path.with_extension("pts"), &LoadOptions::default(), &NoProgress).unwrap().cloud;
    assert_eq!(pts.colors, cloud.colors);
    let pairs = pts.positions.iter().zip(&cloud.positions);
    assert!(pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max) < 2e-6);
}

#[test]
fn claimed_points_without_bytes_are_rejected() {
    let binary = RecordDataType::Integer { min: 5, max: 6 };
    const AXES: [RecordName; 3] =
        [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let scan = Scan {
        name: "a",
        pose: None,
        prototype: AXES.map(|axis| record(axis, binary.clone())).to_vec(),
        points: vec![vec![RecordValue::Integer(5); 3]],
    };
    // With one possible value, the numbers take no bytes.
    let mut bytes = write(&[scan]);
    for _ in AXES {
        bytes = replace(&bytes, "maximum=\"6\"", "maximum=\"5\"");
    }
    assert_eq!(read("a.e57", &bytes).unwrap().cloud.positions, [Vec3::splat(5.0)]);
    let claimed = replace(&bytes, "recordCount=\"1\"", "recordCount=\"8\"");
    let error = read("a.e57", claimed);
    assert!(matches!(error, Err(Error::Truncated { readable: 1, claimed: 8, .. })));
}

#[test]
fn invalid_colours_are_black_and_invalid_intensities_no_numbers() {
    let flag = RecordDataType::Integer { min: 0, max: 1 };
    let unit = RecordDataType::Single { min: Some(0.0), max: Some(1.0) };
    let point = |color: i64, invalid_color: i64, intensity: f32, invalid_intensity: i64| {
        let mut values = vec![RecordValue::Double(1.0); 3];
        values.extend([color; 3].map(RecordValue::Integer));
        values.push(RecordValue::Integer(invalid_color));
        values.push(RecordValue::Single(intensity));
        values.push(RecordValue::Integer(invalid_intensity));
        values
    };
    let scan = Scan {
        name: "hall",
        pose: None,
        prototype: prototype([
            Record::COLOR_RED_U8,
            Record::COLOR_GREEN_U8,
            Record::COLOR_BLUE_U8,
            record(RecordName::IsColorInvalid, flag.clone()),
            record(RecordName::Intensity, unit),
            record(RecordName::IsIntensityInvalid, flag),
        ]),
        points: vec![point(200, 0, 0.5, 1), point(200, 1, 0.25, 0)],
    };
    let cloud = read("a.e57", write(&[scan])).unwrap().cloud;
    assert_eq!(cloud.colors, Some(vec![[200 * 257; 3], [0; 3]]));
    let intensity = cloud.intensity.unwrap();
    assert!(intensity[0].is_nan() && intensity[1] == 0.25, "{intensity:?}");
    assert!(cloud.scalars.is_empty());
}

#[test]
fn the_many_columns_of_a_small_scan_are_not_those_of_a_large_one() {
    let axes = [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
    let bit = RecordDataType::ScaledInteger { min: 0, max: 1, scale: 1.0, offset: 0.0 };
    let column = |i: usize| {
        let name = RecordName::Unknown { namespace: "nor".into(), name: format!("column{i}") };
        record(name, RecordDataType::Double { min: None, max: None })
    };
    let n_columns = 200;
    let mut wide = axes.clone().map(|axis| record(axis, bit.clone())).to_vec();
    wide.extend((0..n_columns).map(column));
    let corner = || vec![RecordValue::ScaledInteger(1); 3];
    let file = write(&[
        Scan {
            name: "wide",
            pose: None,
            prototype: wide,
            points: vec![[corner(), vec![RecordValue::Double(1.0); n_columns]].concat()],
        },
        Scan {
            name: "long",
            pose: None,
            prototype: axes.map(|axis| record(axis, bit.clone())).to_vec(),
            points: vec![corner(); 80_000],
        },
    ]);
    let error = read("a.e57", &file).unwrap_err();
    assert!(matches!(error, Error::OutOfMemory { n_points: 80_001, .. }), "{error}");
    let options = LoadOptions { columns: ColumnChoice::Only(Vec::new()), ..LoadOptions::default() };
    let cloud = load_bytes("a.e57", &file, &options, &NoProgress).unwrap().cloud;
    assert_eq!(cloud.len(), 80_001);
}

#[test]
fn files_of_more_columns_than_a_scan_may_have_are_refused() {
    let scan = |name, fields: std::ops::Range<usize>| {
        let field = |i: usize| {
            let name = RecordName::Unknown { namespace: "nor".into(), name: format!("a{i}") };
            record(name, RecordDataType::Integer { min: 0, max: 1 })
        };
        let n_fields = fields.len();
        let prototype = [prototype([]), fields.map(field).collect()].concat();
        let position = vec![RecordValue::Double(1.0); 3];
        let points = vec![[position, vec![RecordValue::Integer(1); n_fields]].concat()];
        Scan { name, pose: None, prototype, points }
    };
    let same = write(&[scan("hall", 0..600), scan("yard", 0..600)]);
    assert_eq!(read("a.e57", &same).unwrap().cloud.scalars.len(), 601);
    let different = write(&[scan("hall", 0..600), scan("yard", 600..1200)]);
    let inspected = inspect_bytes("a.e57", &different).unwrap_err();
    for error in [inspected, read("a.e57", &different).map(|_| ()).unwrap_err()] {
        let message = error.to_string();
        let expected = "found more than 1000 different columns in all scans, expected at most 1000";
        assert!(message.contains(expected), "{message}");
    }
}

//! PCD files: all encodings, packed colours, fields of any order, and broken headers.

use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::points::{COLUMN_INDEX, ROW_INDEX, STATION, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{Column, ColumnChoice, Error, LoadOptions, load, load_bytes};

use crate::common::{read, shared};

/// Lines before the points of a file with fields of several types, in no usual order.
const HEADER: &str = "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\n\
    FIELDS rgb z y x _ label histogram\nSIZE 4 4 4 8 1 2 4\nTYPE U F F F U U F\n\
    COUNT 1 1 1 1 3 1 2\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n";

/// Returns an ascii file of two points.
pub fn ascii_file() -> String {
    format!(
        "{HEADER}DATA ascii\n16711935 3.5 2 1e6 0 0 0 7 0.5 -1\n4278255360 nan 2 1 0 0 0 8 1 2\n"
    )
}

/// Returns the same points as a binary file.
pub fn binary_file() -> Vec<u8> {
    [HEADER.as_bytes(), b"DATA binary\n", &points().concat()].concat()
}

/// Returns the same points as a compressed file.
pub fn compressed_file() -> Vec<u8> {
    let points = points();
    let mut values = Vec::new();
    let mut byte = 0;
    for size in [4, 4, 4, 8, 3, 2, 8] {
        values.extend(points.iter().flat_map(|point| &point[byte..byte + size]));
        byte += size;
    }
    let compressed = compress(&values);
    let sizes = [compressed.len() as u32, values.len() as u32].map(u32::to_le_bytes).concat();
    [HEADER.as_bytes(), b"DATA binary_compressed\n", &sizes, &compressed].concat()
}

/// Returns a compressed file of points with x, y, z, intensity and colour.
pub fn compressed_grid(n_points: usize) -> Vec<u8> {
    let values = |value: fn(usize) -> f32| (0..n_points).flat_map(move |i| value(i).to_le_bytes());
    let axes = values(|i| (i % 25) as f32).chain(values(|i| (i / 25) as f32));
    let others = values(|i| i as f32 * 0.01).chain(values(|i| (i % 7) as f32));
    let colors = (0..n_points as u32).flat_map(u32::to_le_bytes);
    let values: Vec<u8> = axes.chain(others).chain(colors).collect();
    let compressed = compress(&values);
    let header = format!(
        "FIELDS x y z intensity rgb\nSIZE 4 4 4 4 4\nTYPE F F F F U\nWIDTH {n_points}\nHEIGHT 1\nDATA binary_compressed\n"
    );
    let sizes = [compressed.len() as u32, values.len() as u32].map(u32::to_le_bytes).concat();
    [header.as_bytes(), &sizes, &compressed].concat()
}

/// Returns the records of two points.
fn points() -> [Vec<u8>; 2] {
    let point = |rgb: u32, z: f32, x: f64, label: u16, histogram: [f32; 2]| {
        let mut bytes = rgb.to_le_bytes().to_vec();
        bytes.extend([z, 2.0].map(f32::to_le_bytes).concat());
        bytes.extend(x.to_le_bytes());
        bytes.extend([0; 3]);
        bytes.extend(label.to_le_bytes());
        bytes.extend(histogram.map(f32::to_le_bytes).concat());
        bytes
    };
    [point(0x00ff_00ff, 3.5, 1e6, 7, [0.5, -1.0]), point(0xff00_ff00, f32::NAN, 1.0, 8, [1.0, 2.0])]
}

/// Compresses by LZF without repetitions, except that of the first byte if it follows itself.
fn compress(bytes: &[u8]) -> Vec<u8> {
    bytes.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect()
}

#[test]
fn organized_clouds_have_a_station_and_a_grid() {
    let header =
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 2\nVIEWPOINT 4 5 6 1 0 0 0\n";
    let points: String = (0..6).map(|i| format!("{i} 1 2\n")).collect();
    let file = format!("{header}DATA ascii\n{points}");
    let cloud = read("a.pcd", file.clone()).unwrap().cloud;
    assert_eq!(cloud.scalar(ROW_INDEX), Some(&Values::U16(vec![0, 0, 0, 1, 1, 1])));
    assert_eq!(cloud.scalar(COLUMN_INDEX), Some(&Values::U16(vec![0, 1, 2, 0, 1, 2])));
    assert_eq!(cloud.station_of(3).unwrap().position, Some(DVec3::new(4.0, 5.0, 6.0)));
    assert_eq!(cloud.station_of(3).unwrap().grid, Some([2, 3]));
    let filter = Some("x > 2".parse().unwrap());
    let options = LoadOptions { filter, ..LoadOptions::default() };
    let filtered = load_bytes("a.pcd", file.as_bytes(), &options, &NoProgress).unwrap().cloud;
    assert_eq!((filtered.len(), filtered.scalars.len(), filtered.stations.len()), (3, 0, 1));
    let broken = file.replace("VIEWPOINT 4 5 6 1 0 0 0", "VIEWPOINT 4 nan");
    let station = read("a.pcd", broken).unwrap().cloud.stations.pop().unwrap();
    assert_eq!(station.position, Some(DVec3::ZERO));
}

#[test]
fn a_viewpoint_other_than_the_default_is_a_station() {
    let file = |viewpoint: &str| {
        format!(
            "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nVIEWPOINT {viewpoint}\nDATA ascii\n\
             1 2 3\n4 5 6\n"
        )
    };
    let stations = |viewpoint| read("a.pcd", file(viewpoint)).unwrap().cloud.stations;
    assert!(stations("0 0 0 1 0 0 0").is_empty() && stations("none").is_empty());
    let turned = stations("1 2 3 0 0 0 2").pop().unwrap();
    assert_eq!(turned.position, Some(DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!((turned.rotation, turned.grid), (DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0), None));
    assert_eq!(stations("1 2 3").pop().unwrap().rotation, DQuat::IDENTITY);
    assert_eq!(stations("0 0 0 0.6 0.8 0 0").pop().unwrap().position, Some(DVec3::ZERO));
}

#[test]
fn labels_of_segments_are_no_asprs_classes() {
    let pcd = |name: &str| {
        format!(
            "FIELDS x y z {name}\nSIZE 4 4 4 4\nTYPE F F F U\nWIDTH 2\nHEIGHT 1\nDATA ascii\n1 2 3 7\n4 5 6 2\n"
        )
    };
    let ply = |name: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
             property uint {name}\nend_header\n1 2 3 7\n4 5 6 2\n"
        )
    };
    for name in ["label", "class"] {
        for (file, content) in [("a.pcd", pcd(name)), ("a.ply", ply(name))] {
            let cloud = read(file, content.clone()).unwrap().cloud;
            assert_eq!(cloud.classification, None, "{file} {name}");
            assert_eq!(cloud.scalar(name), Some(&Values::F64(vec![7.0, 2.0])), "{file} {name}");
            let filter = Some(format!("{name} == 7").parse().unwrap());
            let columns = ColumnChoice::Only(Vec::new());
            let options = LoadOptions { filter, columns, ..LoadOptions::default() };
            let kept = load_bytes(file, content.as_bytes(), &options, &NoProgress).unwrap();
            assert_eq!(kept.cloud.len(), 1, "{file} {name}");
        }
    }
    for (file, content) in [("a.pcd", pcd("classification")), ("a.ply", ply("Classification"))] {
        assert_eq!(read(file, content).unwrap().cloud.classification, Some(vec![7, 2]), "{file}");
    }
}

#[test]
fn a_field_named_station_is_not_taken_for_the_stations_of_points() {
    let header = "FIELDS x y z station\nSIZE 4 4 4 2\nTYPE F F F U\nWIDTH 2\nHEIGHT 2\n";
    let points: String = (0..4).map(|i| format!("{i} 1 2 5\n")).collect();
    let cloud = read("a.pcd", format!("{header}DATA ascii\n{points}")).unwrap().cloud;
    assert_eq!(cloud.scalar(STATION), None);
    assert_eq!(cloud.station_of(3).unwrap().name, "scan 1");
}

#[test]
fn all_encodings_hold_the_same_points() {
    let ascii = read("a.pcd", ascii_file()).unwrap();
    for (name, bytes) in [("binary", binary_file()), ("compressed", compressed_file())] {
        let loaded = read("a.pcd", bytes).unwrap();
        assert_eq!(loaded.cloud.world_position(0), DVec3::new(1e6, 2.0, 3.5), "{name}");
        assert!(loaded.cloud.positions[1].z.is_nan(), "{name}");
        assert_eq!(loaded.cloud.colors, Some(vec![[65535, 0, 65535], [0, 65535, 0]]), "{name}");
        assert_eq!(loaded.cloud.scalar("label"), Some(&Values::U16(vec![7, 8])), "{name}");
        assert_eq!(loaded.cloud.scalar("histogram_1"), Some(&Values::F32(vec![-1.0, 2.0])));
        assert!(loaded.cloud.scalar("_").is_none() && loaded.cloud.scalar("_0").is_none());
        assert_eq!(loaded.info.columns, ascii.info.columns, "{name}");
        assert_eq!(loaded.cloud.scalars, ascii.cloud.scalars, "{name}");
        assert_eq!(loaded.cloud.colors, ascii.cloud.colors, "{name}");
        assert_eq!(loaded.cloud.positions[0], ascii.cloud.positions[0], "{name}");
    }
    assert_eq!(ascii.info.format, "PCD 0.7, ascii");
}

#[test]
fn packed_colors_are_read_as_floats_and_integers() {
    let color = |kind: &str, value: &str| {
        let file = format!(
            "VERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F {kind}\nCOUNT 1 1 1 1\n\
            WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3 {value}\n"
        );
        read("a.pcd", file).unwrap().cloud.colors.unwrap()[0].map(|channel| channel / 257)
    };
    let bits = 0x0012_3456;
    assert_eq!(color("U", &bits.to_string()), [0x12, 0x34, 0x56]);
    assert_eq!(color("I", &(bits - (1 << 24)).to_string()), [0x12, 0x34, 0x56]);
    assert_eq!(color("F", &bits.to_string()), [0x12, 0x34, 0x56]);
    assert_eq!(color("F", &format!("{:e}", f32::from_bits(bits as u32))), [0x12, 0x34, 0x56]);
    let opaque = f32::from_bits(0xfe12_3456);
    assert_eq!(color("F", &format!("{opaque:e}")), [0x12, 0x34, 0x56]);
    assert_eq!(color("F", "0"), [0, 0, 0]);
}

#[test]
fn old_headers_are_read() {
    let file = "# .PCD v.5 - Point Cloud Data file format\nVERSION .5\nCOLUMNS x y z\nSIZE 4 4 4\n\
        TYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n";
    let cloud = read("a", file).unwrap().cloud;
    assert_eq!(cloud.positions, [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)]);
    let by_points = file.replace("WIDTH 2\nHEIGHT 1\n", "").replace('\n', "\r\n");
    assert_eq!(read("a", by_points).unwrap().cloud, cloud);
}

#[test]
fn opacity_is_read_if_asked_for() {
    let columns = ColumnChoice::Only(vec![Column::Scalar("alpha".into())]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    let cloud = load_bytes("a.pcd", &binary_file(), &options, &NoProgress).unwrap().cloud;
    assert_eq!(cloud.scalar("alpha").unwrap().get(1), 1.0);
    assert_eq!(cloud.colors, None);
}

#[test]
fn broken_headers_are_rejected() {
    let message = |from: &str, to: &str| {
        let file = String::from_utf8_lossy(&binary_file()).replace(from, to);
        read("a.pcd", file).unwrap_err().to_string()
    };
    assert!(message("SIZE 4", "SIZE").contains("found 6 values of `SIZE`, expected 7"));
    assert!(message("SIZE 4", "SIZE 3").contains("found field `rgb` of type U, size 3"));
    assert!(message("TYPE U", "TYPE Q").contains("field `rgb` of type Q"));
    assert!(message("POINTS 2", "POINTS 3").contains("as many points as width times height"));
    let huge = message("WIDTH 2\nHEIGHT 1", &format!("WIDTH {0}\nHEIGHT {0}", u64::MAX));
    assert!(huge.contains("as many points as width times height"), "{huge}");
    assert!(message("HEIGHT 1", "HEIGHT x").contains("line 8: found `HEIGHT x`"));
    assert!(message("COUNT 1", "COUNT 18446744073709551615").contains("at most 1000"));
    assert!(message("COUNT 1", "COUNT 2000").contains("at most 1000"));
    assert!(message("rgb z y x", "rgb z y w").contains("expected fields x, y and z"));
    assert!(message("DATA binary", "DATA rle").contains("ascii, binary or binary_compressed"));
    assert!(message("VIEWPOINT", "VIEW").contains("found `VIEW 0 0 0 1 0 0 0`"));
    assert!(message("FIELDS", "#").contains("expected a line `FIELDS` before it"));
    assert!(message("DATA binary\n", "DATE\n").contains("found `DATE`"));
}

#[test]
fn lying_sizes_are_rejected() {
    let bytes = binary_file();
    let cut = read("a.pcd", &bytes[..bytes.len() - 1]);
    assert!(matches!(cut, Err(Error::Truncated { readable: 1, claimed: 2, .. })));
    let text = String::from_utf8_lossy(&bytes[..HEADER.len()]).into_owned();
    let claim =
        text.replace("WIDTH 2", "WIDTH 4000000000").replace("POINTS 2", "POINTS 4000000000");
    let claimed = read("a.pcd", [claim.as_bytes(), &bytes[HEADER.len()..]].concat());
    assert!(matches!(claimed, Err(Error::Truncated { readable: 2, claimed: 4_000_000_000, .. })));

    let small = text.replace("WIDTH 2", "WIDTH 100000000").replace("POINTS 2", "POINTS 100000000");
    let n_bytes = (100_000_000u64 * 33) as u32;
    let sizes = [3, n_bytes].map(u32::to_le_bytes).concat();
    let bomb = [small.as_bytes(), b"DATA binary_compressed\n", &sizes, &[0xe0, 255, 0]].concat();
    let error = read("a.pcd", bomb).unwrap_err().to_string();
    assert!(error.contains("at most 264 from 3 bytes"), "{error}");
    let mut compressed = compressed_file();
    let at = HEADER.len() + "DATA binary_compressed\n".len();
    compressed[at + 4] += 1;
    let error = read("a.pcd", &compressed).unwrap_err().to_string();
    assert!(error.contains("found 67 bytes, expected 66"), "{error}");
}

#[test]
fn depth_camera_cloud_is_read() {
    let Some(path) = shared("clouds/region_growing_rgb_tutorial.pcd") else { return };
    let loaded = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
    assert_eq!(loaded.info.format, "PCD 0.7, binary compressed, 640 x 480 grid");
    assert_eq!(loaded.cloud.len(), 640 * 480);
    let bounds = loaded.cloud.bounds();
    assert!(bounds.max.is_finite() && 0.0 < bounds.min.z && bounds.max.z < 10.0, "{bounds:?}");
    // Pixels without depth are about a seventh of the picture.
    let n_measured = loaded.cloud.positions.iter().filter(|p| p.is_finite()).count();
    assert_eq!(n_measured, 259_847);
}

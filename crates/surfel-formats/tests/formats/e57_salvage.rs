//! Cut E57 files, whose description stands at their end.

use std::f64::consts::PI;

use e57::{Record, RecordDataType, RecordName, RecordValue};
use surfel_core::math::DVec3;
use surfel_core::points::{STATION, Values};
use surfel_formats::{inspect_bytes, load_bytes};

use crate::common::{Listener, read, shared};
use crate::e57_writer::{Scan, write};
use crate::salvage::{options, salvage, salvaged};

const CARTESIAN: [RecordName; 3] =
    [RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ];
const SPHERICAL: [RecordName; 3] =
    [RecordName::SphericalRange, RecordName::SphericalAzimuth, RecordName::SphericalElevation];

fn scan(name: &'static str, prototype: Vec<Record>, points: Vec<Vec<RecordValue>>) -> Scan {
    let pose = Some(([1.0, 0.0, 0.0, 0.0], [100.0, 200.0, 300.0]));
    Scan { name, pose, prototype, points }
}

fn records(names: [RecordName; 3], data_type: &RecordDataType) -> Vec<Record> {
    names.map(|name| Record { name, data_type: data_type.clone() }).to_vec()
}

/// Returns a scan of numbers, as doubles or else as floats.
fn scan_of(names: [RecordName; 3], points: &[[f64; 3]], is_double: bool) -> Scan {
    let (data_type, value): (_, fn(f64) -> RecordValue) = match is_double {
        true => (RecordDataType::Double { min: None, max: None }, RecordValue::Double),
        false => {
            (RecordDataType::Single { min: None, max: None }, |v| RecordValue::Single(v as f32))
        }
    };
    let points = points.iter().map(|point| point.map(value).to_vec());
    scan("a", records(names, &data_type), points.collect())
}

/// Returns points of a hall as a scanner sees them.
fn hall(n_points: usize) -> Vec<[f64; 3]> {
    let point = |i: usize| {
        let (sin, cos) = (i as f64 * 0.37).sin_cos();
        [8.3 * cos, -11.7 * sin, (i % 97) as f64 * 0.031 - 1.2]
    };
    (0..n_points).map(point).collect()
}

/// Returns three scans of several packets each.
fn three_scans() -> Vec<u8> {
    let points: Vec<[f64; 3]> = (0..10_000).map(|i| [i, 2 * i, 7].map(f64::from)).collect();
    three_scans_of(&points)
}

fn three_scans_of(points: &[[f64; 3]]) -> Vec<u8> {
    write(&[0, 1, 2].map(|_| scan_of(CARTESIAN, points, true)))
}

/// Returns the error of a file of which nothing can be salvaged.
fn refusal(bytes: &[u8]) -> String {
    let n_points = salvage("a.e57", bytes).map(|loaded| loaded.cloud.len());
    n_points.unwrap_err().to_string()
}

/// Returns the file without its last bytes, from the end of its points on.
fn without_description(bytes: &[u8]) -> &[u8] {
    let xml_start = u64::from_le_bytes(*bytes[24..].first_chunk().unwrap());
    &bytes[..xml_start as usize]
}

#[test]
fn a_page_with_a_wrong_checksum_ends_its_scan() {
    let mut bytes = three_scans();
    let whole = read("a.e57", &bytes).unwrap().cloud;
    // In the last third of the second scan.
    let page = bytes.len() / 1024 * 6 / 10;
    bytes[1024 * page + 100] ^= 1;
    let cloud = salvaged("a.e57", &bytes, "");
    let n_second = cloud.len() - 20_000;
    assert!(5_000 < n_second && n_second < 9_000, "{n_second}");
    let kept: Vec<u32> =
        (0..30_000).filter(|i| *i < 10_000 + n_second as u32 || 20_000 <= *i).collect();
    assert!(cloud == whole.subset(&kept));
}

#[test]
fn positions_are_read_without_a_description() {
    let bytes = three_scans();
    let cut = &bytes[..bytes.len() / 2];
    // Programs look at a file before they read it.
    assert_eq!(inspect_bytes("a.e57", cut).unwrap().columns, ["x", "y", "z"]);
    let refused = read("a.e57", cut).unwrap_err().to_string();
    assert!(refused.contains("the description of the scans, from byte "), "{refused}");
    assert!(refused.ends_with("; what is whole can be read [salvage]"), "{refused}");
    let listener = Listener::default();
    let cloud = load_bytes("a.e57", cut, &options(), &listener).unwrap().cloud;
    assert!(listener.has_note("a.e57: the description of the scans is missing; the first three"));
    assert!(listener.has_note(&format!("a.e57: salvaged {} points; found the end", cloud.len())));
    assert!(10_000 < cloud.len() && cloud.len() < 16_000, "{}", cloud.len());
    // Without their poses.
    for (i, point) in [(0, 0), (9_999, 9_999), (10_000, 0), (12_345, 2_345)] {
        let point = f64::from(point);
        assert!(cloud.world_position(i).distance(DVec3::new(point, 2.0 * point, 7.0)) < 0.01);
    }
    let Some(Values::U16(stations)) = cloud.scalar(STATION) else { panic!("no stations") };
    assert_eq!((stations[9_999], stations[10_000]), (0, 1));
    assert!(cloud.stations.iter().all(|station| station.position.is_none()));
    assert_eq!(cloud.scalars.len(), 1, "only the station is known");
}

#[test]
fn floats_beside_other_fields_are_told_apart() {
    let points = hall(20_000);
    for is_double in [false, true] {
        let mut colored = scan_of(CARTESIAN, &points, is_double);
        colored.prototype.extend([Record::COLOR_RED_U8, Record::COLOR_GREEN_U8]);
        colored.prototype.push(Record::COLOR_BLUE_U8);
        let channels = |i: usize| [i % 256, i % 7, 255].map(|v| RecordValue::Integer(v as i64));
        colored.points.iter_mut().enumerate().for_each(|(i, point)| point.extend(channels(i)));
        let bytes = write(&[colored]);
        let cloud = salvaged("a.e57", without_description(&bytes), "");
        // The packet in which the file ends is lost.
        assert!(10_000 < cloud.len() && cloud.len() < 20_000, "{is_double}: {}", cloud.len());
        for (i, point) in points.iter().enumerate().take(cloud.len()) {
            let distance = cloud.world_position(i).distance(DVec3::from_array(*point));
            assert!(distance < 1e-5, "{is_double} {i}: {distance}");
        }
        assert!(cloud.colors.is_none() && cloud.scalars.is_empty());
    }
}

#[test]
fn angles_of_a_full_circle_are_told_from_coordinates() {
    let azimuth = |i: usize| (i % 5_000) as f64 / 5_000.0 * 2.0 * PI - PI;
    let point = |i: usize| [5.0 + (i % 13) as f64, azimuth(i), 0.3];
    let mut points: Vec<[f64; 3]> = (0..20_000).map(point).collect();
    // Two directions without an echo.
    points[7] = [0.0; 3];
    points[8] = [0.0; 3];
    let bytes = write(&[scan_of(SPHERICAL, &points, false)]);
    let cloud = salvaged("a.e57", without_description(&bytes), "");
    let [range, azimuth, elevation] = points[1_000];
    let level = range * elevation.cos();
    let expected =
        DVec3::new(level * azimuth.cos(), level * azimuth.sin(), range * elevation.sin());
    assert!(cloud.world_position(998).distance(expected) < 1e-4);

    // A part of a circle may be a small object as well.
    points.retain(|[_, azimuth, _]| *azimuth < 2.0);
    let bytes = write(&[scan_of(SPHERICAL, &points, false)]);
    let error = refusal(without_description(&bytes));
    assert!(error.contains("may be coordinates as well as range and angles"), "{error}");
}

#[test]
fn what_cannot_be_told_is_refused() {
    let integers = |n_bits: u32, offset: i64| {
        let max = (1i64 << n_bits) - 1 + offset;
        let data_type =
            RecordDataType::ScaledInteger { min: offset, max, scale: 0.001, offset: 0.0 };
        let raw = |v: f64| RecordValue::ScaledInteger((v * 1000.0) as i64);
        let points = hall(30_000).iter().map(|point| point.map(raw).to_vec()).collect();
        scan("a", records(CARTESIAN, &data_type), points)
    };
    let whole = |scan: Scan| write(&[scan]);
    for (n_bits, offset) in
        [(16, -32768), (24, -1 << 23), (32, -1 << 31), (33, -20_000), (48, -1 << 47)]
    {
        let bytes = whole(integers(n_bits, offset));
        let error = refusal(without_description(&bytes));
        assert!(error.contains("the scale and limits of integers are in the desc"), "{error}");
        assert!(error.contains("; nothing can be salvaged without it; copy the file"), "{error}");
        let refused = read("a.e57", without_description(&bytes)).unwrap_err().to_string();
        assert_eq!(refused, error, "no advice to salvage what cannot be salvaged");
    }
    let refused = |points: &[[f64; 3]], reason: &str| {
        let bytes = whole(scan_of(CARTESIAN, points, true));
        let error = refusal(without_description(&bytes));
        assert!(error.contains(reason), "{error}");
    };
    refused(&[[1e12, 2.0, 3.0]; 9_000], "not floating-point numbers");
    refused(&[[9.0, 8.0, 7.0]; 9_000], "not floating-point numbers");
    refused(&hall(30), "there is no whole packet of points");
    let mut few = three_scans_of(&hall(30));
    few.truncate(without_description(&few).len() / 1024 * 1024);
    let error = refusal(&few);
    assert!(error.contains("too few points"), "{error}");
    let error = refusal(&whole(scan_of(CARTESIAN, &hall(99), true))[..1024]);
    assert!(error.contains("there is no whole packet of points"), "{error}");
}

#[test]
fn scans_whose_fields_are_described_are_read_with_them() {
    let bytes = three_scans();
    let whole = read("a.e57", &bytes).unwrap().cloud;
    let xml_start = without_description(&bytes).len();
    let mut found = Vec::new();
    for length in xml_start..bytes.len() {
        // Pages are whole or not there.
        let cloud = salvage("a.e57", &bytes[..length]).unwrap().cloud;
        let n_described = cloud.stations.iter().filter(|it| it.position.is_some()).count();
        if 0 < n_described {
            let n_points = 10_000 * n_described;
            assert_eq!(cloud.len(), n_points, "{length}");
            assert_eq!(cloud.world_position(7), DVec3::new(107.0, 214.0, 307.0));
            assert!(cloud.positions == whole.positions[..n_points]);
        }
        found.push(n_described);
    }
    assert!(found.is_sorted() && found.contains(&1) && found.contains(&2), "{found:?}");
}

/// Returns the file up to a byte of its content and with zeros to the end of the page, as the front of a longer file.
fn cut_content(bytes: &[u8], length: usize) -> Vec<u8> {
    let content: Vec<u8> = bytes.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let pages = content[..length].chunks(1020).flat_map(|page| {
        let mut page = page.to_vec();
        page.resize(1024, 0);
        page
    });
    let mut pages: Vec<u8> = pages.collect();
    pages[16..24].copy_from_slice(&(bytes.len() as u64 + 1024).to_le_bytes());
    crate::e57_writer::with_checksums(&pages)
}

#[test]
fn scaled_integers_are_exact_once_their_fields_are_described() {
    let scaled =
        |min: i64, max: i64| RecordDataType::ScaledInteger { min, max, scale: 0.001, offset: 0.25 };
    let [x, y, z] = [scaled(-9000, 9000), scaled(-12_000, 100_000), scaled(-2000, 3000)];
    let mut prototype: Vec<Record> = CARTESIAN
        .into_iter()
        .zip([x, y, z])
        .map(|(name, data_type)| Record { name, data_type })
        .collect();
    let intensity = RecordDataType::Integer { min: 0, max: 4095 };
    prototype.push(Record { name: RecordName::Intensity, data_type: intensity });
    prototype.extend([Record::COLOR_RED_U8, Record::COLOR_GREEN_U8, Record::COLOR_BLUE_U8]);
    let point = |(i, position): (usize, &[f64; 3])| {
        let raw = position.map(|v| RecordValue::ScaledInteger((v * 1000.0) as i64));
        let others = [i % 4096, i % 256, i % 7, 255].map(|v| RecordValue::Integer(v as i64));
        raw.into_iter().chain(others).collect()
    };
    let points = hall(3000).iter().enumerate().map(point).collect();
    let bytes = write(&[Scan { name: "a", pose: None, prototype, points }]);
    let whole = read("a.e57", &bytes).unwrap().cloud;
    let xml =
        without_description(&bytes).len() / 1024 * 1020 + without_description(&bytes).len() % 1024;
    let content: Vec<u8> = bytes.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let position_of = |text: &str| {
        xml + content[xml..].windows(text.len()).position(|it| it == text.as_bytes()).unwrap()
    };
    let end_of = |tag: &str| position_of(tag) + tag.len();
    let (z_end, blue_end) = (end_of("</cartesianZ>"), end_of("</colorBlue>"));
    let intensity_end = end_of("</intensity>");
    for length in xml..blue_end + 9 {
        let cut = cut_content(&bytes, length);
        if length < z_end {
            assert!(refusal(&cut).contains("no description of the scans"), "{length}");
            continue;
        }
        let listener = Listener::default();
        let cloud = load_bytes("a.e57", &cut, &options(), &listener).unwrap().cloud;
        assert!(cloud.positions == whole.positions, "{length}");
        let is_short = listener.has_note(
            "a.e57: the description ends early; it has the first scan without its last fields (",
        );
        assert_eq!(is_short, length < blue_end, "{length}");
        assert_eq!(cloud.intensity.is_some(), intensity_end <= length, "{length}");
        assert_eq!(cloud.colors.is_some(), blue_end <= length, "{length}");
        assert_eq!(cloud.colors, whole.colors.clone().filter(|_| blue_end <= length));
        assert!(cloud.scalars.len() == whole.scalars.len(), "unknown fields are no columns");
    }
}

#[test]
fn xml_with_a_broken_page_is_read_up_to_it() {
    let mut bytes = three_scans();
    let page = bytes.len() - 1024;
    bytes[page + 500] ^= 1;
    let listener = Listener::default();
    let cloud = load_bytes("a.e57", &bytes, &options(), &listener).unwrap().cloud;
    assert!(listener.has_note("a.e57: the description ends early"), "{:?}", listener.notes.lock());
    assert!(cloud.len().is_multiple_of(10_000) && !cloud.is_empty());
}

#[test]
fn broken_sections_do_not_panic() {
    let bytes = write(&[scan_of(CARTESIAN, &hall(300), false)]);
    let bytes = without_description(&bytes);
    let mut cut = crate::e57_writer::with_checksums(&bytes[..bytes.len() / 1024 * 1024]);
    for at in 16..120 {
        for value in [0, 1, 0x7f, 0xff] {
            let old = std::mem::replace(&mut cut[at], value);
            let changed = crate::e57_writer::with_checksums(&cut);
            if let Ok(loaded) = salvage("a.e57", &changed) {
                assert!(loaded.cloud.len() <= bytes.len(), "{at} {value}");
            }
            cut[at] = old;
        }
    }
}

#[test]
fn a_real_scan_of_scaled_integers_needs_its_description() {
    let Some(path) = shared("clouds/pumpA.e57") else { return };
    let bytes = std::fs::read(path).unwrap();
    let xml_start = without_description(&bytes).len();
    for length in (0..bytes.len()).step_by(97_531) {
        let error = salvage("pumpA.e57", &bytes[..length]).unwrap_err().to_string();
        assert!(xml_start < length || !error.contains("[salvage]"), "{length}: {error}");
    }
    // Within the description, after the fields of the only scan.
    let fields = bytes.windows(12).rposition(|text| text == b"</prototype>").unwrap();
    let end = (fields + 1024) / 1024 * 1024;
    let whole = read("pumpA.e57", &bytes).unwrap().cloud;
    let cloud = salvaged("pumpA.e57", &bytes[..end], &format!("{0} of {0} points", 155_201));
    assert!(cloud == whole);
}

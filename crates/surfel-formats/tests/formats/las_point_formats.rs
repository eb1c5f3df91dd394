//! All LAS point formats, uncompressed and compressed, as written by the `las` crate.

use std::io::Cursor;

use las::point::Format;
use las::raw::point::Waveform;
use las::{Builder, Color, Point, Transform, Vector, Writer};
use surfel_core::math::DVec3;

use crate::common::read;

/// Number of points, more than one chunk.
pub const N_POINTS: usize = 50_300;

fn point(i: usize, format: &Format) -> Point {
    Point {
        x: 484_800.0 + (i % 300) as f64 * 0.25,
        y: 6_632_800.0 - (i / 300) as f64 * 0.5,
        z: 100.0 + (i * 31 % 97) as f64 * 0.01,
        intensity: (i % 5000) as u16,
        return_number: 1 + (i % 3) as u8,
        number_of_returns: 3,
        classification: las::point::Classification::new(2 + (i % 4) as u8).unwrap(),
        is_withheld: i.is_multiple_of(100),
        scan_angle: (i % 40) as f32 - 20.0,
        user_data: (i % 256) as u8,
        point_source_id: (i % 1000) as u16,
        // Several scanner channels with their own clocks and occasional jumps.
        scanner_channel: if format.is_extended { (i / 70 % 4) as u8 } else { 0 },
        is_synthetic: i.is_multiple_of(110),
        is_key_point: i.is_multiple_of(120),
        is_overlap: format.is_extended && i.is_multiple_of(130),
        scan_direction: match i / 40 % 2 {
            0 => las::point::ScanDirection::RightToLeft,
            _ => las::point::ScanDirection::LeftToRight,
        },
        is_edge_of_flight_line: i.is_multiple_of(150),
        gps_time: format.has_gps_time.then_some({
            let clock = 1e5 * (1 + i % 3) as f64 + 1e7 * (i / 9000) as f64;
            clock + (i / 4) as f64 * if i % 500 < 250 { 1e-4 } else { 7e-3 }
        }),
        color: format.has_color.then(|| Color::new(i as u16, (i / 3) as u16, 77)),
        nir: format.has_nir.then_some((i % 999) as u16),
        waveform: format.has_waveform.then(Waveform::default),
        ..Point::default()
    }
}

/// Returns a file of two chunks.
pub fn file(minor_version: u8, format: Format) -> Vec<u8> {
    let mut builder = Builder::from((1, minor_version));
    builder.point_format = format;
    let axis = |offset| Transform { scale: 0.01, offset };
    builder.transforms = Vector { x: axis(484_000.0), y: axis(6_632_000.0), z: axis(0.0) };
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for i in 0..N_POINTS {
        writer.write_point(point(i, &format)).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// Returns the flags that the format has, by the names of their columns.
fn flags(point: &Point, format: &Format) -> Vec<(&'static str, f64)> {
    let mut flags = vec![
        ("synthetic", f64::from(point.is_synthetic)),
        ("key_point", f64::from(point.is_key_point)),
        ("withheld", f64::from(point.is_withheld)),
        ("scan_direction_flag", point.scan_direction as u8 as f64),
        ("edge_of_flight_line", f64::from(point.is_edge_of_flight_line)),
    ];
    if format.is_extended {
        flags.push(("overlap", f64::from(point.is_overlap)));
        flags.push(("scanner_channel", f64::from(point.scanner_channel)));
    }
    flags
}

#[test]
fn every_point_format_is_read() {
    for number in 0..=10 {
        for is_compressed in [false, true] {
            let format = Format { is_compressed, ..Format::new(number).unwrap() };
            let minor_version = match number {
                6.. => 4,
                4.. => 3,
                2.. => 2,
                _ => u8::from(is_compressed),
            };
            let name = format!("{number}-{is_compressed}.las");
            let bytes = file(minor_version, format);
            let loaded = read(&name, bytes).unwrap();
            let cloud = loaded.cloud;
            assert_eq!(cloud.len(), N_POINTS, "{name}");
            let column = |scalar: &str| cloud.scalar(scalar).unwrap_or_else(|| panic!("{scalar}"));
            for i in (0..N_POINTS).step_by(7) {
                let point = point(i, &format);
                let position = DVec3::new(point.x, point.y, point.z);
                let error = (cloud.world_position(i) - position).abs().max_element();
                assert!(error < 1e-3, "{name} {i}: {error}");
                assert_eq!(cloud.intensity.as_ref().unwrap()[i], f32::from(point.intensity));
                let class = cloud.classification.as_ref().unwrap()[i];
                assert_eq!(class, u8::from(point.classification), "{name} {i}");
                assert_eq!(column("return_number").get(i), f64::from(point.return_number));
                assert_eq!(column("number_of_returns").get(i), 3.0);
                for (flag, expected) in flags(&point, &format) {
                    assert_eq!(column(flag).get(i), expected, "{name} {i} {flag}");
                }
                let angle = column("scan_angle").get(i);
                assert!(
                    (angle - f64::from(point.scan_angle)).abs() < 0.0061,
                    "{name} {i}: {angle}"
                );
                assert_eq!(column("user_data").get(i), f64::from(point.user_data));
                assert_eq!(column("point_source_id").get(i), f64::from(point.point_source_id));
                if let Some(time) = point.gps_time {
                    assert_eq!(column("gps_time").get(i), time, "{name} {i}");
                }
                if let Some(Color { red, green, blue }) = point.color {
                    assert_eq!(cloud.colors.as_ref().unwrap()[i], [red, green, blue], "{name} {i}");
                }
                if let Some(nir) = point.nir {
                    assert_eq!(column("nir").get(i), f64::from(nir), "{name} {i}");
                }
            }
        }
    }
}

#[test]
fn eight_bit_colours_are_scaled_to_sixteen() {
    let mut builder = Builder::from((1, 2));
    builder.point_format = Format::new(2).unwrap();
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for red in [0, 128, 255] {
        let color = Some(Color::new(red, 1, 2));
        writer.write_point(Point { color, ..Point::default() }).unwrap();
    }
    let bytes = writer.into_inner().unwrap().into_inner();
    let cloud = read("a.las", bytes).unwrap().cloud;
    assert_eq!(cloud.colors.unwrap(), [[0, 257, 514], [128 * 257, 257, 514], [65535, 257, 514]]);
}

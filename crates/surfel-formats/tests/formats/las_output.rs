//! LAS files that are read and written again keep version, point format, extra bytes, steps and coordinate system.

use std::io::Cursor;

use las::point::{Classification, Format, ScanDirection};
use las::raw::point::Waveform;
use las::{Builder, Color, GpsTimeType, Header, Point, Transform, Vector, Vlr, Writer};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{FileInfo, LoadOptions, Loaded, SaveOptions, load_all, save};

use crate::common::{Folder, Listener, read};

/// Minor version of LAS 1 and point format of a file.
type Kind = (u8, u8);

const N_POINTS: u16 = 300;

/// Returns the description of an extra column.
fn description(data_type: u8, options: u8, name: &str) -> [u8; 192] {
    let mut bytes = [0; 192];
    (bytes[2], bytes[3]) = (data_type, options);
    bytes[4..4 + name.len()].copy_from_slice(name.as_bytes());
    for value in 0..3 {
        let mut put = |at: usize, number: f64| {
            bytes[at + 8 * value..][..8].copy_from_slice(&number.to_le_bytes());
        };
        put(112, 0.01 * (value + 1) as f64);
        put(136, -5.0);
    }
    bytes[40..42].copy_from_slice(&u16::MAX.to_le_bytes());
    bytes[160..172].copy_from_slice(b"above ground");
    bytes
}

fn vlr(user_id: &str, record_id: u16, data: &[u8]) -> Vlr {
    let (user_id, data) = (user_id.to_owned(), data.to_vec());
    Vlr { user_id, record_id, description: String::new(), data }
}

fn projection(format: u8) -> Vlr {
    let keys = [[1, 1, 0, 1u16], [3072, 0, 1, 2154]];
    let keys: Vec<u8> = keys.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
    match format {
        6.. => vlr("LASF_Projection", 2112, b"PROJCS[\"somewhere\"]\0"),
        _ => vlr("LASF_Projection", 34735, &keys),
    }
}

fn point(i: u16, format: &Format) -> Point {
    // A height of 2 bytes and a triple of 2 bytes each.
    let extra = [i, u16::MAX - i, i * 3, 7 * i].iter().flat_map(|v| v.to_le_bytes()).collect();
    Point {
        x: 484_800.0 + f64::from(i % 30) * 0.25,
        y: 6_632_800.0 - f64::from(i / 30) * 0.5,
        z: 100.0 + f64::from(i * 31 % 97) * 0.01,
        intensity: i,
        return_number: 1 + (i % 3) as u8,
        number_of_returns: 3,
        classification: Classification::new(2 + (i % 4) as u8).unwrap(),
        scan_angle: if format.is_extended {
            f32::from(i) * 0.006
        } else {
            f32::from(i % 40) - 20.0
        },
        is_synthetic: i % 5 == 1,
        is_key_point: i % 7 == 1,
        is_withheld: i % 11 == 1,
        is_overlap: format.is_extended && i % 13 == 1,
        scanner_channel: if format.is_extended { (i % 4) as u8 } else { 0 },
        scan_direction: if i.is_multiple_of(2) {
            ScanDirection::RightToLeft
        } else {
            ScanDirection::LeftToRight
        },
        is_edge_of_flight_line: i % 17 == 1,
        user_data: (i % 256) as u8,
        point_source_id: i % 9,
        gps_time: format.has_gps_time.then_some(1e8 + f64::from(i) * 1e-4),
        color: format.has_color.then(|| Color::new(i, 3, 65_000)),
        nir: format.has_nir.then_some(i + 1),
        waveform: format.has_waveform.then(Waveform::default),
        extra_bytes: extra,
    }
}

fn las_file((minor_version, format): Kind) -> Vec<u8> {
    let mut builder = Builder::from((1, minor_version));
    builder.point_format = Format { extra_bytes: 8, ..Format::new(format).unwrap() };
    if 2 <= minor_version {
        builder.gps_time_type = GpsTimeType::Standard;
    }
    let axis = |offset| Transform { scale: 0.01, offset };
    builder.transforms = Vector { x: axis(484_000.5), y: axis(6_632_000.0), z: axis(-10.0) };
    // Some programs write a record for each extra column.
    let descriptions = [description(3, 0x1f, "Height"), description(24, 0x18, "Slope")];
    let extras = descriptions.map(|description| vlr("LASF_Spec", 4, &description));
    builder.vlrs = [vec![projection(format)], extras.to_vec()].concat();
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    let format = *writer.header().point_format();
    for i in 0..N_POINTS {
        writer.write_point(point(i, &format)).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// Writes a cloud as the LAS file that it comes from, and reads header and points by the crate `las`.
fn written_again(
    cloud: &PointCloud,
    info: &FileInfo,
    extension: &str,
) -> (Header, Vec<Point>, Listener) {
    let folder = Folder::new(&format!("las-again-{extension}-{}", info.format));
    let (path, listener) = (folder.path(&format!("a.{extension}")), Listener::default());
    save(&path, cloud, &SaveOptions::from_source(info), &listener).unwrap();
    let reader = las::Reader::from_path(&path).unwrap();
    (reader.header().clone(), points_of(reader), listener)
}

fn points_of(mut reader: las::Reader) -> Vec<Point> {
    reader.read_all().unwrap().points().map(Result::unwrap).collect()
}

fn kind(header: &Header) -> Kind {
    (header.version().minor, header.point_format().to_u8().unwrap() & 0x3f)
}

#[test]
fn las_files_keep_version_format_and_fields() {
    for kinds in [(1, 0), (2, 0), (2, 1), (2, 2), (2, 3), (3, 3), (4, 3), (4, 6), (4, 7), (4, 8)] {
        let bytes = las_file(kinds);
        let expected = points_of(las::Reader::new(Cursor::new(bytes.clone())).unwrap());
        let Loaded { cloud, info } = read("a.las", bytes).unwrap();
        for extension in ["las", "laz"] {
            let (header, points, listener) = written_again(&cloud, &info, extension);
            assert_eq!(kind(&header), kinds, "{extension}");
            assert!(!listener.has_note("written as LAS"), "{kinds:?} {extension}");
            let transforms = header.transforms();
            assert_eq!((transforms.x.scale, transforms.x.offset), (0.01, 484_000.5));
            assert_eq!((transforms.z.scale, transforms.z.offset), (0.01, -10.0));
            let is_standard = header.gps_time_type() == GpsTimeType::Standard;
            assert_eq!(is_standard, 2 <= kinds.0, "{kinds:?}");
            assert_eq!(header.has_wkt_crs(), 6 <= kinds.1, "{kinds:?}");
            let system = projection(kinds.1);
            let found = header.vlrs().iter().find(|vlr| vlr.user_id == system.user_id).unwrap();
            assert_eq!((found.record_id, &found.data), (system.record_id, &system.data));
            assert_eq!(header.number_of_points_by_return(2), Some(u64::from(N_POINTS) / 3));
            assert_eq!(points, expected, "{kinds:?} {extension}");
        }
    }
}

#[test]
fn extra_bytes_keep_their_descriptions() {
    let Loaded { cloud, info } = read("a.las", las_file((2, 1))).unwrap();
    let (header, ..) = written_again(&cloud, &info, "laz");
    let record = header.vlrs().iter().find(|vlr| vlr.user_id == "LASF_Spec").unwrap();
    let names = ["Height", "Slope[0]", "Slope[1]", "Slope[2]"];
    assert_eq!(record.data.len(), 192 * names.len());
    for ((found, name), value) in record.data.chunks(192).zip(names).zip([0, 0, 1, 2]) {
        let is_height = name == "Height";
        let (data_type, options) = if is_height { (3, 0x19) } else { (4, 0x18) };
        let mut expected = description(data_type, options, name);
        // A single value has one scale and one offset, and the least and greatest value are left out.
        expected[112..120].copy_from_slice(&(0.01 * (value + 1) as f64).to_le_bytes());
        expected[120..136].fill(0);
        expected[144..160].fill(0);
        if !is_height && value != 0 {
            expected[40..48].fill(0);
        }
        assert_eq!(found, expected, "{name}");
    }
    // Values that no longer fit the type of the file get one of their own.
    let mut changed = cloud;
    let height = changed.scalars.iter_mut().find(|scalar| scalar.name == "Height").unwrap();
    height.values = Values::F32((0..N_POINTS).map(|i| f32::from(i) * 0.3 - 100.0).collect());
    let (header, ..) = written_again(&changed, &info, "las");
    let record = header.vlrs().iter().find(|vlr| vlr.user_id == "LASF_Spec").unwrap();
    let own = record.data.chunks(192).find(|found| found[4..].starts_with(b"Height")).unwrap();
    assert_eq!((own[2], own[3], &own[160..172]), (9, 0, &b"above ground"[..]));
}

#[test]
fn a_reflectance_in_extra_bytes_stands_beside_the_intensity() {
    let rename = |name: &[u8; 12]| {
        let mut bytes = las_file((1, 1));
        let at = bytes.windows(7).position(|found| found == b"Height\0").unwrap();
        bytes[at..at + 12].copy_from_slice(name);
        read("a.las", bytes).unwrap().cloud
    };
    let standard = read("a.las", las_file((1, 1))).unwrap().cloud.intensity;
    let calibrated = rename(b"Reflectance\0");
    assert_eq!(calibrated.intensity, standard);
    assert!(calibrated.scalar("Reflectance").is_some());
    let replaced = rename(b"Intensity\0\0\0");
    assert!(
        replaced.intensity != standard && replaced.scalars.iter().all(|s| s.name != "Intensity")
    );
}

#[test]
fn missing_values_in_extra_bytes_are_no_numbers_and_stay_missing() {
    let mut bytes = las_file((1, 1));
    // A record of point format 1 has 28 bytes before the extra bytes, the first of which are the height.
    let record = bytes.len() - 36;
    bytes[record + 28..record + 30].fill(0xff);
    let Loaded { cloud, info } = read("a.las", &bytes).unwrap();
    let Some(Values::F32(heights)) = cloud.scalar("Height") else { panic!() };
    let last = usize::from(N_POINTS) - 1;
    assert!(heights[last].is_nan() && heights[1] == -4.99, "{:?}", &heights[last - 1..]);
    let (_, points, _) = written_again(&cloud, &info, "las");
    let expected = points_of(las::Reader::new(Cursor::new(bytes)).unwrap());
    assert_eq!(points, expected);
}

#[test]
fn the_geodetic_system_below_a_projected_one_is_not_that_of_the_file() {
    let system = |keys: &[[u16; 4]]| {
        let mut builder = Builder::from((1, 2));
        let keys = [&[[1, 1, 0, keys.len() as u16]], keys].concat();
        let keys: Vec<u8> = keys.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        let texts = b"Site grid|NAD83|";
        builder.vlrs =
            vec![vlr("LASF_Projection", 34735, &keys), vlr("LASF_Projection", 34737, texts)];
        let header = builder.into_header().unwrap();
        let mut writer = Writer::new(Cursor::new(Vec::new()), header).unwrap();
        writer.write_point(Point::default()).unwrap();
        read("a.las", writer.into_inner().unwrap().into_inner()).unwrap().info.coordinate_system
    };
    let (projected, geographic) = ([1024, 0, 1, 1], [1024, 0, 1, 2]);
    let (own, nad83) = ([3072, 0, 1, 32767], [2048, 0, 1, 4269]);
    let (name, name_of_nad83) = ([3073, 34737, 10, 0], [2049, 34737, 6, 10]);
    assert_eq!(system(&[projected, nad83, own, name]).as_deref(), Some("Site grid"));
    assert_eq!(system(&[nad83, own, name]).as_deref(), Some("Site grid"));
    assert_eq!(system(&[projected, nad83, name_of_nad83]), None);
    assert_eq!(system(&[geographic, nad83]).as_deref(), Some("EPSG:4269"));
    assert_eq!(system(&[nad83]).as_deref(), Some("EPSG:4269"));
    let lambert = [3072, 0, 1, 2154];
    assert_eq!(system(&[projected, nad83, lambert]).as_deref(), Some("EPSG:2154"));
}

#[test]
fn changes_of_version_and_format_are_reported() {
    let expect = |kinds: Kind, change: &dyn Fn(&mut PointCloud), expected: Kind, reason: &str| {
        let Loaded { mut cloud, info } = read("a.las", las_file(kinds)).unwrap();
        change(&mut cloud);
        let (header, _, listener) = written_again(&cloud, &info, "laz");
        assert_eq!(kind(&header), expected, "{kinds:?}");
        // GeoTIFF keys become WKT in the formats that require it.
        assert_eq!(header.has_wkt_crs(), 6 <= expected.1, "{kinds:?}");
        assert!(listener.has_note(reason), "{kinds:?}: {:?}", listener.notes);
    };
    let n = usize::from(N_POINTS);
    let add_colors = |cloud: &mut PointCloud| cloud.colors = Some(vec![[1, 2, 3]; n]);
    expect((1, 1), &add_colors, (2, 3), "point format 3, not as LAS 1.1, point format 1: colours");
    expect((4, 6), &add_colors, (4, 7), "point format 7, not as LAS 1.4, point format 6: colours");
    let add_classes = |cloud: &mut PointCloud| cloud.classification = Some(vec![64; n]);
    expect((2, 3), &add_classes, (4, 7), "LAS 1.2, point format 3: classes above 31");
    let add_overlap = |cloud: &mut PointCloud| {
        let values = Values::U8(vec![1; n]);
        cloud.scalars.push(Scalar { name: "overlap".into(), values });
    };
    expect((2, 1), &add_overlap, (4, 6), "point format 1: flags of overlap or scanner channels");
    let add_times = |cloud: &mut PointCloud| {
        let values = Values::F64(vec![7.5; n]);
        cloud.scalars.push(Scalar { name: "gps_time".into(), values });
    };
    expect((2, 0), &add_times, (2, 1), "GPS times");
    expect((3, 4), &|_| (), (3, 1), "waveforms are not kept");
    let add_normals =
        |cloud: &mut PointCloud| cloud.normals = Some(vec![surfel_core::math::Vec3::Z; n]);
    let Loaded { mut cloud, info } = read("a.las", las_file((2, 0))).unwrap();
    add_normals(&mut cloud);
    let (header, _, listener) = written_again(&cloud, &info, "las");
    assert_eq!((kind(&header), listener.notes.lock().unwrap().len()), ((2, 0), 0));
}

#[test]
fn several_las_files_become_one_of_the_highest_version() {
    let folder = Folder::new("las-several");
    let merged = |kinds: &[Kind]| {
        let paths: Vec<_> = (0..kinds.len()).map(|i| folder.path(&format!("{i}.las"))).collect();
        for (path, kinds) in paths.iter().zip(kinds) {
            std::fs::write(path, las_file(*kinds)).unwrap();
        }
        let (all, _) = load_all(&paths, &LoadOptions::default(), &NoProgress).unwrap();
        kind(&written_again(&all.cloud, &all.info, "laz").0)
    };
    assert_eq!(merged(&[(2, 1), (2, 3)]), (2, 1));
    assert_eq!(merged(&[(2, 3), (4, 7), (2, 3)]), (4, 7));
    assert_eq!(merged(&[(1, 0), (3, 3)]), (3, 0));
}

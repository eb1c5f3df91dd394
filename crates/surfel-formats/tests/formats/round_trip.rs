//! Clouds that are written and read back within the resolution of the format.

use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::points::{PointCloud, STATION, Scalar, ScanStation, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{ColumnChoice, Error, LoadOptions, Loaded, SaveOptions, load, load_all, save};

use crate::common::{
    Folder, Listener, colors_in_file, full_cloud, largest_difference, read, round_trip, shared,
};

#[test]
fn every_column_round_trips() {
    for n in [0, 1, 2, 120_000] {
        for extension in ["ply", "las", "laz"] {
            let cloud = full_cloud(n);
            let options =
                SaveOptions { resolution: Some(DVec3::splat(0.001)), ..Default::default() };
            let back = round_trip(&cloud, extension, &options).cloud;
            let allowed = if extension == "ply" { 0.0 } else { 1e-3 };
            assert!(largest_difference(&cloud, &back).max_element() <= allowed, "{extension} {n}");
            assert!(back.normals == cloud.normals, "{extension} {n}");
            assert!(back.radii == cloud.radii, "{extension} {n}");
            assert!(back.colors == colors_in_file(&cloud, extension), "{extension} {n}");
            assert!(back.intensity == cloud.intensity, "{extension} {n}");
            assert!(back.classification == cloud.classification, "{extension} {n}");
            for scalar in &cloud.scalars {
                assert_eq!(back.scalar(&scalar.name), Some(&scalar.values), "{extension} {n}");
            }
        }
    }
}

#[test]
fn ply_positions_round_trip_bit_exactly() {
    let positions = vec![Vec3::new(0.1, 1e-20, -3e7), Vec3::new(f32::NAN, f32::INFINITY, 0.0)];
    let back =
        round_trip(&PointCloud::from_positions(positions.clone()), "ply", &SaveOptions::default());
    let bits = |positions: &[Vec3]| -> Vec<[u32; 3]> {
        positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
    };
    assert_eq!(bits(&back.cloud.positions), bits(&positions));
}

#[test]
fn stations_stay_in_ply_and_are_reported_lost_elsewhere() {
    let station = |name: &str, position, grid| ScanStation {
        name: name.into(),
        position,
        rotation: DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8),
        grid,
    };
    let mut cloud = full_cloud(4);
    cloud.stations = vec![
        station(
            "north  wall\nof the yard",
            Some(DVec3::new(0.1, 4_900_000.25, -3.0)),
            Some([3, 5]),
        ),
        station("", None, None),
    ];
    let values = Values::U16(vec![0, 1, 1, 0]);
    cloud.scalars.push(Scalar { name: STATION.into(), values });
    let folder = Folder::new("stations");
    let path = folder.path("a.ply");
    let listener = Listener::default();
    save(&path, &cloud, &SaveOptions::default(), &listener).unwrap();
    assert!(!listener.has_note("are lost"));
    // The stations of points are read, whatever columns are asked for.
    let columns = ColumnChoice::Only(Vec::new());
    let options = LoadOptions { columns, ..LoadOptions::default() };
    for options in [LoadOptions::default(), options] {
        let back = load(&path, &options, &NoProgress).unwrap().cloud;
        cloud.stations[0].name = "north wall of the yard".into();
        assert_eq!(back.stations, cloud.stations);
        assert_eq!(back.station_of(3), Some(&cloud.stations[0]));
    }
    for extension in ["las", "xyz"] {
        let listener = Listener::default();
        let path = folder.path(&format!("a.{extension}"));
        save(&path, &cloud, &SaveOptions::default(), &listener).unwrap();
        assert!(listener.has_note("warning: "), "{extension}");
        let words = format!("a.{extension}: name and pose of 2 stations are lost; files that keep");
        assert!(listener.has_note(&words) && listener.has_note(".ply"), "{:?}", listener.notes);
    }
    let mut file = std::fs::read(&path).unwrap();
    let text = b"comment station 0";
    let at = file.windows(text.len()).position(|bytes| bytes == text).unwrap();
    file[at + text.len() - 1] = b'x';
    assert_eq!(read("a.ply", file).unwrap().cloud.stations.len(), 1, "other comments are ignored");
}

#[test]
fn las_scale_fits_the_extent_of_the_cloud() {
    for size in [1e-3f32, 1.0, 50.0, 3e4, 1e9] {
        let positions =
            (0..100).map(|i| Vec3::splat(size * i as f32 / 99.0 - size / 3.0)).collect();
        let cloud = PointCloud::from_positions(positions);
        let back = round_trip(&cloud, "laz", &SaveOptions::default()).cloud;
        let error = largest_difference(&cloud, &back).max_element();
        assert!(error <= f64::from(size) * 1e-6, "{size} {error}");
    }
}

#[test]
fn failed_las_writes_keep_the_old_file() {
    let folder = Folder::new("infinite");
    let path = folder.path("a.las");
    std::fs::write(&path, "old").unwrap();
    let cloud = PointCloud::from_positions(vec![Vec3::ZERO, Vec3::splat(f32::INFINITY)]);
    let error = save(&path, &cloud, &SaveOptions::default(), &NoProgress).unwrap_err().to_string();
    assert!(error.contains("point 1"), "{error}");
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    let cancelled = save(&path, &full_cloud(10), &SaveOptions::default(), &listener);
    assert!(matches!(cancelled, Err(Error::Core(surfel_core::Error::Cancelled))));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(folder.names(), ["a.las"]);
}

#[test]
fn coordinate_systems_round_trip() {
    // Codes are written as WKT, which the point formats from 6 on require; unknown ones as GeoTIFF keys.
    let lambert = crs_definitions::from_code(2154).unwrap().wkt;
    assert!(lambert.contains("Lambert-93"));
    for (system, expected) in [
        ("EPSG:2154", lambert),
        ("EPSG:2154+5720", lambert),
        ("EPSG:1", "EPSG:1"),
        ("PROJCS[\"somewhere\"]", "PROJCS[\"somewhere\"]"),
    ] {
        for extension in ["las", "laz"] {
            let options =
                SaveOptions { coordinate_system: Some(system.into()), ..Default::default() };
            let back = round_trip(&full_cloud(3), extension, &options);
            assert_eq!(back.info.coordinate_system.as_deref(), Some(expected));
            let las = back.info.las.unwrap();
            assert_eq!((las.point_format, las.global_encoding & 16 != 0), (7, system != "EPSG:1"));
        }
    }
}

#[test]
fn the_las_crate_reads_written_files() {
    let folder = Folder::new("oracle");
    let cloud = full_cloud(60_000);
    for extension in ["las", "laz"] {
        let path = folder.path(&format!("a.{extension}"));
        save(&path, &cloud, &SaveOptions::default(), &NoProgress).unwrap();
        let mut reader = las::Reader::from_path(&path).unwrap();
        assert_eq!(reader.header().number_of_points(), 60_000);
        let bounds = reader.header().bounds();
        for (i, point) in reader.read_all().unwrap().points().enumerate() {
            let point = point.unwrap();
            let position = DVec3::new(point.x, point.y, point.z);
            assert!((position - cloud.world_position(i)).abs().max_element() < 1e-3);
            assert!(bounds.min.x <= point.x && point.x <= bounds.max.x);
            assert_eq!(f32::from(point.intensity), cloud.intensity.as_ref().unwrap()[i]);
            let color = point.color.unwrap();
            assert_eq!([color.red, color.green, color.blue], cloud.colors.as_ref().unwrap()[i]);
            assert_eq!(point.gps_time.unwrap(), cloud.scalar("gps_time").unwrap().get(i));
            assert_eq!(
                f64::from(point.return_number),
                cloud.scalar("return_number").unwrap().get(i)
            );
        }
    }
}

#[test]
fn scans_round_trip_within_their_resolution() {
    for name in ["lone-star.copc.laz", "ign_lidar_697k.laz", "sample_c.las", "vol_total.ply"] {
        let Some(path) = shared(&format!("clouds/{name}")) else { return };
        let Loaded { cloud, info } = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
        let options = SaveOptions::from_source(&info);
        for extension in ["ply", "laz"] {
            let back = round_trip(&cloud, extension, &options);
            let step = info.resolution.unwrap_or(DVec3::splat(1e-3));
            let error = largest_difference(&cloud, &back.cloud) / step;
            assert!(error.max_element() <= 0.51, "{name} {extension}: {error} steps");
            let colors = colors_in_file(&cloud, extension);
            assert!(back.cloud.colors == colors, "{name} {extension}");
            assert!(back.cloud.intensity == cloud.intensity, "{name} {extension}");
            assert!(back.cloud.classification == cloud.classification, "{name} {extension}");
            for scalar in &cloud.scalars {
                // LAS 1.4 stores scan angles in steps of 0.006 degrees.
                let allowed = if scalar.name == "scan_angle" { 0.0031 } else { 0.0 };
                let other =
                    back.cloud.scalar(&scalar.name).unwrap_or_else(|| panic!("{}", scalar.name));
                for i in 0..cloud.len() {
                    let difference = (scalar.values.get(i) - other.get(i)).abs();
                    assert!(difference <= allowed, "{name} {extension} {} {i}", scalar.name);
                }
            }
            if extension == "laz" {
                assert_eq!(back.info.coordinate_system, info.coordinate_system, "{name}");
            }
        }
    }
}

#[test]
fn several_files_merge_with_their_common_columns() {
    let folder = Folder::new("several");
    let mut other = full_cloud(4);
    other.origin += DVec3::new(100.0, 0.0, 0.0);
    other.radii = None;
    let paths = [folder.path("a.laz"), folder.path("b.ply")];
    save(&paths[0], &full_cloud(3), &SaveOptions::default(), &NoProgress).unwrap();
    save(&paths[1], &other, &SaveOptions::default(), &NoProgress).unwrap();

    let listener = Listener::default();
    let (all, infos) = load_all(&paths, &LoadOptions::default(), &listener).unwrap();
    assert_eq!((all.cloud.len(), infos.len()), (7, 2));
    assert!(listener.has_note("dropped: radii"));
    assert!((all.cloud.world_position(3) - other.world_position(0)).length() < 1e-3);
    assert!(matches!(all.cloud.scalar("gps_time"), Some(Values::F64(_))));
    assert!(matches!(load_all(&[], &LoadOptions::default(), &NoProgress), Err(Error::NoInput)));
}

#[test]
fn distant_files_keep_their_precision_and_rounding_is_reported() {
    let folder = Folder::new("far-apart");
    let n = 1000;
    let (near, far) = (folder.path("near.xyz"), folder.path("far.xyz"));
    let lines = |zero: f64, n: usize| -> String {
        (0..n).map(|i| format!("{} 2.25 3.5\n", zero + i as f64 * 0.01)).collect()
    };
    std::fs::write(&near, lines(0.0, n)).unwrap();
    std::fs::write(&far, lines(4_900_000.0, 10)).unwrap();

    // In either order, the larger file keeps its positions, and the rounding of the smaller one is reported.
    for paths in [[far.clone(), near.clone()], [near.clone(), far.clone()]] {
        let listener = Listener::default();
        let (all, _) = load_all(&paths, &LoadOptions::default(), &listener).unwrap();
        let mut xs: Vec<u32> = all.cloud.positions.iter().map(|p| p.x.to_bits()).collect();
        xs.sort_unstable();
        xs.dedup();
        assert!(n <= xs.len(), "{} places", xs.len());
        assert!(
            listener.has_note("far.xyz: far from the common origin [0, 0, 0]: its x is rounded")
        );
        assert!(!listener.has_note("near.xyz: far"));
    }

    let listener = Listener::default();
    let (single, infos) = load_all(&[far], &LoadOptions::default(), &listener).unwrap();
    assert_eq!(infos, [single.info]);
    assert!((single.cloud.world_position(9).x - 4_900_000.09).abs() < 1e-6);
    assert!(!listener.has_note("common origin"));
}

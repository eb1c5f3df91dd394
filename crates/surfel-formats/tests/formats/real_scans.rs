//! Real scans, compared with an independent reader and with known facts.

use std::collections::HashSet;

use surfel_core::math::DVec3;
use surfel_core::points::{GaussianColumns, PointCloud, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{Column, ColumnChoice, LoadOptions, inspect, load};

use crate::common::{Listener, shared};

#[test]
fn las_and_laz_agree_with_the_las_crate() {
    for name in ["ign_lidar_697k.laz", "lone-star.copc.laz", "sample_c.las"] {
        let Some(path) = shared(&format!("clouds/{name}")) else { return };
        let loaded = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
        let cloud = loaded.cloud;
        let step = loaded.info.resolution.unwrap();
        let mut reader = las::Reader::from_path(&path).unwrap();
        assert_eq!(cloud.len() as u64, reader.header().number_of_points(), "{name}");
        let column =
            |scalar: &str| cloud.scalar(scalar).unwrap_or_else(|| panic!("{name} {scalar}"));
        for (i, point) in reader.read_all().unwrap().points().enumerate() {
            let point = point.unwrap();
            let difference =
                (DVec3::new(point.x, point.y, point.z) - cloud.world_position(i)).abs();
            assert!((difference / step).max_element() < 0.1, "{name} {i}: {difference}");
            let intensity = cloud.intensity.as_ref().map_or(0.0, |column| column[i]);
            assert_eq!(intensity, f32::from(point.intensity), "{name} {i}");
            let class = cloud.classification.as_ref().map_or(0, |column| column[i]);
            assert_eq!(class, u8::from(point.classification), "{name} {i}");
            assert_eq!(column("return_number").get(i), f64::from(point.return_number));
            assert_eq!(column("number_of_returns").get(i), f64::from(point.number_of_returns));
            assert!((column("scan_angle").get(i) - f64::from(point.scan_angle)).abs() < 1e-3);
            assert_eq!(column("user_data").get(i), f64::from(point.user_data));
            assert_eq!(column("point_source_id").get(i), f64::from(point.point_source_id));
            assert_eq!(column("gps_time").get(i), point.gps_time.unwrap());
            if let (Some(colors), Some(color)) = (&cloud.colors, point.color) {
                assert_eq!(colors[i], [color.red, color.green, color.blue], "{name} {i}");
            }
            if let Some(nir) = point.nir {
                assert_eq!(column("nir").get(i), f64::from(nir), "{name} {i}");
            }
        }
    }
}

#[test]
fn extra_bytes_become_named_columns() {
    let Some(path) = shared("clouds/ign_lidar_697k.laz") else { return };
    let loaded = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
    assert_eq!(loaded.info.format, "LAZ 1.4, point format 8");
    assert!(matches!(loaded.cloud.scalar("Deviation"), Some(Values::U16(_))));
    assert_eq!(loaded.cloud.scalar("Deviation").unwrap().len(), 697_721);
}

#[test]
fn unselected_columns_are_not_loaded() {
    let Some(path) = shared("clouds/ign_lidar_697k.laz") else { return };
    let all = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    let columns = ColumnChoice::Only(vec![Column::Colors]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    let some = load(&path, &options, &NoProgress).unwrap().cloud;
    assert_eq!((some.positions, some.colors), (all.positions, all.colors));
    assert_eq!((some.intensity, some.scalars.len()), (None, 0));
}

#[test]
fn trained_splats_lose_the_faint_ones_as_discs_only() {
    let Some(path) = shared("splats/fourth_st_part_a.ply") else { return };
    let cloud = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    assert_eq!(inspect(&path).unwrap().n_points, Some(48_000));
    assert_eq!(
        (cloud.len(), cloud.disc_indices().map(|discs| discs.len())),
        (48_000, Some(47_673))
    );
    assert_eq!(GaussianColumns::new(&cloud).unwrap().n_harmonics(), 16);
    let columns = ColumnChoice::Only(vec![Column::Colors, Column::Normals, Column::Radii]);
    let options = LoadOptions { columns, ..LoadOptions::default() };
    let cloud = load(&path, &options, &NoProgress).unwrap().cloud;
    assert_eq!((cloud.len(), cloud.scalars.len()), (47_673, 0));
    assert!(cloud.colors.is_some() && cloud.normals.is_some() && cloud.radii.is_some());
}

#[test]
fn ply_scans_have_the_known_number_of_points() {
    let facts = [
        ("clouds/vol_total.ply", 498_868, true),
        ("meshes/bun_zipper.ply", 35_947, false),
        ("meshes/armadillo_26k.ply", 26_002, false),
    ];
    for (name, n_points, has_colors) in facts {
        let Some(path) = shared(name) else { return };
        let loaded = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
        assert_eq!(loaded.cloud.len(), n_points, "{name}");
        assert_eq!(loaded.cloud.colors.is_some(), has_colors, "{name}");
        assert_eq!(inspect(&path).unwrap().n_points, Some(n_points as u64), "{name}");
    }
    let Some(path) = shared("meshes/bun_zipper.ply") else { return };
    let bunny = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    assert!((bunny.bounds().min.y - 0.033).abs() < 1e-3);
    assert!(bunny.intensity.is_some() && bunny.scalar("confidence").is_some());
}

#[test]
fn text_scans_agree_with_their_ply_originals() {
    let Some(path) = shared("clouds/vol_total_quarter.xyz") else { return };
    let text = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    let ply = load(&shared("clouds/vol_total.ply").unwrap(), &LoadOptions::default(), &NoProgress);
    let ply = ply.unwrap().cloud;
    assert_eq!(text.len(), 124_717);
    // The text file has every fourth point, in another order and truncated to millimetres.
    let point = |cloud: &PointCloud, i: usize| {
        let steps = (cloud.world_position(i) / DVec3::new(0.01, 0.01, 0.005)).round().as_i64vec3();
        (steps, cloud.colors.as_ref().unwrap()[i])
    };
    let points: HashSet<_> = (0..ply.len()).map(|i| point(&ply, i)).collect();
    assert!((0..text.len()).all(|i| points.contains(&point(&text, i))));
    let listener = Listener::default();
    let path = shared("clouds/pumpA.pts").unwrap();
    let pts = load(&path, &LoadOptions::default(), &listener).unwrap().cloud;
    assert_eq!(pts.len(), 155_201);
    assert!(pts.intensity.is_some() && pts.colors.is_some());
    assert!(listener.has_note("x y z intensity r g b"));
    let path = shared("meshes/stanford-bunny.obj").unwrap();
    assert_eq!(load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud.len(), 35_947);
}

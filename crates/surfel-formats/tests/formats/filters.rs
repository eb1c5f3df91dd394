//! Filters are applied while files of every format are read.

use serde_json::json;
use surfel_core::math::DVec3;
use surfel_core::points::PointFilter;
use surfel_core::progress::NoProgress;
use surfel_core::scene::Geometry;
use surfel_formats::{Column, ColumnChoice, LoadOptions, load, load_bytes, load_graph_bytes};

use crate::common::{Listener, encode_cloud, full_cloud, read, shared};
use crate::gltf_asset::{Asset, SQUARE, full_asset};
use crate::{e57_writer, esri_grid, gltf, pcd, ptx};

fn filtered(filter: &str) -> LoadOptions {
    let filter: PointFilter = filter.parse().unwrap();
    LoadOptions { filter: Some(filter), ..LoadOptions::default() }
}

#[test]
fn every_format_keeps_the_same_points_as_a_filter_afterwards() {
    let cloud = full_cloud(120_000);
    let mut dim = full_cloud(120_000);
    dim.colors = dim.colors.map(|c| c.iter().map(|color| [color[0] / 257, 7, 0]).collect());
    let files = [
        ("a.ply", encode_cloud(&cloud, "ply"), "classification[2:4] && count < -7"),
        ("a.las", encode_cloud(&cloud, "las"), "ReturnNumber == 1 || z > 300"),
        ("a.laz", encode_cloud(&cloud, "laz"), "ReturnNumber == 1 || z > 300"),
        ("dim.las", encode_cloud(&dim, "las"), "red > 200"),
        ("dim.laz", encode_cloud(&dim, "laz"), "red > 200"),
        ("a.csv", "x,y,z\n1,2,3\n4,5,6\n7,8,9\n".into(), "x > 1 && z != 9"),
        ("ascii.pcd", pcd::ascii_file().into(), "label == 7"),
        ("compressed.pcd", pcd::compressed_file(), "red > 0"),
        ("a.ptx", ptx::two_scans().into(), "intensity >= 0.75"),
        ("a.e57", e57_writer::small_file(), "z < 5 || y > 4900005"),
        (
            "a.bin",
            [1.0f32, 2.0, 3.0].map(|x| [x; 7].map(f32::to_le_bytes).concat()).concat(),
            "x > 1",
        ),
        ("a.off", "COFF\n2 0 0\n1 2 3 255 0 0 255\n4 5 6 0 255 0 255\n".into(), "green > 100"),
        ("a.obj", "v 1 2 3\nv 4 5 6\nv 7 8 9\n".into(), "y == 5"),
        (
            "a.asc",
            (esri_grid::HEADER.to_owned() + "5 6 7\n8 -9999 9\n").into(),
            "z > 6 && y < 2010",
        ),
        ("a.glb", two_clouds().glb(), "z > 0.5 && red > 100"),
        ("a.gltf", gltf::embedded(&full_asset()), "z >= 1"),
    ];
    for (name, bytes, filter) in files {
        let whole = read(name, &bytes).unwrap().cloud;
        let options = filtered(filter);
        let matches = options.filter.as_ref().unwrap().matches(&whole, 0).unwrap();
        let kept: Vec<u32> = (0..whole.len() as u32).filter(|i| matches[*i as usize]).collect();
        assert!(!kept.is_empty() && kept.len() < whole.len(), "{name}");
        let listener = Listener::default();
        let loaded = load_bytes(name, &bytes, &options, &listener).unwrap();
        assert_eq!(loaded.cloud, whole.subset(&kept), "{name}");
        assert_eq!(loaded.info.n_points, Some(kept.len() as u64), "{name}");
        let line = format!("{} of {} points meet", kept.len(), whole.len());
        assert!(listener.has_note(&line), "{name}: {:?}", listener.notes);
    }
}

/// Returns a glTF scene of a square of points that two nodes show, the second one 10 units higher.
fn two_clouds() -> Asset {
    let mut asset = Asset::new();
    let position = asset.numbers("VEC3", &SQUARE);
    let colors = [[0u8, 0, 0, 255], [255; 4], [255, 0, 0, 255], [0, 0, 9, 255]];
    let color = asset.numbers("VEC4", colors.as_flattened());
    let attributes = json!({"POSITION": position, "COLOR_0": color});
    let mut asset = asset.with_primitive(json!({"attributes": attributes, "mode": 0}));
    let raised = asset.push("nodes", json!({"mesh": 0, "translation": [0, 10, 0]}));
    asset.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(raised));
    asset
}

#[test]
fn the_clouds_of_a_scene_graph_are_filtered_in_world_coordinates() {
    let shown = |filter: &str, columns: ColumnChoice| {
        let options = LoadOptions { columns, ..filtered(filter) };
        let bytes = two_clouds().glb();
        let (graph, info) = load_graph_bytes("a.glb", &bytes, &options, &NoProgress).unwrap();
        graph.validate();
        let n_points = graph.geometries.iter().map(|geometry| geometry.positions().len());
        let n_points: Vec<usize> = n_points.collect();
        assert_eq!(info.n_points, Some(n_points.iter().sum::<usize>() as u64), "{filter}");
        let parts = graph.nodes.iter().flat_map(|node| &node.primitives);
        let parts: Vec<usize> = parts.map(|part| part.geometry).collect();
        let has_colors = graph.geometries.iter().all(|geometry| match geometry {
            Geometry::Points(cloud) => cloud.colors.is_some(),
            Geometry::Triangles(_) => false,
        });
        (n_points, parts, has_colors)
    };
    let all = || ColumnChoice::All;
    assert_eq!(shown("x < 0.5", all()), (vec![2], vec![0, 0], true));
    assert_eq!(shown("z > 0.5", all()), (vec![2, 4], vec![0, 1], true));
    assert_eq!(shown("z > 5", all()), (vec![4], vec![0], true));
    assert_eq!(shown("z > 50", all()), (vec![0], vec![0], true));
    let none = ColumnChoice::Only(Vec::new());
    assert_eq!(shown("red > 100", none), (vec![2], vec![0, 0], false));
}

#[test]
fn the_columns_and_the_origin_of_a_scene_are_those_of_the_options() {
    let origin = Some(DVec3::new(1.0, 0.0, 5.0));
    let columns = ColumnChoice::Only(Vec::new());
    let options = LoadOptions { columns, origin, ..LoadOptions::default() };
    let cloud = load_bytes("a.glb", &two_clouds().glb(), &options, &NoProgress).unwrap().cloud;
    assert_eq!((Some(cloud.origin), cloud.colors.is_none(), cloud.len()), (origin, true, 8));
    assert!((cloud.world_position(4) - DVec3::new(0.0, 0.0, 10.0)).length() < 1e-6);
}

#[test]
fn columns_of_the_filter_alone_are_not_kept() {
    let bytes = encode_cloud(&full_cloud(50), "laz");
    let columns = ColumnChoice::Only(vec![Column::Colors]);
    let options = LoadOptions { columns, ..filtered("ReturnNumber == 2 && class > 3") };
    let cloud = load_bytes("a.laz", &bytes, &options, &NoProgress).unwrap().cloud;
    assert!(!cloud.is_empty() && cloud.len() < 50);
    assert!(cloud.colors.is_some() && cloud.classification.is_none() && cloud.scalars.is_empty());
}

#[test]
fn unknown_columns_are_rejected() {
    for (name, bytes) in
        [("a.csv", b"x,y,z\n1,2,3\n".to_vec()), ("a.ply", encode_cloud(&full_cloud(5), "ply"))]
    {
        let error = load_bytes(name, &bytes, &filtered("shade == 1"), &NoProgress).unwrap_err();
        assert!(error.to_string().contains("'shade'"), "{name}: {error}");
    }
    // Columns that the filter does not need are known as well, though they are not read.
    let columns = ColumnChoice::Only(vec![Column::Colors]);
    let options = LoadOptions { columns, ..filtered("number_of_return == 2") };
    let bytes = encode_cloud(&full_cloud(5), "las");
    let error = load_bytes("a.las", &bytes, &options, &NoProgress).unwrap_err().to_string();
    assert!(error.contains(", return_number, number_of_returns, classification, "), "{error}");
}

#[test]
fn real_scan_is_filtered() {
    let Some(path) = shared("clouds/ign_lidar_697k.laz") else { return };
    let options = filtered("classification == 2 && return_number == number_of_returns");
    let ground = load(&path, &options, &NoProgress).unwrap().cloud;
    assert!(ground.classification.as_ref().unwrap().iter().all(|class| *class == 2));
    let all = load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud;
    let matches = options.filter.unwrap().matches(&all, 0).unwrap();
    assert_eq!(ground.len(), matches.iter().filter(|is_match| **is_match).count());
}

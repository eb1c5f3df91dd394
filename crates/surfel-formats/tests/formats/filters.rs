//! Filters are applied while files of every format are read.

use surfel_core::points::PointFilter;
use surfel_core::progress::NoProgress;
use surfel_formats::{Column, ColumnChoice, LoadOptions, load, load_bytes};

use crate::common::{Listener, encode_cloud, full_cloud, read, shared};
use crate::{e57_writer, pcd, ptx};

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

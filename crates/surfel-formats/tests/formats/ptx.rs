//! PTX files: grids, poses, several scans, and broken lines.

use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::{COLUMN_INDEX, ROW_INDEX, STATION, Values};
use surfel_core::progress::NoProgress;
use surfel_formats::{ColumnChoice, Error, LoadOptions, load, load_bytes};

use crate::common::{Listener, read, shared};

/// Returns a scan of two columns and one row, moved by `translation` after a quarter turn about z.
fn scan(translation: [f64; 3], cells: &str) -> String {
    let [x, y, z] = translation;
    format!(
        "2\n1\n{x} {y} {z}\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n{x} {y} {z} 1\n\
        {cells}"
    )
}

/// Returns a file of two scans, one with colours.
pub fn two_scans() -> String {
    let first = scan([500_000.0, 4_900_000.0, 10.0], "1 0 0 0.25 255 0 128\n0 0 0 0.5 0 0 0\n");
    first + &scan([500_010.0, 4_900_000.0, 10.0], "0 2 0 0.75\n1 2 3 1\n")
}

#[test]
fn scans_are_moved_to_world_coordinates() {
    let listener = Listener::default();
    let loaded =
        load_bytes("a.ptx", two_scans().as_bytes(), &LoadOptions::default(), &listener).unwrap();
    let cloud = loaded.cloud;
    let world: Vec<DVec3> = (0..cloud.len()).map(|i| cloud.world_position(i)).collect();
    let expected = [[500_000.0, 1.0, 0.0], [500_008.0, 0.0, 0.0], [500_008.0, 1.0, 3.0]];
    let offset = DVec3::new(0.0, 4_900_000.0, 10.0);
    assert_eq!(world, expected.map(|p| DVec3::from_array(p) + offset));
    assert_eq!(cloud.intensity, Some(vec![0.25, 0.75, 1.0]));
    assert_eq!(cloud.colors.unwrap()[0], [65535, 0, 128 * 257]);
    assert!(listener.has_note("skipped 1 of 4 cells of the scanner's grid: empty"));
    assert_eq!(loaded.info.format, "PTX, 2 scans");
    assert_eq!(loaded.info.n_points, Some(3));
}

#[test]
fn points_know_their_station() {
    let cloud = read("a.ptx", two_scans()).unwrap().cloud;
    assert_eq!(cloud.scalar(STATION), Some(&Values::U16(vec![0, 1, 1])));
    let station = cloud.station_of(2).unwrap();
    assert_eq!(station.name, "scan 2");
    assert_eq!(station.position, Some(DVec3::new(500_010.0, 4_900_000.0, 10.0)));
    let single = read("a.ptx", scan([0.0; 3], "1 2 3 1\n4 5 6 1\n")).unwrap().cloud;
    assert!(single.scalar(STATION).is_none());
    let turned = single.station_of(0).unwrap().rotation * DVec3::X;
    assert!(turned.distance(DVec3::Y) < 1e-12, "{turned}");
    assert_eq!(single.station_of(0).unwrap().position, Some(DVec3::ZERO));
    assert_eq!(single.station_of(0).unwrap().grid, Some([1, 2]));
}

#[test]
fn points_know_their_row_and_column() {
    let grid = |columns: u64, rows: u64, n_cells: usize| {
        let header = scan([0.0; 3], "").replacen("2\n1\n", &format!("{columns}\n{rows}\n"), 1);
        let cells = (0..n_cells).map(|i| format!("{} 1 1\n", if i == 2 { "nan" } else { "1" }));
        read("a.ptx", header + &cells.collect::<String>()).unwrap().cloud
    };
    let cloud = grid(2, 3, 6);
    assert_eq!(cloud.scalar(ROW_INDEX), Some(&Values::U16(vec![0, 1, 0, 1, 2])));
    assert_eq!(cloud.scalar(COLUMN_INDEX), Some(&Values::U16(vec![0, 0, 1, 1, 1])));
    let wide = grid(70_000, 1, 70_000);
    assert_eq!(wide.scalar(COLUMN_INDEX).unwrap().get(69_998), 69_999.0);
    assert_eq!(wide.scalar(ROW_INDEX).unwrap().get(69_998), 0.0);
    let choice = LoadOptions { columns: ColumnChoice::Only(Vec::new()), ..LoadOptions::default() };
    let bare = load_bytes("a.ptx", two_scans().as_bytes(), &choice, &NoProgress).unwrap().cloud;
    let names: Vec<&str> = bare.scalars.iter().map(|scalar| scalar.name.as_str()).collect();
    assert_eq!(names, [STATION]);
}

#[test]
fn positions_alone_are_read() {
    let file = scan([0.0; 3], "1 0 0\r\n0 0 2\r\n\r\n");
    let loaded = read("a.ptx", file).unwrap();
    assert_eq!(loaded.cloud.positions, [Vec3::Y, 2.0 * Vec3::Z]);
    assert_eq!(loaded.info.format, "PTX, 2 x 1 grid");
    assert!(loaded.cloud.intensity.is_none() && loaded.cloud.colors.is_none());
}

#[test]
fn broken_files_are_rejected() {
    let message = |file: String| read("a.ptx", file).unwrap_err().to_string();
    let two = two_scans();
    assert!(message(two.replacen("2\n", "two\n", 1)).contains("line 1: found `two`"));
    assert!(message(two.replacen("0 1 0\n", "0 1\n", 1)).contains("line 4: found `0 1`"));
    assert!(message(two.replace("1 2 3 1\n", "1 2 x 1\n")).contains("line 24: found `x`"));
    assert!(message(two.replace("1 2 3 1\n", "1 2 3\n")).contains("found 3 fields, expected 4"));
    assert!(message(two.replace("0 2 0 0.75", "0 2 0 0.75 9")).contains("found 5 fields"));
    let huge = two.replacen("2\n1\n", &format!("{0}\n{0}\n", u64::MAX), 1);
    assert!(message(huge).contains("a grid beyond counting"));
    let claimed = read("a.ptx", two.replacen("2\n1\n", "4000000000\n2\n", 1));
    assert!(matches!(claimed, Err(Error::Truncated { claimed: 8_000_000_000, .. })));
    let cut = two.split_inclusive('\n').take(23).collect::<String>();
    assert!(matches!(read("a.ptx", cut), Err(Error::Truncated { readable: 1, claimed: 2, .. })));
    let header = message(two.split_inclusive('\n').take(9).collect());
    assert!(header.contains("line 10: found `the end of the file`"), "{header}");
}

#[test]
fn real_scan_is_read() {
    let Some(path) = shared("clouds/pumpA_grid.ptx") else { return };
    let loaded = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
    assert_eq!(loaded.info.format, "PTX, 173 x 537 grid");
    assert_eq!(loaded.cloud.len(), 38_840);
    assert!(loaded.cloud.colors.is_some() && loaded.cloud.intensity.is_some());
}

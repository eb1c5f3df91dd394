//! ESRI ASCII grids: positions of cells, missing elevations, and broken headers and rows.

use crate::common::{Listener, read};
use surfel_core::math::DVec3;
use surfel_formats::{LoadOptions, load_bytes};

pub const HEADER: &str = "ncols 3\nnrows 2\nxllcorner 1000\nyllcorner 2000\ncellsize 10\n";

#[test]
fn cells_become_points_at_their_middles_from_north_to_south() {
    let listener = Listener::default();
    let file = format!("{HEADER}NODATA_value -1\n5 6 7\n8 -1 9.5\n");
    let loaded = load_bytes("dem.asc", file.as_bytes(), &LoadOptions::default(), &listener);
    let loaded = loaded.unwrap();
    let points: Vec<DVec3> = (0..5).map(|i| loaded.cloud.world_position(i)).collect();
    assert_eq!(points[0], DVec3::new(1005.0, 2015.0, 5.0));
    assert_eq!(points[2], DVec3::new(1025.0, 2015.0, 7.0));
    assert_eq!(points[4], DVec3::new(1025.0, 2005.0, 9.5));
    assert_eq!(loaded.info.format, "ESRI ASCII grid, 3 x 2 cells");
    assert_eq!(loaded.info.n_points, Some(5));
    assert!(listener.has_note("skipped 1 of 6 cells: no elevation"));
}

#[test]
fn centres_separate_steps_and_rows_over_several_lines_are_read() {
    let file = "NROWS 1\r\nNCOLS 4\r\nXLLCENTER 1\r\nYLLCENTER 2\r\ndx 0.5\r\ndy 2\r\n1 2\r\n3\r\n-9999\r\n";
    let cloud = read("dem.txt", file).unwrap().cloud;
    assert_eq!(cloud.len(), 3);
    assert_eq!(cloud.world_position(2), DVec3::new(2.0, 2.0, 3.0));
}

#[test]
fn a_grid_of_many_cells_is_the_same_as_its_points() {
    let (n_columns, n_rows) = (700, 900);
    let mut file =
        format!("ncols {n_columns}\nnrows {n_rows}\nxllcenter 0\nyllcenter 0\ncellsize 1\n");
    for row in 0..n_rows {
        for column in 0..n_columns {
            file += &format!("{} ", row * 1000 + column);
        }
        file.push('\n');
    }
    let cloud = read("dem.asc", file).unwrap().cloud;
    assert_eq!(cloud.len(), n_columns * n_rows);
    for i in [0, n_columns - 1, 345_678, n_columns * n_rows - 1] {
        let (row, column) = (i / n_columns, i % n_columns);
        let expected =
            DVec3::new(column as f64, (n_rows - 1 - row) as f64, (row * 1000 + column) as f64);
        assert_eq!(cloud.world_position(i), expected);
    }
}

#[test]
fn broken_grids_say_what_is_wrong() {
    for (file, expected) in [
        ("ncols 3\n1 2 3\n".to_owned(), "a header without nrows"),
        ("ncols -3\nnrows 1\n".to_owned(), "ncols -3"),
        ("ncols 3.5\nnrows 1\n".to_owned(), "ncols 3.5"),
        ("ncols many\nnrows 1\n".to_owned(), "`many`"),
        (format!("{}\n1 2 3\n", HEADER.replace("size 10", "size 0")), "cellsize 0"),
        (format!("{HEADER}1 2 3\n4 5\n"), "5 of 6"),
        (format!("{HEADER}1 2 3\n4 5 six\n"), "`six`"),
        (format!("{HEADER}1 2 3\n4 5 6 7\n"), "more than 6 cells"),
        (format!("{}1 2\n", HEADER.replace("ncols 3", "ncols 4000000000")), "2 of 8000000000"),
    ] {
        let message = read("dem.asc", &file).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected), "{file}: {message}");
    }
}

#[test]
fn cut_grids_are_salvaged() {
    let options = LoadOptions { salvage: true, ..LoadOptions::default() };
    let listener = Listener::default();
    let file = format!("{HEADER}1 2 3\n4 5\n");
    let cloud = load_bytes("dem.asc", file.as_bytes(), &options, &listener).unwrap().cloud;
    assert_eq!(cloud.len(), 5);
    assert!(listener.has_note("salvaged 5 of 6 cells"));
}

//! OFF meshes: headers of all spellings, normals, colours, polygons, and broken files.

use crate::common::{Folder, read, read_mesh};
use surfel_core::math::{Vec3, Vec4};
use surfel_formats::{inspect, inspect_bytes};

const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

#[test]
fn polygons_become_triangle_fans() {
    for header in
        ["OFF\n4 2 0\n", "OFF 4 2 0\n", "OFF4 2 0\n", "# made by hand\r\nOFF # 1\r\n\r\n4 2\r\n"]
    {
        let mesh = read_mesh("a.off", format!("{header}{SQUARE}4 0 1 2 3\n3 2 3 0 255 0 0\n"));
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [2, 3, 0]], "{header}");
        assert_eq!((mesh.normals, mesh.colors), (None, None), "{header}");
        assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
    }
}

#[test]
fn normals_and_colours_of_vertices_are_read() {
    let vertices = "0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 0 255 0 255\n0 1 0 0 0 2 0 0 255 255\n";
    let mesh = read_mesh("a.off", format!("CNOFF\n3 1 0\n{vertices}3 0 1 2\n"));
    assert_eq!(mesh.normals, Some(vec![Vec3::Z; 3]));
    assert_eq!(mesh.colors.unwrap()[1], Vec4::new(0.0, 1.0, 0.0, 1.0));
    let fractions = "0 0 0 1 0 0.5 1\n1 0 0 0 1 0.5 1\n";
    let cloud = read("a.off", format!("COFF\n2 0 0\n{fractions}")).unwrap().cloud;
    assert_eq!(cloud.colors, Some(vec![[65535, 0, 32768], [0, 65535, 32768]]));
    let with_uvs = read("a.off", format!("STOFF\n4 0 0\n{}", SQUARE.replace('\n', " 0.5 0.5\n")));
    assert_eq!(with_uvs.unwrap().cloud.colors, None);
}

#[test]
fn the_columns_are_those_of_the_first_word_and_of_the_lines() {
    let columns = |file: &str| {
        let stated = inspect_bytes("a.off", file.as_bytes()).unwrap().columns;
        let loaded = read("a.off", file).unwrap();
        (stated.join(" "), loaded.info.columns.join(" "), loaded.cloud)
    };
    let (stated, found, cloud) = columns("STCNOFF\n1 0 0\n1 2 3 0 0 1 255 0 0 0.25 0.5\n");
    assert_eq!(stated, "x y z nx ny nz red green blue u v");
    assert_eq!(found, stated);
    let uv = ["u", "v"].map(|name| cloud.scalar(name).unwrap().get(0));
    assert_eq!((uv, cloud.colors), ([0.25, 0.5], Some(vec![[65535, 0, 0]])));
    // Colours that the first word does not announce.
    let (stated, found, cloud) = columns("OFF\n1 0 0\n1 2 3 255 0 0\n");
    assert_eq!((stated.as_str(), found.as_str()), ("x y z", "x y z red green blue"));
    assert!(cloud.scalars.is_empty());
}

#[test]
fn files_without_faces_are_points() {
    let folder = Folder::new("off");
    let path = folder.path("points.off");
    std::fs::write(&path, format!("OFF\n4 0 0\n{SQUARE}")).unwrap();
    let info = inspect(&path).unwrap();
    assert_eq!((info.format.as_str(), info.n_points, info.n_triangles), ("OFF", Some(4), None));
    assert_eq!(read("a.off", std::fs::read(&path).unwrap()).unwrap().cloud.len(), 4);
    let corners = read("a.off", format!("OFF\n4 1 0\n{SQUARE}4 0 1 2 3\n")).unwrap();
    assert_eq!(corners.info.n_triangles, Some(1));
}

#[test]
fn broken_files_say_where_and_what() {
    for (file, expected) in [
        ("".to_owned(), "an empty file"),
        ("a list of words\n".to_owned(), "expected `OFF`"),
        ("OFF\nmany 1 0\n".to_owned(), "line 2: found `many 1 0`"),
        ("OFF BINARY\n1 0 0\n".to_owned(), "binary OFF"),
        ("4OFF\n1 0 0\n".to_owned(), "other than three coordinates"),
        (format!("OFF\n5 1 0\n{SQUARE}"), "4 of 5"),
        ("OFF\n4000000000 0 0\n1 2 3\n".to_owned(), "1 of 4000000000"),
        ("OFF\n99999999999 0 0\n".to_owned(), "99999999999 vertices"),
        ("OFF\n1 0 0\n1 2\n".to_owned(), "line 3: found 2 numbers"),
        ("OFF\n1 0 0\n1 2 x\n".to_owned(), "line 3: found `x`"),
    ] {
        let message = read("a.off", &file).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected), "{file}: {message}");
    }
    for (face, expected) in [
        ("3 0 1 4", "line 7: found vertex 4, expected 0 to 3"),
        ("3 0 1 0.5", "vertex 0.5"),
        ("5 0 1 2 3", "found 5 numbers"),
        ("-1 0", "found 2 numbers"),
        ("1e300 0 1", "found 3 numbers"),
        ("2 0 1", "1 of fewer than three corners"),
    ] {
        let file = format!("OFF\n4 1 0\n{SQUARE}{face}\n");
        let message =
            crate::common::read_graph("a.off", &file).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected), "{face}: {message}");
    }
}

//! Malformed meshes: an error with file and location, without a panic or excessive memory.

use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Graph};
use surfel_formats::{Error, LoadOptions, load_graph, load_graph_bytes};

use crate::common::{Folder, Listener, read_graph};

fn message(name: &str, bytes: impl AsRef<[u8]>) -> String {
    read_graph(name, bytes).map(|_| ()).unwrap_err().to_string()
}

fn n_triangles(graph: &Graph<PointCloud>) -> usize {
    let triangles = graph.geometries.iter().map(|geometry| match geometry {
        Geometry::Triangles(mesh) => mesh.triangles.len(),
        Geometry::Points(_) => 0,
    });
    triangles.sum()
}

fn ply(encoding: &str, lines: &str) -> String {
    format!("ply\nformat {encoding} 1.0\n{lines}end_header\n")
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";
const FACE: &str = "property list uchar int vertex_indices\n";

fn square(encoding: &str) -> String {
    ply(encoding, &format!("element vertex 4\n{XYZ}element face 2\n{FACE}"))
}

fn binary_ply() -> Vec<u8> {
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut file = square("binary_little_endian").into_bytes();
    file.extend(corners.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
    for face in [[0, 1, 2], [0, 2, 3]] {
        file.push(3);
        file.extend(face.map(i32::to_le_bytes).concat());
    }
    file
}

fn binary_stl() -> Vec<u8> {
    let mut file = [&[b' '; 80][..], &2u32.to_le_bytes()].concat();
    for corners in [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0], [2.0; 9]] {
        file.extend([0; 12]);
        file.extend(corners.map(f32::to_le_bytes).concat());
        file.extend([0; 2]);
    }
    file
}

/// Returns small files of every format, each with at least one triangle.
fn small_files() -> Vec<(&'static str, Vec<u8>)> {
    let ascii = square("ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n4 0 1 2 3\n";
    let strips = format!("element tristrips 1\n{FACE}element vertex 4\n{XYZ}");
    let strips = ply("ascii", &strips) + "6 0 1 2 -1 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let obj = "mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0 1\nvt 0 0.5\nvn 0 0 1\n\
        usemtl a\nf 1/1/1 2/1/1 3/1/1\nusemtl b\nf -3//1 -2//-1 \\\n -1\n";
    let off = "COFF\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 255\n1 1 0 0 0 255 255\n\
        0 1 0 9 9 9 255\n4 0 1 2 3\n3 2 3 0 255 0 0\n";
    let stl = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
        endloop\nendfacet\nendsolid a\n";
    vec![
        ("ascii.ply", ascii.into()),
        ("strips.ply", strips.into()),
        ("binary.ply", binary_ply()),
        ("a.obj", obj.into()),
        ("ascii.stl", stl.into()),
        ("binary.stl", binary_stl()),
        ("a.off", off.into()),
    ]
}

#[test]
fn truncated_meshes_do_not_panic() {
    for (name, bytes) in small_files() {
        let whole = n_triangles(&read_graph(name, &bytes).unwrap().0);
        assert!(0 < whole, "{name}");
        for length in 0..bytes.len() {
            match read_graph(name, &bytes[..length]) {
                // Truncated text may still be valid, but has at most as many triangles.
                Ok((graph, ..)) => assert!(n_triangles(&graph) <= whole, "{name} {length}"),
                Err(error) => assert!(error.to_string().starts_with(name), "{error}"),
            }
            let is_binary = name.starts_with("binary");
            assert!(!is_binary || read_graph(name, &bytes[..length]).is_err(), "{name} {length}");
        }
    }
}

#[test]
fn meshes_with_any_changed_byte_do_not_panic() {
    for (name, mut bytes) in small_files() {
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff, bytes[at] ^ 0x10, b'-', b'9'] {
                let old = std::mem::replace(&mut bytes[at], value);
                match read_graph(name, &bytes) {
                    Ok((graph, ..)) => assert!(n_triangles(&graph) <= bytes.len()),
                    Err(error) => assert!(error.to_string().starts_with(name), "{error}"),
                }
                bytes[at] = old;
            }
        }
    }
}

#[test]
fn invalid_ply_faces_are_errors_with_a_location() {
    let corners = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let ascii = |faces: &str| message("a.ply", square("ascii") + corners + faces);
    assert!(
        ascii("3 0 1 2\n3 0 1 4\n").starts_with("a.ply: line 15: found vertex 4, expected one of")
    );
    assert!(ascii("3 0 1 2\n3 0 -1 2\n").contains("line 15: found vertex -1"));
    assert!(ascii("3 0 1 2\n3 0 0.5 2\n").contains("found vertex 0.5"));
    assert!(ascii("3 0 1 2\n3 0 nan 2\n").contains("found vertex NaN"));
    assert!(ascii("3 0 1 2\n3 0 1\n").contains("line 15: found the end of the line"));
    assert!(ascii("3 0 1 2\n99999999999 0 1 2\n").contains("line 15: found the end of the line"));
    assert!(ascii("3 0 1 2\n3 a 1 2\n").contains("line 15: found `a`, expected a number"));
    assert!(ascii("3 0 1 2\n").contains("found the end of the file, expected 2 elements `face`"));

    let binary = binary_ply();
    let with_last = |index: i32| {
        let cut = &binary[..binary.len() - 4];
        message("a.ply", [cut, &index.to_le_bytes()].concat())
    };
    let offset = binary.len() - 13;
    assert!(with_last(4).starts_with(&format!("a.ply: byte {offset}: found vertex 4")));
    assert!(with_last(-1).contains("found vertex -1"));
    assert!(message("a.ply", &binary[..binary.len() - 1]).contains("2 elements `face`"));

    let billions = format!("element vertex 4\n{XYZ}element face 4000000000\n{FACE}");
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let zeros = if encoding == "ascii" { corners.into() } else { "\0".repeat(48 + 7) };
        let error = message("a.ply", ply(encoding, &billions) + &zeros);
        assert!(error.contains("4000000000 elements `face`"), "{error}");
    }
    let many = format!("element vertex 4294967296\n{XYZ}element face 1\n{FACE}");
    assert!(message("a.ply", ply("ascii", &many)).contains("4294967296 vertices"));
    let orphans = ply("ascii", &format!("element face 1\n{FACE}")) + "3 0 1 2\n";
    assert!(message("a.ply", orphans).contains("expected an element `vertex`"));
    // Without vertices, every index is out of range.
    let none =
        ply("ascii", &format!("element vertex 0\n{XYZ}element face 1\n{FACE}")) + "3 0 0 0\n";
    assert!(message("a.ply", none).contains("one of the 0 vertices"));
}

#[test]
fn invalid_obj_corners_are_errors_with_a_line_number() {
    let obj = |face: &str| {
        message("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n{face}\nv 1 1 1\n"))
    };
    assert!(
        obj("f 1 2 5").starts_with("a.obj: line 5: found vertex `5`, expected 1 to 4, or -1 to -3")
    );
    assert!(obj("f 1 2 0").contains("found vertex `0`"));
    assert!(obj("f 1 2 -4").contains("found vertex `-4`"));
    assert!(obj("f 1/1 2/2 3/1").contains("found texture coordinates `2`"));
    assert!(obj("f 1//1 2 3").contains("found normal `1`, expected none, since"));
    assert!(obj("f 1 2 x").contains("found vertex `x`"));
    assert!(obj("vn 0 0 1\nf 1 2 3/1/1/1").contains("expected a corner as in 1, 1/1"));
    assert!(obj("f 1 2 /1").contains("expected a corner as in 1, 1/1"));
    assert!(obj("f 1 2 99999999999999999999").contains("found vertex `9999"));
    assert!(obj("f 1 2 -9223372036854775808").contains("found vertex `-9223"));
    assert!(obj("v 1 2\nf 1 2 3").contains("line 5: found 2 numbers, expected at least 3"));
    assert!(obj("vn 1 2 q\nf 1 2 3").contains("line 5: found `q`"));
}

#[test]
fn invalid_stl_facets_are_errors_with_a_line_number() {
    let stl = |lines: &str| {
        message("a.stl", format!("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n{lines}"))
    };
    assert!(stl("vertex 1 0\n0 x 0 0").contains("found `x`, expected"));
    assert!(stl("vertex 1 0 q\n").starts_with("a.stl: line 5: found `q`, expected a number"));
    assert!(
        stl("vertex 1 0 0\nendloop\n").contains("line 6: found `endloop`, expected three vertices")
    );
    assert!(stl("vertex 1 0 0\nfacet\n").contains("line 6: found `facet`, expected `vertex`"));
    assert!(stl("vertex 1 0 0\n").contains("found ``, expected `vertex`"));
    assert!(message("a.stl", "solid a\nfoo\n").contains("line 2: found `foo`"));
    assert!(message("a.stl", "nothing").contains("expected a header of 84 bytes"));
    let mut file = binary_stl();
    file[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(message("a.stl", &file).contains("after 2 triangles, expected 4294967295"));
    // Bytes after the last triangle are ignored.
    file[80..84].copy_from_slice(&1u32.to_le_bytes());
    assert_eq!(read_graph("a.stl", &file).unwrap().1.n_triangles, Some(1));
}

#[test]
fn meshes_without_usable_triangles_are_rejected() {
    let none = |name: &str, file: String| {
        let error = message(name, file);
        assert!(error.starts_with(name) && error.contains("holds no triangles"), "{error}");
        error
    };
    let corners = "0 0 0\n1 0 0\n1 1 0\nnan 1 0\n";
    let error = none("a.ply", square("ascii") + corners + "3 0 0 2\n3 0 1 3\n");
    assert!(
        error.contains("line 14: found only some 1 without an area, 1 with a corner"),
        "{error}"
    );
    none("a.ply", square("ascii") + corners + "2 0 1\n0\n");
    none("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2\nf\n".into());
    none("a.stl", "solid a\nendsolid a\n".into());
    none("a.stl", "\0".repeat(84));
}

#[test]
fn many_materials_and_long_polygons_are_handled() {
    let names: String = (0..5000).map(|i| format!("usemtl {i}\nf 1 2 3\n")).collect();
    let (graph, _, listener) =
        read_graph("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{names}")).unwrap();
    assert_eq!((graph.geometries.len(), graph.materials.len()), (1, 1));
    assert!(listener.has_note("no MTL file has `0` (and 4999 others)"));
    let corners = "1 2 3 ".repeat(100_000);
    let (graph, ..) =
        read_graph("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf {corners}\n")).unwrap();
    assert_eq!(n_triangles(&graph), 100_000 - 1 + 1);
}

#[test]
fn tiny_and_missing_mesh_files_are_rejected() {
    for name in ["a.ply", "a.obj", "a.stl"] {
        for bytes in [&b""[..], b"\n", b"\0", b"f", b"\\", b"\xff\xfe"] {
            assert!(message(name, bytes).starts_with(name), "{name} {bytes:?}");
        }
    }
    let folder = Folder::new("absent-mesh");
    let absent = load_graph(&folder.path("a.stl"), &LoadOptions::default(), &NoProgress);
    assert!(absent.map(|_| ()).unwrap_err().to_string().contains("check the name"));
}

#[test]
fn cancellation_stops_reading() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    for (name, bytes) in small_files() {
        let cancelled = load_graph_bytes(name, &bytes, &LoadOptions::default(), &listener);
        assert!(matches!(cancelled, Err(Error::Core(surfel_core::Error::Cancelled))), "{name}");
    }
}

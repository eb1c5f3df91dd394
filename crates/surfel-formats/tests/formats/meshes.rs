//! Triangle meshes in PLY, OBJ and STL: small handmade files and real ones compared across formats.

use surfel_core::math::{DVec3, Vec2, Vec3, Vec4};
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Graph, Material, Mesh};
use surfel_formats::{FileInfo, LoadOptions, inspect, load, load_graph};

use crate::common::{Folder, read, read_graph, read_mesh, shared};

/// Returns an ASCII PLY file with the corners of a square and additional header and body lines.
fn ply(faces: &str, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\n{faces}end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n{body}"
    )
}

/// Returns the total area of the triangles.
fn area(mesh: &Mesh) -> f64 {
    let areas = (0..mesh.triangles.len()).map(|i| {
        let [a, b, c] = mesh.corners(i).map(Vec3::as_dvec3);
        0.5 * (b - a).cross(c - a).length()
    });
    areas.sum()
}

#[test]
fn polygons_become_triangle_fans() {
    let list = "element face 3\nproperty list uchar int vertex_indices\n";
    let mesh = read_mesh("a.ply", ply(list, "4 0 1 2 3\n3 0 1 2\n3 2 3 0\n"));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [2, 3, 0]]);
    assert_eq!((mesh.normals, mesh.colors, &mesh.uvs[0]), (None, None, &None));
    let obj = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf -4 -3 -2\n";
    let mesh = read_mesh("a.obj", obj);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
}

#[test]
fn strips_flip_every_other_triangle() {
    let list = "element tristrips 2\nproperty list int int vertex_indices\n";
    let mesh = read_mesh("a.ply", ply(list, "8 0 1 3 2 -1 0 1 2\n2 0 1\n"));
    assert_eq!(mesh.triangles, [[0, 1, 3], [3, 1, 2], [0, 1, 2]]);
}

#[test]
fn ply_faces_may_come_anywhere_among_other_elements() {
    let header = |encoding: &str, order: [&str; 4]| {
        format!("ply\nformat {encoding} 1.0\n{}end_header\n", order.concat())
    };
    let vertex = "element vertex 3\nproperty list uchar uchar near\nproperty double x\n\
        property float y\nproperty short z\n";
    let face = "element face 2\nproperty float quality\nproperty list ushort uchar vertex_index\n\
        property list uchar float other\n";
    let edge = "element edge 2\nproperty list uchar ushort ends\nproperty int flag\n";
    let note = "element note 1\nproperty uchar a\n";
    let texts = [
        "1 7 0.5 0 0\n\n0 1.5 0 0\n2 8 9 0.5 1 -1\n",
        "0.5 3 0 1 2 2 0.5 0.5\n9 4 2 1 0 0 0\n",
        "2 0 1 5\n0 6\n",
        "200\n",
    ];
    let binary = |is_big: bool| {
        let number = move |bytes: &mut Vec<u8>, value: f64, kind: char| {
            let mut add = |mut little: Vec<u8>| {
                if is_big {
                    little.reverse();
                }
                bytes.extend(little);
            };
            match kind {
                'b' => add(vec![value as u8]),
                's' => add((value as i16).to_le_bytes().into()),
                'i' => add((value as i32).to_le_bytes().into()),
                'f' => add((value as f32).to_le_bytes().into()),
                _ => add(value.to_le_bytes().into()),
            }
        };
        let kinds = ["bbdfsbdfsbbbdfs", "fsbbbbfffsbbbbb", "bssibi", "b"];
        texts.iter().zip(kinds).map(move |(text, kinds)| {
            let mut bytes = Vec::new();
            for (word, kind) in text.split_whitespace().zip(kinds.chars()) {
                number(&mut bytes, word.parse().unwrap(), kind);
            }
            bytes
        })
    };
    let headers = [vertex, face, edge, note];
    let mut meshes = Vec::new();
    for order in [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 1, 0], [3, 0, 2, 1]] {
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let parts: Vec<Vec<u8>> = match encoding {
                "ascii" => texts.iter().map(|text| text.as_bytes().to_vec()).collect(),
                _ => binary(encoding == "binary_big_endian").collect(),
            };
            let body = order.map(|i| parts[i].clone()).concat();
            let header = header(encoding, order.map(|i| headers[i]));
            let file = [header.as_bytes(), &body].concat();
            let (_, info, listener) = read_graph("a.ply", &file).unwrap();
            assert_eq!((info.n_points, info.n_triangles), (Some(3), Some(2)), "{encoding}");
            assert!(info.format.ends_with(", mesh"), "{}", info.format);
            assert!(listener.has_note("1 without an area"));
            meshes.push(read_mesh("a.ply", &file));
        }
    }
    let expected = [Vec3::new(0.5, 0.0, 0.0), Vec3::new(1.5, 0.0, 0.0), Vec3::new(0.5, 1.0, -1.0)];
    assert_eq!(meshes[0].positions, expected);
    assert_eq!(meshes[0].triangles, [[0, 1, 2], [2, 1, 0]]);
    assert!(meshes.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn ply_vertices_have_normals_colours_and_texture_coordinates() {
    let file = |color: &str, uv: [&str; 2], values: [&str; 3]| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
            property {color} red\nproperty {color} green\nproperty {color} blue\n\
            property {color} alpha\nproperty float {}\nproperty float {}\nelement face 1\n\
            property list uchar uint vertex_index\nend_header\n0 0 0 0 0 2 {}\n\
            1 0 0 0 0 1 {}\n0 1 0 0 1 0 {}\n3 0 1 2\n",
            uv[0], uv[1], values[0], values[1], values[2]
        )
    };
    let bytes = ["255 128 0 255 0 0", "0 0 0 51 1 0.25", "1 2 3 0 0.5 1"];
    let words = ["65535 32896 0 65535 0 0", "0 0 0 13107 1 0.25", "257 514 771 0 0.5 1"];
    let floats =
        ["1 0.5019608 0 1 0 0", "0 0 0 0.2 1 0.25", "0.0039216 0.0078431 0.0117647 0 0.5 1"];
    let kinds = [
        ("uchar", ["s", "t"], bytes),
        ("ushort", ["u", "v"], words),
        ("float", ["texture_u", "texture_v"], floats),
    ];
    for (kind, names, values) in kinds {
        let mesh = read_mesh("a.ply", file(kind, names, values));
        assert_eq!(mesh.normals, Some(vec![Vec3::Z, Vec3::Z, Vec3::Y]), "{kind}");
        let uvs = vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.75), Vec2::new(0.5, 0.0)];
        assert_eq!(mesh.uvs[0], Some(uvs), "{kind}");
        let colors = mesh.colors.unwrap();
        let expected = [Vec4::new(1.0, 0.21586, 0.0, 1.0), Vec4::new(0.0, 0.0, 0.0, 0.2)];
        for (color, expected) in colors.iter().zip(expected) {
            assert!((*color - expected).abs().max_element() < 1e-4, "{kind} {color}");
        }
        assert!((colors[2].z - 3.0 / 255.0 / 12.92).abs() < 1e-5 && colors[2].w == 0.0, "{kind}");
    }
}

#[test]
fn obj_corners_with_equal_indices_share_a_vertex() {
    let obj = "mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nvt 0 0\nvt 1 0.25\n\
        vn 0 0 2\nvn 0 1 0\ng a\nf 1/1/1 2/2/1 3/1/1\ns 1\nf 1/1/1 3/1/1 -2//2\n";
    let mesh = read_mesh("a.obj", obj);
    let [x, y] = [Vec3::X, Vec3::Y];
    assert_eq!(mesh.positions, [Vec3::ZERO, x, x + y, y]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.normals, Some(vec![Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y]));
    let [lower, right] = [Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.75)];
    assert_eq!(mesh.uvs[0], Some(vec![lower, right, lower, Vec2::ZERO]));
}

#[test]
fn obj_lines_may_have_continuations_comments_and_colours() {
    let obj = "# c\r\nv 0 0 0 1 0 0\r\nv 1 0 0 1 0.5 0 1\r\n  v 0 1 0 # none\r\nf 1 2 \\\r\n 3 # c\r\nl 1 2\r\n";
    let mesh = read_mesh("a.obj", obj);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    let colors = mesh.colors.unwrap();
    assert_eq!(colors[0], Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert!((colors[1].x - 0.21404).abs() < 1e-4, "a weight stands before the colour");
    assert_eq!(colors[2], Vec4::ONE);
}

#[test]
fn obj_continuations_may_cross_parallel_chunks() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n#";
    let face = "f 1 \\\r\n\\\n2 3\r\n";
    for shift in 0..face.len() {
        let file = format!("{vertices}{}\n{}", "-".repeat(shift), face.repeat(20_000));
        assert_eq!(read_mesh("a.obj", file).triangles.len(), 20_000, "{shift}");
    }
}

/// Returns a tetrahedron in every variant of STL.
fn stl_files() -> [(&'static str, Vec<u8>); 4] {
    let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let facet = |face: [usize; 3]| {
        let vertex = |i: usize| {
            let [x, y, z] = corners[i];
            format!("      vertex {x}.0 {y} {z}e0\n")
        };
        let vertices = face.map(vertex).concat();
        format!("  facet normal 0 0 nan\n    outer loop\n{vertices}    endloop\n  endfacet\n")
    };
    let ascii = format!(
        "solid one\n{}endsolid one\nsolid two facets\n{}endsolid\n",
        facet(faces[0]) + &facet(faces[1]),
        facet(faces[2]) + &facet(faces[3])
    );
    let binary = |header: &[u8]| {
        let mut file = [header, &vec![b' '; 80 - header.len()], &4u32.to_le_bytes()].concat();
        for face in faces {
            file.extend([0; 12]);
            let numbers = face.map(|i| corners[i].map(|v| (v as f32).to_le_bytes()).concat());
            file.extend(numbers.concat());
            file.extend([0x1f, 0x80]);
        }
        file
    };
    [
        ("ascii", ascii.clone().into()),
        ("upper case, CR", ascii.to_uppercase().replace('\n', "\r\n").into()),
        ("binary", binary(b"by hand")),
        ("solid but binary", binary(b"solid by hand")),
    ]
}

#[test]
fn stl_encoding_is_detected_by_length_and_vertices_are_welded() {
    for (kind, file) in stl_files() {
        let (_, info, _) = read_graph("a.stl", &file).unwrap();
        let encoding = if kind.contains("binary") { "STL, binary" } else { "STL, ascii" };
        assert_eq!(info.format, encoding, "{kind}");
        assert_eq!((info.n_points, info.n_triangles), (Some(4), Some(4)), "{kind}");
        let mesh = read_mesh("a.stl", &file);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]], "{kind}");
        assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::Z], "{kind}");
        assert_eq!(mesh.normals, None);
        assert_eq!(read("a.stl", &file).unwrap().cloud.len(), 4);
        assert!((area(&mesh) - (1.5 + 0.75_f64.sqrt())).abs() < 1e-6);
    }
}

#[test]
fn large_coordinates_keep_their_precision() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
        property double z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n\
        500000.001 4900000.002 1\n500001.001 4900000.002 1\n500000.001 4900001.002 1\n3 0 1 2\n";
    let obj = "v 500000.001 4900000.002 1\nv 500001.001 4900000.002 1\nv 500000.001 4900001.002 1\nf 1 2 3";
    let stl = "solid\nfacet normal 0 0 1\nouter loop\nvertex 500000.001 4900000.002 1\n\
        vertex 500001.001 4900000.002 1\nvertex 500000.001 4900001.002 1\nendloop\nendfacet\n";
    for (name, file) in [("a.ply", ply), ("a.obj", obj), ("a.stl", stl)] {
        let mesh = read_mesh(name, file);
        let world = mesh.origin + mesh.positions[0].as_dvec3();
        let error = world - DVec3::new(500_000.001, 4_900_000.002, 1.0);
        assert!(error.abs().max_element() < 1e-6, "{name}: {error}");
    }
}

#[test]
fn point_clouds_become_one_node() {
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nelement face 0\nproperty list uchar int vertex_index\nend_header\n1 2 3\n";
    for (name, file) in [("b.ply", cloud), ("b.obj", "v 1 2 3\n"), ("b.xyz", "1 2 3\n")] {
        let (graph, info, _) = read_graph(name, file).unwrap();
        let Geometry::Points(points) = &graph.geometries[0] else { panic!("{name}") };
        assert_eq!(points.positions, [Vec3::new(1.0, 2.0, 3.0)]);
        assert_eq!(graph.materials, [Material::MATTE]);
        assert_eq!((graph.nodes[0].name.as_str(), graph.nodes[0].primitives.len()), ("b", 1));
        assert_eq!(info.n_triangles, None, "{name}");
    }
}

#[test]
fn degenerate_triangles_are_dropped_and_reported() {
    let faces = "element face 6\nproperty list uchar int vertex_indices\n";
    let body = "3 0 1 2\n3 0 1 1\n2 0 1\n0\n1 3\n3 0 0 2\n";
    let (graph, info, listener) = read_graph("a.ply", ply(faces, body)).unwrap();
    assert_eq!(info.n_triangles, Some(1));
    assert!(
        listener.has_note("a.ply: triangles dropped: 2 without an area, 3 of fewer than three")
    );
    assert_eq!(graph.geometries.len(), 1);
    let (_, info, listener) =
        read_graph("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 2 0 0\nf 1 2 3 4\nf 1 2 5\n")
            .unwrap();
    assert_eq!(info.n_triangles, Some(1));
    assert!(
        listener.has_note("1 without an area, 1 with a corner that is not finite or beyond 1e15")
    );
}

#[test]
fn normals_of_length_zero_are_recomputed() {
    let file = |normals: [&str; 3]| {
        let [a, b, c] = normals;
        format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn {a}\nvn {b}\nvn {c}\nf 1//1 2//2 3//3\n")
    };
    let (_, _, listener) = read_graph("a.obj", file(["0 1 0", "0 0 0", "nan 0 0"])).unwrap();
    assert!(listener.has_note("2 normals without a direction replaced"));
    let mesh = read_mesh("a.obj", file(["0 1e30 0", "0 0 0", "nan 0 0"]));
    assert_eq!(mesh.normals, Some(vec![Vec3::Y, Vec3::Z, Vec3::Z]));
    assert_eq!(read_mesh("a.obj", file(["0 0 0"; 3])).normals, None);
}

#[test]
fn meshes_can_be_read_as_point_clouds() {
    let faces = "element face 1\nproperty list uchar int vertex_indices\n";
    let loaded = read("a.ply", ply(faces, "4 0 1 2 3\n")).unwrap();
    assert_eq!(loaded.cloud.len(), 4);
    assert_eq!(loaded.info.n_triangles, Some(1));
    assert_eq!(read("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 1\n").unwrap().cloud.len(), 2);
}

#[test]
fn inspect_reports_triangle_counts() {
    let folder = Folder::new("inspect-meshes");
    let faces = "element face 1\nproperty list uchar int vertex_indices\n";
    let [(_, ascii), _, (_, binary), _] = stl_files();
    let files = [
        ("a.ply", ply(faces, "4 0 1 2 3\n").into_bytes(), "PLY, ascii, mesh", Some(1)),
        ("a.stl", binary, "STL, binary", Some(4)),
        ("b.stl", ascii, "STL, ascii", None),
    ];
    for (name, bytes, format, n_triangles) in files {
        std::fs::write(folder.path(name), bytes).unwrap();
        let info = inspect(&folder.path(name)).unwrap();
        assert_eq!((info.format.as_str(), info.n_triangles), (format, n_triangles));
    }
}

fn load_shared(name: &str) -> Option<(Graph<PointCloud>, FileInfo)> {
    let path = shared(&format!("meshes/{name}"))?;
    Some(load_graph(&path, &LoadOptions::default(), &NoProgress).unwrap())
}

fn only_mesh(graph: &Graph<PointCloud>) -> &Mesh {
    match graph.geometries.as_slice() {
        [Geometry::Triangles(mesh)] => mesh,
        other => panic!("{} geometries", other.len()),
    }
}

#[test]
fn the_bunny_is_the_same_in_every_format() {
    let mut areas = Vec::new();
    for name in ["bun_zipper.ply", "stanford-bunny.obj", "bunny.stl"] {
        let Some((graph, info)) = load_shared(name) else { return };
        let mesh = only_mesh(&graph);
        assert_eq!((mesh.triangles.len(), info.n_triangles), (69_451, Some(69_451)), "{name}");
        areas.push(area(mesh));
        assert_eq!(format!("{name} 1"), format!("{name} {}", graph.nodes.len()));
        let used = 35_947 - 1_113;
        let n_vertices = if name.ends_with("ply") { 35_947 } else { used };
        assert_eq!(mesh.positions.len(), n_vertices, "{name}");
    }
    assert!(areas.iter().all(|area| (area / areas[0] - 1.0).abs() < 1e-3), "{areas:?}");
}

#[test]
fn the_armadillo_is_closed() {
    let Some((graph, info)) = load_shared("armadillo_26k.ply") else { return };
    let mesh = only_mesh(&graph);
    assert_eq!((info.n_points, info.n_triangles), (Some(26_002), Some(52_000)));
    assert_eq!(info.format, "PLY, binary little endian, mesh");
    // Every edge occurs once in each direction.
    let edges = |flip: bool| {
        let sides = mesh.triangles.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]);
        let mut sides: Vec<_> = sides.map(|(a, b)| if flip { (b, a) } else { (a, b) }).collect();
        sides.sort_unstable();
        sides
    };
    assert_eq!(edges(false), edges(true));
    let path = shared("meshes/armadillo_26k.ply").unwrap();
    assert_eq!(load(&path, &LoadOptions::default(), &NoProgress).unwrap().cloud.len(), 26_002);
}

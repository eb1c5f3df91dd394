//! Materials and textures of OBJ and PLY files.

use surfel_core::math::{Vec2, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{AlphaMode, Geometry, Graph, Material, Wrap};
use surfel_formats::{FileInfo, LoadOptions, load_graph};

use crate::common::{Folder, Listener, read_graph};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";

/// A PNG image of one texel.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde\0\0\0\x0cIDATx\x9cc\xf8\xcf\xc0\0\0\x03\x01\x01\0\xc9\xfe\x92\xef\0\0\0\0IEND\xaeB`\x82";

/// Loads `a.obj` with these lines from a folder with these other files.
fn load_with(
    test: &str,
    obj: &str,
    others: &[(&str, &[u8])],
) -> (Graph<PointCloud>, FileInfo, Listener) {
    let folder = Folder::new(test);
    for (name, bytes) in others {
        let path = folder.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    std::fs::write(folder.path("a.obj"), obj).unwrap();
    let listener = Listener::default();
    let options = LoadOptions::default();
    let (graph, info) = load_graph(&folder.path("a.obj"), &options, &listener).unwrap();
    (graph, info, listener)
}

/// Returns the material that these lines of an MTL file define.
fn material(test: &str, lines: &str) -> Material {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n");
    let mtl = format!("newmtl m\n{lines}");
    let (mut graph, ..) = load_with(test, &obj, &[("a.mtl", mtl.as_bytes())]);
    assert_eq!(graph.materials.len(), 1);
    graph.materials.remove(0)
}

#[test]
fn mtl_materials_become_metallic_roughness() {
    let read = |lines: &str| material("mtl", lines);
    let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
    let matte = read("Kd 0.5 0.25 1\nKs 0 0 0\nNs 10\nillum 2\n");
    assert_eq!(matte, Material { base_color: Vec3::new(0.5, 0.25, 1.0), ..Material::MATTE });
    let glossy = read("Kd 0.5 # grey\nKs 0.5 0.5 0.5\nNs 30\n");
    assert_eq!((glossy.base_color, glossy.ior), (Vec3::splat(0.5), 1.5));
    assert!(close(glossy.roughness, 0.5), "{}", glossy.roughness);
    let lamp = read("Kd 0 0 0\nKe 10 5 0\n");
    assert_eq!((lamp.base_color, lamp.emissive), (Vec3::ZERO, Vec3::new(10.0, 5.0, 0.0)));
    let mirror = read("Kd 0 0 0\nKs 1 0.5 0.25\nillum 3\n");
    assert_eq!((mirror.metallic, mirror.roughness), (1.0, 0.0));
    assert_eq!(mirror.base_color, Vec3::new(1.0, 0.5, 0.25));
    let glass = read("Kd 0 0 0\nTf 1 0.5 1\nNi 1.33\nillum 7\n");
    let expected = Material { base_color: Vec3::new(1.0, 0.5, 1.0), ior: 1.33, ..Material::GLASS };
    assert_eq!(glass, expected);
    let lambert = read("illum 4\nKd 0.5 0.5 0.5\nTf 1 1 1\nNi 1.00\n");
    assert_eq!(lambert.transmission, 0.0, "some programs give model 4 to all they write");
    let pane = read("Kd 1 0 0\nd 0.25\nTr 0\n");
    assert_eq!((pane.alpha, pane.alpha_mode), (0.25, AlphaMode::Blend));
    assert_eq!(read("Tr 0.25\n").alpha, 0.75);
    let new = read("Kd 1 0 0\nKs 1 1 1\nPr 0.3\nPm 1\nillum 3\n");
    assert_eq!((new.base_color, new.roughness, new.metallic), (Vec3::X, 0.3, 1.0));
    assert_eq!(read("Kd -1 nan 2\nNs inf\nPr 7\nd q\nillum 99999999999\n").metallic, 0.0);
}

#[test]
fn each_material_gets_its_own_mesh() {
    let obj = format!(
        "mtllib no.mtl\nmtllib sub/my materials.mtl\nmtllib x.mtl y.mtl\n{TRIANGLE}f 1 2 3\n\
        usemtl red one\nf 1/1 2/2 3/3\nusemtl other\nusemtl blue\nf 3 2 1\nusemtl red one\nf 2 3 1\nusemtl lost\nf 1 2 3\n"
    );
    let others = [
        ("sub/my materials.mtl", &b"newmtl red one\nKd 1 0 0\nnewmtl red one\nKd 0 1 0\n"[..]),
        ("y.mtl", b"newmtl blue\nKd 0 0 1\nKd q\n"),
    ];
    let (graph, info, listener) = load_with("materials", &obj, &others);
    let colors: Vec<Vec3> = graph.materials.iter().map(|material| material.base_color).collect();
    assert_eq!(colors, [Vec3::ONE, Vec3::X, Vec3::Z]);
    let counts: Vec<usize> = graph
        .geometries
        .iter()
        .map(|geometry| match geometry {
            Geometry::Triangles(mesh) => mesh.triangles.len(),
            Geometry::Points(_) => 0,
        })
        .collect();
    assert_eq!(counts, [2, 2, 1]);
    assert_eq!((info.n_triangles, graph.nodes.len()), (Some(5), 1));
    assert_eq!((graph.nodes[0].name.as_str(), graph.nodes[0].primitives.len()), ("a", 3));
    assert!(graph.nodes[0].primitives.iter().enumerate().all(|(i, part)| part.material == i));
    assert!(listener.has_note("materials are plain: ") && listener.has_note("no.mtl"));
    assert!(listener.has_note("y.mtl: line 3: found `q`, expected a number"));
    assert!(listener.has_note("no MTL file has `lost`"));
    let Geometry::Triangles(red) = &graph.geometries[1] else { panic!() };
    let uvs = red.uvs[0].as_ref().unwrap();
    assert_eq!(uvs[..3], [Vec2::Y, Vec2::ONE, Vec2::ZERO]);
    assert_eq!(red.positions.len(), 6, "corners without texture coordinates are others");
}

#[test]
fn textures_are_read_once_and_missing_ones_are_reported() {
    let mtl = "newmtl a\nmap_Kd -s 2 3 1 -o 0.5 0.25 -clamp on C:\\art\\one texel.png\nmap_Ke one texel.png\n\
        norm -bm 0.5 sub/n.png\nnewmtl b\nKd 0.5 0.5 0.5\nmap_Kd none.png\nmap_Bump sub/n.png\nmap_Ke text.png\n";
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n");
    let others = [
        ("a.mtl", mtl.as_bytes()),
        ("one texel.png", PNG),
        ("sub/n.png", PNG),
        ("text.png", b"no picture"),
    ];
    let (graph, info, listener) = load_with("textures", &obj, &others);
    let names = info.external_files.iter().map(|path| path.file_name().unwrap().to_str().unwrap());
    let names: Vec<&str> = names.collect();
    assert_eq!(names, ["a.mtl", "one texel.png", "one texel.png", "n.png", "none.png", "text.png"]);
    let [a, b] = graph.materials.as_slice() else { panic!("{} materials", graph.materials.len()) };
    let base = a.textures.base_color.unwrap();
    assert_eq!((base.scale, base.wrap), (Vec2::new(2.0, 3.0), [Wrap::ClampToEdge; 2]));
    // The row at v in the file is at 1 - v from the top: 1 - (0.25 + 3 (1 - v)).
    assert_eq!(base.offset, Vec2::new(0.5, -2.25));
    assert_eq!((a.base_color, a.emissive), (Vec3::ONE, Vec3::ONE));
    let normal = a.textures.normal.unwrap();
    // Both names of the first file have one texture.
    assert_eq!((normal.0.texture, normal.1, graph.textures[normal.0.texture].width), (1, 0.5, 1));
    assert_eq!((base.texture, graph.textures.len()), (0, 2));
    assert_eq!(b.textures.base_color, None);
    assert_eq!((b.base_color, b.textures.normal), (Vec3::splat(0.5), None));
    assert_eq!((b.emissive, b.textures.emissive), (Vec3::ZERO, None));
    assert!(listener.has_note("a texture is left out: ") && listener.has_note("none.png"));
    assert!(listener.has_note("(and 1 other)"));
}

#[test]
fn a_texture_with_several_names_is_read_once() {
    let mtl = "newmtl a\nmap_Kd one.png\nmap_Ke ./one.png\nnorm sub/../one.png\n\
        newmtl b\nmap_Kd text.png\nmap_Ke ././text.png\n";
    let obj = format!(
        "mtllib a.mtl\nmtllib ./a.mtl\n{TRIANGLE}usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\n"
    );
    let others = [
        ("a.mtl", mtl.as_bytes()),
        ("one.png", PNG),
        ("sub/n.png", PNG),
        ("text.png", b"no picture"),
    ];
    let (graph, _, listener) = load_with("names", &obj, &others);
    assert_eq!((graph.materials.len(), graph.textures.len()), (2, 1));
    let textures = &graph.materials[0].textures;
    assert_eq!(textures.base_color.map(|base| base.texture), Some(0));
    assert_eq!(textures.emissive.map(|emissive| emissive.texture), Some(0));
    assert_eq!(textures.normal.map(|(normal, _)| normal.texture), Some(0));
    assert!(listener.has_note("text.png") && !listener.has_note("other)"));
}

#[test]
fn files_in_memory_do_not_open_other_files() {
    let (graph, _, listener) =
        read_graph("a.obj", format!("mtllib /etc/passwd\n{TRIANGLE}usemtl a\nf 1 2 3\n")).unwrap();
    assert_eq!(graph.materials, [Material::MATTE]);
    assert!(listener.has_note("/etc/passwd is a separate file, and is not looked up"));
}

#[test]
fn ply_corner_texture_coordinates_split_vertices() {
    let ply = "ply\nformat ascii 1.0\ncomment TextureFile my picture.png\ncomment TextureFile b.png\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nelement face 2\n\
        property list uchar int vertex_indices\nproperty list uchar float texcoord\n\
        property int texnumber\nend_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n1 1 0 0 0 0\n0 1 0 0 0 0\n\
        4 0 1 2 3 8 0 0 1 0 1 1 0 1 0\n3 0 1 2 6 0 0 0.5 0.5 1 1 0\n";
    let folder = Folder::new("texcoord");
    std::fs::write(folder.path("my picture.png"), PNG).unwrap();
    std::fs::write(folder.path("a.ply"), ply).unwrap();
    let listener = Listener::default();
    let options = LoadOptions::default();
    let (graph, _) = load_graph(&folder.path("a.ply"), &options, &listener).unwrap();
    let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!() };
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 4, 2]]);
    assert_eq!(mesh.positions[4], Vec3::X);
    let uvs = [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO, Vec2::splat(0.5)];
    assert_eq!(mesh.uvs[0].as_deref(), Some(&uvs[..]));
    assert_eq!(mesh.colors.as_ref().unwrap()[4].truncate(), Vec3::Y);
    assert_eq!(graph.materials[0].textures.base_color.unwrap().texture, 0);
    assert!(listener.has_note("the first of 2 textures is used for all faces"));
}

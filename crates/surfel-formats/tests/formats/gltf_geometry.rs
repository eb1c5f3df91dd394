//! glTF meshes and points with all kinds of accessors.

use serde_json::json;
use surfel_core::math::{DVec3, Vec2, Vec3, Vec4};
use surfel_core::scene::{Geometry, Primitive};

use crate::common::read;
use crate::gltf_asset::{Asset, SQUARE, square, triangle};

fn vectors(values: &[f32]) -> Vec<Vec3> {
    values.as_chunks().0.iter().copied().map(Vec3::from_array).collect()
}

#[test]
fn the_root_node_rotates_a_triangle_to_z_up() {
    let loaded = triangle().load().unwrap();
    assert_eq!(loaded.info.format, "glTF 2.0, binary");
    assert_eq!((loaded.info.n_points, loaded.info.n_triangles), (None, Some(1)));
    assert_eq!(loaded.info.columns, ["POSITION"]);
    let graph = loaded.graph;
    assert_eq!((&graph.nodes[0].name[..], graph.nodes[0].parent), ("asset", None));
    assert_eq!((&graph.nodes[1].name[..], graph.nodes[1].parent), ("node 0", Some(0)));
    let world_from_node = graph.world_from_nodes()[1];
    assert!(world_from_node.transform_vector3(DVec3::Y).distance(DVec3::Z) < 1e-12);
    assert!(world_from_node.transform_vector3(DVec3::Z).distance(DVec3::NEG_Y) < 1e-12);
    assert_eq!(graph.nodes[1].primitives, [Primitive { geometry: 0, material: 0 }]);
    assert_eq!(graph.materials[0].metallic, 1.0);
    let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!() };
    assert_eq!((&mesh.positions, &mesh.triangles[..]), (&vectors(&SQUARE[..9]), &[[0, 1, 2]][..]));
    assert!(loaded.notes.is_empty());
}

#[test]
fn indices_strips_and_fans_become_triangles() {
    let read = |mode: u32, put: &dyn Fn(&mut Asset) -> Option<usize>| {
        let mut asset = Asset::new();
        let position = asset.numbers("VEC3", &SQUARE);
        let mut primitive = json!({"attributes": {"POSITION": position}, "mode": mode});
        if let Some(indices) = put(&mut asset) {
            primitive["indices"] = json!(indices);
        }
        asset.with_primitive(primitive).mesh().triangles
    };
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[0u8, 1, 2]))), [[0, 1, 2]]);
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[0u16, 1, 2, 3]))), [[0, 1, 2]]);
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[2u32, 1, 0]))), [[2, 1, 0]]);
    assert_eq!(read(5, &|a| Some(a.numbers("SCALAR", &[0u8, 1, 3, 2]))), [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(read(6, &|_| None), [[1, 2, 0], [2, 3, 0]]);
    assert_eq!(read(5, &|_| None), [[0, 1, 2], [1, 3, 2]]);
}

#[test]
fn unused_vertices_are_dropped() {
    let mut asset = Asset::new();
    let positions: Vec<f32> = (0..300).map(|i| (i * i) as f32).collect();
    let position = asset.numbers("VEC3", &positions);
    let colors: Vec<u8> = (0..100).flat_map(|i| [i, 0, 0, 255]).collect();
    let color = asset.numbers("VEC4", &colors);
    let indices = asset.numbers("SCALAR", &[90u8, 10, 50]);
    let attributes = json!({"POSITION": position, "COLOR_0": color});
    let mesh = asset.with_primitive(json!({"attributes": attributes, "indices": indices})).mesh();
    assert_eq!(mesh.triangles, [[2, 0, 1]]);
    assert_eq!(mesh.positions[2], Vec3::new(72900.0, 73441.0, 73984.0));
    assert_eq!(mesh.colors.unwrap()[1].x, 50.0 / 255.0);
}

#[test]
fn all_attributes_are_read() {
    let mesh = square(|asset, primitive| {
        let attributes = &mut primitive["attributes"];
        attributes["NORMAL"] = asset.numbers("VEC3", &[0.0f32, 0.0, 2.0].repeat(4)).into();
        attributes["TANGENT"] = asset.numbers("VEC4", &[1.0f32, 0.0, 0.0, -1.0].repeat(4)).into();
        attributes["TEXCOORD_0"] = asset.numbers("VEC2", &[0.5f32; 8]).into();
        attributes["TEXCOORD_1"] = asset.numbers("VEC2", &[0.25f32; 8]).into();
        attributes["COLOR_0"] = asset.numbers("VEC3", &[2.0f32, 0.5, 0.0].repeat(4)).into();
        attributes["_OWN"] = asset.numbers("SCALAR", &[1.0f32; 4]).into();
    })
    .mesh();
    assert_eq!(mesh.normals, Some(vec![Vec3::Z; 4]));
    assert_eq!(mesh.tangents, Some(vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 4]));
    assert_eq!(mesh.uvs, [Some(vec![Vec2::splat(0.5); 4]), Some(vec![Vec2::splat(0.25); 4])]);
    assert_eq!(mesh.colors, Some(vec![Vec4::new(1.0, 0.5, 0.0, 1.0); 4]));
}

#[test]
fn quantised_attributes_are_normalised_as_declared() {
    let read = |kind: &str, put: &dyn Fn(&mut Asset) -> usize, is_normalized: bool| {
        let mut asset = Asset::new();
        let accessor = put(&mut asset);
        asset.json["accessors"][accessor]["normalized"] = json!(is_normalized);
        let position = match kind {
            "POSITION" => accessor,
            _ => asset.numbers("VEC3", &SQUARE[..9]),
        };
        let attributes = json!({"POSITION": position, kind: accessor});
        asset.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        asset.with_primitive(json!({ "attributes": attributes })).mesh()
    };
    let corners = |a: &mut Asset| a.numbers("VEC3", &[0i8, 0, 0, 127, -128, 0, 0, 127, 64]);
    let mesh = read("POSITION", &corners, true);
    assert_eq!(mesh.positions[1], Vec3::new(1.0, -1.0, 0.0));
    let mesh = read("POSITION", &corners, false);
    assert_eq!(mesh.positions[1], Vec3::new(127.0, -128.0, 0.0));
    let corners = |a: &mut Asset| a.numbers("VEC3", &[0u16, 0, 0, 65535, 0, 0, 0, 13107, 0]);
    assert_eq!(read("POSITION", &corners, true).positions[2].y, 0.2);
    assert_eq!(read("POSITION", &corners, false).positions[2].y, 13107.0);
    let corners = |a: &mut Asset| a.numbers("VEC3", &[0i16, 0, 0, 32767, 0, 0, 0, -32768, 0]);
    assert_eq!(read("POSITION", &corners, true).positions[2].y, -1.0);
    let corners = |a: &mut Asset| a.numbers("VEC3", &[0u8, 0, 0, 255, 0, 0, 0, 51, 0]);
    assert_eq!(read("POSITION", &corners, true).positions[2].y, 0.2);
    let normals = |a: &mut Asset| a.numbers("VEC3", &[0i8, 0, 127].repeat(3));
    assert_eq!(read("NORMAL", &normals, true).normals, Some(vec![Vec3::Z; 3]));
    let uvs = |a: &mut Asset| a.numbers("VEC2", &[65535u16; 6]);
    assert_eq!(read("TEXCOORD_0", &uvs, true).uvs[0], Some(vec![Vec2::ONE; 3]));
    assert_eq!(read("TEXCOORD_0", &uvs, false).uvs[0], Some(vec![Vec2::splat(65535.0); 3]));
    let colors = |a: &mut Asset| a.numbers("VEC4", &[255u8, 0, 51, 255].repeat(3));
    for is_normalized in [true, false] {
        let mesh = read("COLOR_0", &colors, is_normalized);
        assert_eq!(mesh.colors, Some(vec![Vec4::new(1.0, 0.0, 0.2, 1.0); 3]));
    }
}

#[test]
fn strides_and_offsets_are_applied() {
    let mut asset = Asset::new();
    let mut bytes = vec![9; 4];
    for corner in SQUARE[..9].as_chunks::<3>().0 {
        corner.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([7; 8]);
    }
    // The stride does not apply after the last element.
    bytes.truncate(bytes.len() - 8);
    let view = asset.view(&bytes);
    asset.json["bufferViews"][view]["byteStride"] = json!(20);
    let accessor = json!({"bufferView": view, "byteOffset": 4, "componentType": 5126,
        "type": "VEC3", "count": 3});
    let position = asset.push("accessors", accessor);
    let mesh = asset.with_primitive(json!({"attributes": {"POSITION": position}})).mesh();
    assert_eq!(mesh.positions, vectors(&SQUARE[..9]));
}

#[test]
fn sparse_accessors_replace_some_elements() {
    for has_base in [true, false] {
        let mut asset = square(|asset, primitive| {
            primitive["indices"] = asset.numbers("SCALAR", &[0u8, 1, 3, 1, 2, 3]).into();
        });
        let indices = asset.view(&[1, 3]);
        let values: Vec<u8> = [5.0f32, 6.0, 7.0, 0.0, 9.0, 0.0].map(f32::to_le_bytes).concat();
        let values = asset.view(&values);
        let accessor = &mut asset.json["accessors"][0];
        accessor["sparse"] = json!({"count": 2,
            "indices": {"bufferView": indices, "componentType": 5121},
            "values": {"bufferView": values}});
        if !has_base {
            accessor.as_object_mut().unwrap().remove("bufferView");
        }
        let [_, _, third, _] = asset.mesh().positions.try_into().unwrap();
        assert_eq!(third, if has_base { Vec3::new(1.0, 1.0, 0.0) } else { Vec3::ZERO });
        let [_, second, _, fourth] = asset.mesh().positions.try_into().unwrap();
        assert_eq!((second, fourth), (Vec3::new(5.0, 6.0, 7.0), Vec3::new(0.0, 9.0, 0.0)));
    }
}

#[test]
fn points_keep_their_colours_and_lines_are_skipped() {
    let mut asset = Asset::new();
    let corners = [&SQUARE[..9], &[f32::NAN, 0.0, 0.0]].concat();
    let position = asset.numbers("VEC3", &corners);
    let normal = asset.numbers("VEC3", &[0.0f32, 3.0, 0.0].repeat(4));
    let color = asset.numbers("VEC4", &[65535u16, 0, 14047, 0].repeat(4));
    let attributes = json!({"POSITION": position, "NORMAL": normal, "COLOR_0": color});
    let indices = asset.numbers("SCALAR", &[2u8, 3, 0]);
    let whole = json!({"mode": 0, "attributes": attributes});
    let part = json!({"mode": 0, "attributes": attributes, "indices": indices});
    let lines = [1, 2, 3].map(|mode| json!({"mode": mode, "attributes": attributes}));
    let primitives = [vec![whole, part], lines.into()].concat();
    let mesh = asset.push("meshes", json!({ "primitives": primitives }));
    asset.push("nodes", json!({ "mesh": mesh }));
    let loaded = asset.load().unwrap();
    let [Geometry::Points(whole), Geometry::Points(part)] = &loaded.graph.geometries[..] else {
        panic!("{:?}", loaded.graph.geometries)
    };
    assert_eq!(whole.positions, vectors(&SQUARE[..9]));
    assert_eq!(whole.normals, Some(vec![Vec3::Y; 3]));
    // 14047 of 65535 is linear 0.214, which is sRGB 128 of 255.
    let [red, green, blue] = whole.colors.as_ref().unwrap()[0];
    assert_eq!((red, green, (f32::from(blue) / 257.0).round()), (65535, 0, 128.0));
    assert_eq!(part.positions, vec![Vec3::new(1.0, 1.0, 0.0), Vec3::ZERO]);
    assert_eq!(loaded.info.n_points, Some(5));
    assert!(loaded.has_note("lines, which surfel does not draw, are skipped (3 times)"));
    assert!(loaded.has_note("skipped 1 point without a finite position"));
    assert_eq!(loaded.graph.nodes[1].primitives.len(), 2);
}

#[test]
fn equal_primitives_share_one_geometry() {
    let mut asset = triangle();
    let red = asset.push("materials", json!({}));
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(red);
    let primitive = asset.json["meshes"][0]["primitives"][0].clone();
    let mut other = primitive.clone();
    other.as_object_mut().unwrap().remove("material");
    let mesh = asset.push("meshes", json!({"primitives": [primitive, other]}));
    asset.push("nodes", json!({"mesh": 0}));
    asset.push("nodes", json!({ "mesh": mesh }));
    asset.json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let graph = asset.graph();
    assert_eq!((graph.geometries.len(), graph.materials.len()), (1, 2));
    let part = |material| Primitive { geometry: 0, material };
    assert_eq!(graph.nodes[2].primitives, [part(0)]);
    assert_eq!(graph.nodes[3].primitives, [part(0), part(1)]);
}

#[test]
fn local_mesh_defects_are_repaired_and_reported() {
    let mut asset = square(|asset, primitive| {
        let normals = [0.0f32, 0.0, 1.0].repeat(3);
        let normals = [&normals[..], &[0.0; 3]].concat();
        primitive["attributes"]["NORMAL"] = asset.numbers("VEC3", &normals).into();
        primitive["attributes"]["TANGENT"] = asset.numbers("VEC4", &[0.0f32; 16]).into();
        primitive["attributes"]["TEXCOORD_0"] = asset.numbers("VEC2", &[f32::NAN; 8]).into();
        primitive["attributes"]["COLOR_0"] = asset.numbers("VEC3", &[f32::INFINITY; 12]).into();
    });
    let loaded = asset.load().unwrap();
    let mesh = asset.mesh();
    assert_eq!(mesh.normals, Some(vec![Vec3::Z; 4]));
    assert_eq!((mesh.tangents, mesh.uvs, mesh.colors), (None, [None, None], None));
    for words in ["1 normal of length zero", "TANGENT", "TEXCOORD_0", "COLOR_0"] {
        assert!(loaded.has_note(words), "{words}");
    }
    asset.buffer[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(asset.mesh().triangles, [[0, 2, 3]]);
    assert!(
        asset
            .load()
            .unwrap()
            .has_note("skipped 1 triangle with a corner that is not finite or beyond 1e15")
    );
}

#[test]
fn the_vertices_of_a_mesh_keep_their_colours_as_points() {
    let asset = square(|asset, primitive| {
        let colors = asset.numbers("VEC3", &[1.0f32, 0.0, 0.5].repeat(4));
        primitive["attributes"]["COLOR_0"] = colors.into();
    });
    let cloud = read("a.glb", asset.glb()).unwrap().cloud;
    // Linear 0.5 is 0.7354 in sRGB.
    assert_eq!(cloud.colors, Some(vec![[65535, 0, 48192]; 4]));
}

#[test]
fn points_that_many_nodes_repeat_must_fit_in_memory() {
    let mut asset = Asset::new();
    // An accessor without a buffer view is of zeros.
    let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 1_000_000});
    let position = asset.push("accessors", accessor);
    let mut asset = asset.with_primitive(json!({"attributes": {"POSITION": position}, "mode": 0}));
    for _ in 1..5000 {
        let node = asset.push("nodes", json!({"mesh": 0}));
        asset.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    }
    let error = read("a.glb", asset.glb()).unwrap_err().to_string();
    assert!(error.contains("5000000000 points do not fit in memory"), "{error}");
}

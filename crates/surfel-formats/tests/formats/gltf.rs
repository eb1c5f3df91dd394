//! glTF: what is read from files that are right.

use serde_json::{Value, json};
use surfel::math::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use surfel::progress::Silent;
use surfel::scene::{
    AlphaMode, Geometry, Graph, Interpolation, LampKind, Material, Mesh, Part, Projection, Track,
    Transform, Wrap,
};
use surfel_formats::{LoadOptions, Loaded, load, load_gltf, load_gltf_bytes};

use crate::common::{Folder, Listener, shared};
use crate::gltf_asset::{Asset, SQUARE, moving, png, puppet, square, triangle};

fn vectors(values: &[f32]) -> Vec<Vec3> {
    values.as_chunks().0.iter().copied().map(Vec3::from_array).collect()
}

#[test]
fn a_triangle_stands_upright_below_the_root() {
    let loaded = triangle().load().unwrap();
    assert_eq!(loaded.source.format, "glTF 2.0, binary");
    assert_eq!((loaded.source.n_points, loaded.source.columns), (None, vec!["POSITION".into()]));
    let graph = loaded.graph;
    assert_eq!((&graph.nodes[0].name[..], graph.nodes[0].parent), ("asset", None));
    assert_eq!((&graph.nodes[1].name[..], graph.nodes[1].parent), ("node 0", Some(0)));
    let world_from_node = graph.world_from_nodes()[1];
    assert!(world_from_node.transform_vector3(DVec3::Y).distance(DVec3::Z) < 1e-12);
    assert!(world_from_node.transform_vector3(DVec3::Z).distance(DVec3::NEG_Y) < 1e-12);
    assert_eq!(graph.nodes[1].parts, [Part { geometry: 0, material: 0 }]);
    assert_eq!(graph.materials[0].metallic, 1.0);
    let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!() };
    assert_eq!((&mesh.positions, &mesh.triangles[..]), (&vectors(&SQUARE[..9]), &[[0, 1, 2]][..]));
    assert!(loaded.notes.is_empty());
}

#[test]
fn indices_of_each_width_strips_and_fans_make_the_same_square() {
    let read = |mode: u32, put: &dyn Fn(&mut Asset) -> Option<usize>| {
        let mut asset = Asset::new();
        let position = asset.numbers("VEC3", &SQUARE);
        let mut primitive = json!({"attributes": {"POSITION": position}, "mode": mode});
        if let Some(indices) = put(&mut asset) {
            primitive["indices"] = json!(indices);
        }
        asset.of_primitive(primitive).mesh().triangles
    };
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[0u8, 1, 2]))), [[0, 1, 2]]);
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[0u16, 1, 2, 3]))), [[0, 1, 2]]);
    assert_eq!(read(4, &|a| Some(a.numbers("SCALAR", &[2u32, 1, 0]))), [[2, 1, 0]]);
    assert_eq!(read(5, &|a| Some(a.numbers("SCALAR", &[0u8, 1, 3, 2]))), [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(read(6, &|_| None), [[1, 2, 0], [2, 3, 0]]);
    assert_eq!(read(5, &|_| None), [[0, 1, 2], [1, 3, 2]]);
}

#[test]
fn vertices_that_few_triangles_use_are_left_behind() {
    let mut asset = Asset::new();
    let positions: Vec<f32> = (0..300).map(|i| i as f32).collect();
    let position = asset.numbers("VEC3", &positions);
    let colors: Vec<u8> = (0..100).flat_map(|i| [i, 0, 0, 255]).collect();
    let color = asset.numbers("VEC4", &colors);
    let indices = asset.numbers("SCALAR", &[90u8, 10, 50]);
    let attributes = json!({"POSITION": position, "COLOR_0": color});
    let mesh = asset.of_primitive(json!({"attributes": attributes, "indices": indices})).mesh();
    assert_eq!(mesh.triangles, [[2, 0, 1]]);
    assert_eq!(mesh.positions[2], Vec3::new(270.0, 271.0, 272.0));
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
fn quantised_attributes_are_scaled_as_they_say() {
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
        asset.of_primitive(json!({ "attributes": attributes })).mesh()
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
fn strides_and_offsets_are_heeded() {
    let mut asset = Asset::new();
    let mut bytes = vec![9; 4];
    for corner in SQUARE[..9].as_chunks::<3>().0 {
        corner.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([7; 8]);
    }
    // The last element needs no room behind it.
    bytes.truncate(bytes.len() - 8);
    let view = asset.view(&bytes);
    asset.json["bufferViews"][view]["byteStride"] = json!(20);
    let accessor = json!({"bufferView": view, "byteOffset": 4, "componentType": 5126,
        "type": "VEC3", "count": 3});
    let position = asset.push("accessors", accessor);
    let mesh = asset.of_primitive(json!({"attributes": {"POSITION": position}})).mesh();
    assert_eq!(mesh.positions, vectors(&SQUARE[..9]));
}

#[test]
fn sparse_accessors_replace_some_elements() {
    for has_base in [true, false] {
        let mut asset = square(|_, _| ());
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
fn points_keep_their_colours_and_lines_are_told() {
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
    assert_eq!(whole.cloud.positions, vectors(&SQUARE[..9]));
    assert_eq!(whole.cloud.normals, Some(vec![Vec3::Y; 3]));
    // 14047 of 65535 is half as bright as 8 bits can say.
    let [red, green, blue] = whole.cloud.colors.as_ref().unwrap()[0];
    assert_eq!((red, green, (f32::from(blue) / 257.0).round()), (65535, 0, 128.0));
    assert!(whole.colors.is_empty());
    assert_eq!(part.cloud.positions, vec![Vec3::new(1.0, 1.0, 0.0), Vec3::ZERO]);
    assert_eq!(loaded.source.n_points, Some(5));
    assert!(loaded.heard("lines, which surfel does not draw, are left out (3 times)"));
    assert!(loaded.heard("1 points that are not finite"));
    assert_eq!(loaded.graph.nodes[1].parts.len(), 2);
}

#[test]
fn geometry_is_held_once() {
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
    let part = |material| Part { geometry: 0, material };
    assert_eq!(graph.nodes[2].parts, [part(0)]);
    assert_eq!(graph.nodes[3].parts, [part(0), part(1)]);
}

#[test]
fn wrong_places_in_meshes_are_mended_and_told() {
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
    for words in ["1 normals without direction", "TANGENT", "TEXCOORD_0", "COLOR_0"] {
        assert!(loaded.heard(words), "{words}");
    }
    asset.buffer[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(asset.mesh().triangles, [[0, 2, 3]]);
    assert!(asset.load().unwrap().heard("1 triangles with a corner that is not finite"));
}

fn material(json: Value) -> Material {
    let mut asset = triangle();
    asset.push("materials", json);
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    asset.graph().materials.swap_remove(0)
}

#[test]
fn materials_have_the_defaults_and_factors_of_gltf() {
    let plain = Material { metallic: 1.0, roughness: 1.0, ior: 1.5, ..Material::MATTE };
    assert_eq!(material(json!({})), plain);
    let painted = material(json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 2, 0.75], "metallicFactor": 0,
            "roughnessFactor": 0.5},
        "emissiveFactor": [1, 0.5, 0], "alphaMode": "MASK",
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
    }));
    assert_eq!(
        painted,
        Material {
            base_color: Vec3::new(0.5, 0.25, 1.0),
            alpha: 0.75,
            alpha_mode: AlphaMode::Mask(0.5),
            metallic: 0.0,
            roughness: 0.5,
            emissive: Vec3::new(4.0, 2.0, 0.0),
            ..plain.clone()
        }
    );
    assert_eq!(material(json!({"alphaMode": "BLEND"})).alpha_mode, AlphaMode::Blend);
    let cut = material(json!({"alphaMode": "MASK", "alphaCutoff": 0.25}));
    assert_eq!(cut.alpha_mode, AlphaMode::Mask(0.25));
    assert!(material(json!({"extensions": {"KHR_materials_unlit": {}}})).is_unlit);
}

#[test]
fn glass_is_thin_unless_it_has_a_volume() {
    let glass = |volume: Value| {
        material(json!({"extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.75},
            "KHR_materials_ior": {"ior": 1.25},
            "KHR_materials_volume": volume,
        }}))
    };
    let pane = glass(json!({"attenuationDistance": 3}));
    assert_eq!((pane.transmission, pane.ior, pane.is_thin), (0.75, 1.25, true));
    assert_eq!(pane.attenuation_distance, f32::INFINITY);
    let volume = json!({"thicknessFactor": 1, "attenuationDistance": 3,
        "attenuationColor": [1, 0.5, 0]});
    let block = glass(volume);
    assert!(!block.is_thin);
    assert_eq!(block.attenuation_color, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(block.attenuation_distance, 3.0);
    assert!(!material(json!({})).is_thin);
}

#[test]
fn textures_come_with_their_samplers_and_transforms() {
    let mut asset = triangle();
    let view = asset.view(&png());
    asset.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
    asset.push("images", json!({"bufferView": view}));
    asset.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}));
    asset.push("textures", json!({"source": 0}));
    asset.push("textures", json!({"source": 1, "sampler": 0}));
    let moved = json!({"index": 1, "texCoord": 7, "extensions": {"KHR_texture_transform": {
        "offset": [0.5, 0.25], "rotation": 1.5, "scale": [2, 3], "texCoord": 1}}});
    asset.push(
        "materials",
        json!({
            "pbrMetallicRoughness": {"baseColorTexture": moved,
                "metallicRoughnessTexture": {"index": 0, "texCoord": 1}},
            "normalTexture": {"index": 0, "scale": 0.5},
            "occlusionTexture": {"index": 99},
            "emissiveTexture": {"index": 0, "texCoord": 2},
            "extensions": {"KHR_materials_transmission": {"transmissionTexture": {"index": 0}}},
        }),
    );
    let loaded = asset.load().unwrap();
    let graph = &loaded.graph;
    assert_eq!(graph.textures.len(), 1);
    assert_eq!(
        (graph.textures[0].width, &graph.textures[0].texels[..]),
        (1, &[[255, 0, 0, 255]][..])
    );
    let textures = &graph.materials[0].textures;
    let base = textures.base_color.unwrap();
    assert_eq!((base.uv_set, base.is_nearest, base.rotation_rad), (1, true, 1.5));
    assert_eq!(base.wrap, [Wrap::ClampToEdge, Wrap::MirroredRepeat]);
    assert_eq!((base.offset, base.scale), (Vec2::new(0.5, 0.25), Vec2::new(2.0, 3.0)));
    let plain = textures.metallic_roughness.unwrap();
    assert_eq!((plain.uv_set, plain.is_nearest, plain.wrap), (1, false, [Wrap::Repeat; 2]));
    assert_eq!(textures.normal.unwrap().1, 0.5);
    assert!(textures.transmission.is_some());
    assert_eq!(textures.emissive, None);
    assert!(loaded.heard("/materials/0/emissiveTexture uses TEXCOORD_2"));
}

#[test]
fn nodes_have_parts_or_matrices_and_follow_their_parents() {
    let mut asset = triangle();
    asset.json["nodes"] = json!([
        {"name": "leaf", "mesh": 0, "translation": [0, 0, 1], "rotation": [0, 0, 2, 0],
            "scale": [1, 2, 3]},
        {"name": "trunk", "children": [2, 0], "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1]},
        {"mesh": 0},
        {"name": "elsewhere"},
    ]);
    asset.json["meshes"][0]["name"] = json!("bark");
    asset.json["scenes"] = json!([{"nodes": [3]}, {"nodes": [1]}]);
    asset.json["scene"] = json!(1);
    let graph = asset.graph();
    let names: Vec<_> = graph.nodes.iter().map(|node| (&node.name[..], node.parent)).collect();
    let expected = [("asset", None), ("trunk", Some(0)), ("bark", Some(1)), ("leaf", Some(1))];
    assert_eq!(names, expected);
    let Transform::Parts { translation, rotation, scale } = graph.nodes[3].transform else {
        panic!()
    };
    assert_eq!((translation, scale), (DVec3::Z, DVec3::new(1.0, 2.0, 3.0)));
    assert_eq!(rotation, DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0));
    let Transform::Matrix(matrix) = graph.nodes[1].transform else { panic!() };
    assert_eq!(matrix.transform_point3(DVec3::ONE), DVec3::new(7.0, 8.0, 9.0));
    asset.json["scene"] = Value::Null;
    assert_eq!(asset.graph().nodes[1].name, "elsewhere");
    asset.json["scenes"] = Value::Null;
    assert_eq!(asset.graph().nodes.len(), 5);
}

#[test]
fn what_is_scaled_to_nothing_is_not_shown_unless_it_grows() {
    let mut asset = triangle();
    asset.json["nodes"] = json!([
        {"name": "gone", "scale": [0, 0, 0], "children": [1]},
        {"name": "below", "mesh": 0},
        {"name": "there", "mesh": 0},
        {"name": "hidden", "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}},
    ]);
    asset.json["scenes"][0]["nodes"] = json!([0, 2, 3]);
    let is_visible =
        |graph: &Graph| graph.nodes.iter().map(|node| node.is_visible).collect::<Vec<_>>();
    let loaded = asset.load().unwrap();
    assert_eq!(is_visible(&loaded.graph), [true, false, false, true, false]);
    assert!(loaded.heard("scaled to 0: `below`, 1 nodes in all"), "{:?}", loaded.notes);
    let times = asset.numbers("SCALAR", &[0.0f32, 1.0]);
    let scales = asset.numbers("VEC3", &[0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0]);
    asset.push(
        "animations",
        json!({"samplers": [{"input": times, "output": scales}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "scale"}}]}),
    );
    assert_eq!(is_visible(&asset.graph()), [true, true, true, true, false]);
}

#[test]
fn cameras_and_lamps_hang_on_nodes() {
    let mut asset = Asset::new();
    asset.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 1}},
    ]);
    let lights = "KHR_lights_punctual";
    asset.json["extensions"] = json!({lights: {"lights": [
        {"type": "directional", "color": [1, 0.5, 0], "intensity": 3},
        {"type": "point", "range": 7},
        {"type": "spot"},
        {"type": "spot", "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.5}},
        {"type": "area"},
    ]}});
    asset.json["nodes"] =
        (0..5).map(|i| json!({"camera": i % 2, "extensions": {lights: {"light": i}}})).collect();
    let loaded = asset.load().unwrap();
    let nodes = &loaded.graph.nodes;
    let Some(Projection::Perspective { view_angle_deg }) = nodes[1].camera else { panic!() };
    assert!((view_angle_deg - 0.5f64.to_degrees()).abs() < 1e-9);
    assert_eq!(nodes[2].camera, Some(Projection::Orthographic { height: 4.0 }));
    let lamp = |i: usize| nodes[i + 1].lamp.unwrap();
    assert_eq!((lamp(0).kind, lamp(0).color), (LampKind::Directional, Vec3::new(3.0, 1.5, 0.0)));
    assert_eq!((lamp(1).kind, lamp(1).color, lamp(1).range), (LampKind::Point, Vec3::ONE, 7.0));
    assert_eq!((lamp(0).range, lamp(0).radius), (f32::INFINITY, 0.0));
    let outer_rad = std::f32::consts::FRAC_PI_4;
    assert_eq!(lamp(2).kind, LampKind::Spot { inner_rad: 0.0, outer_rad });
    assert_eq!(lamp(3).kind, LampKind::Spot { inner_rad: 0.25, outer_rad: 0.5 });
    assert_eq!(nodes[5].lamp, None);
    assert!(loaded.heard("a light of type `area`"));
}

#[test]
fn skins_and_morph_targets_are_read() {
    let mut asset = puppet();
    let graph = asset.graph();
    let mesh = asset.mesh();
    let skin = mesh.skin.unwrap();
    assert_eq!(skin.joints, [[0, 1, 0, 0]; 4]);
    assert_eq!(skin.weights, [[0.2, 0.8, 0.0, 0.0]; 4]);
    let [up, tilt] = &mesh.morphs[..] else { panic!() };
    assert_eq!((&up.positions, &up.normals), (&vec![Vec3::Z; 4], &None));
    assert_eq!((&tilt.positions, &tilt.normals), (&vec![Vec3::ZERO; 4], &Some(vec![Vec3::X; 4])));
    assert_eq!(graph.nodes[1].morph_weights, [0.25, 0.5]);
    assert_eq!(graph.nodes[4].morph_weights, [1.0, 0.0]);
    // Without normals, nothing can be added to them.
    let mut flat = asset.clone();
    let attributes = &mut flat.json["meshes"][0]["primitives"][0]["attributes"];
    attributes.as_object_mut().unwrap().remove("NORMAL");
    assert_eq!(flat.mesh().morphs[1].normals, None);
    // Node 2 of the file is the second of the scene, and node 1 is below it.
    let [first, second] = &graph.nodes[1].joints[..] else { panic!() };
    assert_eq!((first.node, second.node), (2, 3));
    assert_eq!(first.joint_from_mesh.translation, DVec3::new(1.0, 2.0, 3.0));
    assert!(graph.nodes[4].joints.is_empty());
    // A skeleton in no scene comes along, unseen.
    asset.json["scenes"] = json!([{"nodes": [0]}]);
    let graph = asset.graph();
    assert_eq!((graph.nodes.len(), graph.nodes[1].joints[0].node), (4, 2));
    assert!(!graph.nodes[2].is_visible);
    asset.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    assert_eq!(asset.graph().nodes[1].joints[0].joint_from_mesh, DAffine3::IDENTITY);
}

#[test]
fn the_first_animation_is_read_and_the_others_told() {
    let loaded = moving().load().unwrap();
    let channels = &loaded.graph.animation.channels;
    assert_eq!(channels.len(), 4);
    assert!(channels.iter().all(|channel| channel.node == 4));
    let Track::Translation(places) = &channels[0].track else { panic!() };
    assert_eq!((places.times_secs[1], places.interpolation), (0.5, Interpolation::Linear));
    assert_eq!(places.at(1.25), DVec3::new(1.0, 2.0, 0.0));
    let Track::Rotation(turns) = &channels[1].track else { panic!() };
    assert_eq!(
        (turns.interpolation, turns.values[1]),
        (Interpolation::Step, DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0))
    );
    let Track::Scale(sizes) = &channels[2].track else { panic!() };
    assert_eq!((sizes.interpolation, sizes.values.len()), (Interpolation::Cubic, 9));
    let Track::MorphWeights(weights) = &channels[3].track else { panic!() };
    assert_eq!(weights.values, [[0.0, 1.0], [0.2, 0.0], [0.0, 0.0]]);
    assert!(loaded.heard("the first of 2 animations plays, `walk`; there are also `run`"));
    assert!(loaded.heard("an animation of morph weights of a node without any"));
}

#[test]
fn instances_become_nodes() {
    let mut asset = triangle();
    let places = asset.numbers("VEC3", &[0.0f32, 0.0, 0.0, 1.0, 2.0, 3.0]);
    let turns = asset.numbers("VEC4", &[0i16, 0, 0, 32767, 0, 32767, 0, 0]);
    let attributes = json!({"TRANSLATION": places, "ROTATION": turns, "_ID": 99});
    asset.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    asset.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let graph = asset.graph();
    let [_, bush, _, second] = &graph.nodes[..] else { panic!() };
    assert!(bush.parts.is_empty());
    assert_eq!((second.parent, second.parts.len(), &second.name[..]), (Some(1), 1, "node 0 1"));
    let Transform::Parts { translation, rotation, scale } = second.transform else { panic!() };
    assert_eq!((translation, scale), (DVec3::new(1.0, 2.0, 3.0), DVec3::ONE));
    assert_eq!(rotation, DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0));
}

/// The asset as plain JSON that has its buffer as Base64.
fn embedded(asset: &Asset) -> Vec<u8> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in asset.buffer.chunks(3) {
        let bits = chunk.iter().fold(0, |bits, byte| bits << 8 | u32::from(*byte));
        let bits = bits << (8 * (3 - chunk.len()));
        for i in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= chunk.len() { letter.into() } else { '=' });
        }
    }
    let mut json = asset.json.clone();
    let uri = format!("data:application/octet-stream;base64,{text}");
    json["buffers"] = json!([{"byteLength": asset.buffer.len(), "uri": uri}]);
    json.to_string().into()
}

#[test]
fn data_may_be_inside_beside_or_above() {
    let asset = triangle();
    let mesh = asset.mesh();
    let mesh_of = |graph: Graph| -> Mesh {
        let [Geometry::Triangles(mesh)] = &graph.geometries[..] else { panic!() };
        mesh.clone()
    };
    let (graph, source) = load_gltf_bytes("a.gltf", &embedded(&asset), &Silent).unwrap();
    assert_eq!((mesh_of(graph), &source.format[..]), (mesh.clone(), "glTF 2.0"));
    let folder = Folder::new("gltf-beside");
    std::fs::create_dir(folder.path("in side")).unwrap();
    std::fs::create_dir(folder.path("in side/deep")).unwrap();
    for (uri, path) in [
        ("a%20b.bin", "in side/a b.bin"),
        ("./a%20b.bin", "in side/a b.bin"),
        ("../above.bin", "above.bin"),
        ("100%.bin", "in side/100%.bin"),
        ("deep\\c.bin", "in side/deep/c.bin"),
        ("c%C3%A9.bin", "in side/cé.bin"),
    ] {
        std::fs::write(folder.path(path), &asset.buffer).unwrap();
        let mut json = asset.json.clone();
        json["buffers"] = json!([{"byteLength": asset.buffer.len(), "uri": uri}]);
        let file = folder.path("in side/scene.gltf");
        std::fs::write(&file, json.to_string()).unwrap();
        let (graph, _) = load_gltf(&file, &Silent).unwrap();
        assert_eq!(graph.nodes[0].name, "scene");
        assert_eq!(mesh_of(graph), mesh, "{uri}");
        std::fs::remove_file(folder.path(path)).unwrap();
    }
    // A mark in front of the JSON, as some editors leave it.
    let marked = ["\u{feff}".as_bytes(), &embedded(&asset)].concat();
    assert!(load_gltf_bytes("a.gltf", &marked, &Silent).is_ok());
}

#[test]
fn unknown_extensions_are_told_once_and_refused_where_required() {
    let mut asset = triangle();
    asset.json["extensionsUsed"] = json!([
        "KHR_materials_sheen",
        "KHR_materials_ior",
        "KHR_materials_variants",
        "EXT_other",
        "EXT_other"
    ]);
    let loaded = asset.load().unwrap();
    assert_eq!(
        loaded.notes,
        ["asset.glb: drawn without EXT_other, KHR_materials_sheen, which surfel does not read"]
    );
    for (name, advice) in [
        ("KHR_draco_mesh_compression", "without compression"),
        ("EXT_meshopt_compression", "without compression"),
        ("KHR_texture_basisu", "textures as PNG"),
        ("EXT_other", "without this extension"),
    ] {
        asset.json["extensionsRequired"] = json!([name]);
        let message = asset.message();
        assert!(message.contains(name) && message.contains(advice), "{message}");
    }
}

#[test]
fn a_truck_has_meshes_a_texture_and_wheels_that_turn() {
    let Some(path) = shared("gltf/CesiumMilkTruck/CesiumMilkTruck.gltf") else { return };
    let listener = Listener::default();
    let (mut graph, source) = load_gltf(&path, &listener).unwrap();
    graph.validate();
    assert_eq!((&source.format[..], source.n_points), ("glTF 2.0", None));
    assert!(listener.notes.lock().unwrap().is_empty());
    assert_eq!((graph.geometries.len(), graph.materials.len(), graph.textures.len()), (4, 4, 1));
    assert_eq!((graph.textures[0].width, graph.textures[0].height), (2048, 2048));
    assert_eq!(graph.nodes.len(), 6);
    assert_eq!(graph.nodes[0].name, "CesiumMilkTruck");
    let Geometry::Triangles(body) = &graph.geometries[0] else { panic!() };
    assert_eq!((body.positions.len(), body.triangles.len()), (1856, 1744));
    // As long as it stands in the file, and upright.
    assert!((body.bounds().max.y - 2.584_37).abs() < 1e-5);
    let wheels: Vec<_> = graph.nodes.iter().filter(|node| node.parts.len() == 1).collect();
    assert_eq!((wheels.len(), wheels[0].parts[0].geometry), (2, wheels[1].parts[0].geometry));
    assert_eq!(graph.animation.duration_secs(), 1.25);
    let before = graph.world_from_nodes();
    graph.pose(0.6);
    let after = graph.world_from_nodes();
    let moved = before.iter().zip(&after).filter(|(a, b)| !a.abs_diff_eq(**b, 1e-3)).count();
    assert_eq!(moved, 2);
}

#[test]
fn a_sphere_has_glass_with_a_volume() {
    let Some(path) = shared("gltf/pbr_sphere/sphere.gltf") else { return };
    let listener = Listener::default();
    let (graph, _) = load_gltf(&path, &listener).unwrap();
    graph.validate();
    assert!(listener.heard("KHR_materials_clearcoat, KHR_materials_sheen, KHR_materials_specular"));
    let [material] = &graph.materials[..] else { panic!() };
    assert_eq!((material.transmission, material.ior, material.is_thin), (0.75, 1.55, false));
    assert_eq!((material.metallic, material.attenuation_distance), (0.0, 0.155));
    // Those of clearcoat, sheen, specular and thickness are not decoded.
    assert_eq!(graph.textures.len(), 3);
    let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!() };
    assert!(mesh.tangents.is_some() && mesh.uvs[0].is_some() && mesh.normals.is_some());
}

#[test]
fn clouds_of_points_are_read_whole() {
    let facts = [
        ("gltf/Mesh_PrimitiveMode_00.gltf", 1024, false),
        ("gltf/pumpA_points.glb", 155_201, true),
    ];
    for (name, n_points, has_colors) in facts {
        let Some(path) = shared(name) else { return };
        let (graph, source) = load_gltf(&path, &Silent).unwrap();
        graph.validate();
        assert_eq!(source.n_points, Some(n_points as u64));
        let [Geometry::Points(points)] = &graph.geometries[..] else { panic!() };
        assert_eq!(points.cloud.len(), n_points);
        assert_eq!(points.cloud.colors.is_some(), has_colors);
        // As a cloud the same points, where the scene has them: turned to have Z up.
        let Loaded { cloud, source } = load(&path, &LoadOptions::default(), &Silent).unwrap();
        assert_eq!((cloud.len(), source.n_points), (n_points, Some(n_points as u64)));
        assert_eq!(cloud.colors, points.cloud.colors);
        let [p, q] = [points.cloud.world_position(7), cloud.world_position(7)];
        assert!(q.distance(DVec3::new(p.x, -p.z, p.y)) < 1e-5, "{p} {q}");
    }
}

//! glTF materials, nodes, cameras, lights, skins, morph targets and animations.

use serde_json::{Value, json};
use surfel_core::math::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{
    AlphaMode, Geometry, Graph, Interpolation, Material, Projection, PunctualLightKind, Track,
    Transform, Wrap,
};

use crate::gltf_asset::{Asset, animated_asset, png, skinned_asset, triangle};

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
fn textures_have_samplers_and_transforms() {
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
    assert!(loaded.has_note("/materials/0/emissiveTexture is skipped: it uses TEXCOORD_2"));
}

#[test]
fn nodes_have_trs_or_matrix_transforms_and_parents() {
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
    let Transform::Trs { translation, rotation, scale } = graph.nodes[3].transform else {
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
fn nodes_scaled_to_zero_are_hidden_unless_animated() {
    let mut asset = triangle();
    asset.json["nodes"] = json!([
        {"name": "gone", "scale": [0, 0, 0], "children": [1]},
        {"name": "below", "mesh": 0},
        {"name": "there", "mesh": 0},
        {"name": "hidden", "mesh": 0, "extensions": {"KHR_node_visibility": {"visible": false}}},
    ]);
    asset.json["scenes"][0]["nodes"] = json!([0, 2, 3]);
    let is_visible = |graph: &Graph<PointCloud>| {
        graph.nodes.iter().map(|node| node.is_visible).collect::<Vec<_>>()
    };
    let loaded = asset.load().unwrap();
    assert_eq!(is_visible(&loaded.graph), [true, false, false, true, false]);
    assert!(loaded.has_note("scaled to 0: `below`, 1 node in all"), "{:?}", loaded.notes);
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
fn cameras_and_lights_belong_to_nodes() {
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
    let light = |i: usize| nodes[i + 1].light.unwrap();
    assert_eq!(
        (light(0).kind, light(0).color),
        (PunctualLightKind::Directional, Vec3::new(3.0, 1.5, 0.0))
    );
    assert_eq!(
        (light(1).kind, light(1).color, light(1).range),
        (PunctualLightKind::Point, Vec3::ONE, 7.0)
    );
    assert_eq!((light(0).range, light(0).radius), (f32::INFINITY, 0.0));
    let outer_rad = std::f32::consts::FRAC_PI_4;
    assert_eq!(light(2).kind, PunctualLightKind::Spot { inner_rad: 0.0, outer_rad });
    assert_eq!(light(3).kind, PunctualLightKind::Spot { inner_rad: 0.25, outer_rad: 0.5 });
    assert_eq!(nodes[5].light, None);
    assert!(loaded.has_note("a light of type `area`"));
}

#[test]
fn skins_and_morph_targets_are_read() {
    let mut asset = skinned_asset();
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
    // Targets lose their normals and tangents if the mesh has none.
    let mut flat = asset.clone();
    let attributes = &mut flat.json["meshes"][0]["primitives"][0]["attributes"];
    attributes.as_object_mut().unwrap().remove("NORMAL");
    assert_eq!(flat.mesh().morphs[1].normals, None);
    let mut along = asset.clone();
    let turn = along.numbers("VEC3", &[0.0f32, 0.5, 0.0].repeat(4));
    along.json["meshes"][0]["primitives"][0]["targets"][1]["TANGENT"] = turn.into();
    assert_eq!(along.mesh().morphs[1].tangents, None);
    let tangent = along.numbers("VEC4", &[1i8, 0, 0, -1].repeat(4));
    along.json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = tangent.into();
    assert_eq!(along.mesh().morphs[0].tangents, None);
    assert_eq!(along.mesh().morphs[1].tangents, Some(vec![0.5 * Vec3::Y; 4]));
    // Node 2 of the file is the second node of the scene, and node 1 is its child.
    let [first, second] = &graph.nodes[1].joints[..] else { panic!() };
    assert_eq!((first.node, second.node), (2, 3));
    assert_eq!(first.joint_from_mesh.translation, DVec3::new(1.0, 2.0, 3.0));
    assert!(graph.nodes[4].joints.is_empty());
    // A skeleton outside the scene is loaded as invisible.
    asset.json["scenes"] = json!([{"nodes": [0]}]);
    let graph = asset.graph();
    assert_eq!((graph.nodes.len(), graph.nodes[1].joints[0].node), (4, 2));
    assert!(!graph.nodes[2].is_visible);
    asset.json["skins"][0].as_object_mut().unwrap().remove("inverseBindMatrices");
    assert_eq!(asset.graph().nodes[1].joints[0].joint_from_mesh, DAffine3::IDENTITY);
}

#[test]
fn points_deform_like_meshes() {
    let mut asset = skinned_asset();
    let indices = asset.numbers("SCALAR", &[3u8, 1]);
    let primitive = &mut asset.json["meshes"][0]["primitives"][0];
    (primitive["mode"], primitive["indices"]) = (json!(0), json!(indices));
    let loaded = asset.load().unwrap();
    let [Geometry::Points(points)] = &loaded.graph.geometries[..] else { panic!() };
    let cloud = points;
    assert_eq!(cloud.positions, [Vec3::Y, Vec3::X]);
    let skin = cloud.skin.as_ref().unwrap();
    assert_eq!((skin.joints.len(), skin.weights[1]), (2, [0.2, 0.8, 0.0, 0.0]));
    assert_eq!(cloud.morphs[0].positions, [Vec3::Z; 2]);
    assert_eq!(cloud.morphs[1].normals, Some(vec![Vec3::X; 2]));
    assert_eq!(loaded.graph.nodes[1].morph_weights, [0.25, 0.5]);
    assert_eq!(loaded.graph.nodes[1].joints.len(), 2);
    // A point whose target is not finite is dropped from all columns.
    let lost = asset.numbers("VEC3", &[[0.0; 3], [f32::NAN; 3], [0.0; 3], [2.0; 3]].concat());
    asset.json["meshes"][0]["primitives"][0]["targets"][1] = json!({ "POSITION": lost });
    let loaded = asset.load().unwrap();
    let [Geometry::Points(points)] = &loaded.graph.geometries[..] else { panic!() };
    assert_eq!(points.positions, [Vec3::Y]);
    assert_eq!(points.morphs[1].positions, [Vec3::splat(2.0)]);
    assert!(loaded.has_note("skipped 1 point without a finite position"));
}

#[test]
fn the_first_animation_is_read_and_the_others_are_listed() {
    let loaded = animated_asset().load().unwrap();
    let channels = &loaded.graph.animation.channels;
    assert_eq!(channels.len(), 4);
    assert!(channels.iter().all(|channel| channel.node == 4));
    let Track::Translation(positions) = &channels[0].track else { panic!() };
    assert_eq!((positions.times_secs[1], positions.interpolation), (0.5, Interpolation::Linear));
    assert_eq!(positions.at(1.25), DVec3::new(1.0, 2.0, 0.0));
    let Track::Rotation(turns) = &channels[1].track else { panic!() };
    assert_eq!(
        (turns.interpolation, turns.values[1]),
        (Interpolation::Step, DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0))
    );
    let Track::Scale(sizes) = &channels[2].track else { panic!() };
    assert_eq!((sizes.interpolation, sizes.values.len()), (Interpolation::Cubic, 9));
    let Track::MorphWeights(weights) = &channels[3].track else { panic!() };
    assert_eq!(weights.values, [[0.0, 1.0], [0.2, 0.0], [0.0, 0.0]]);
    assert!(loaded.has_note("the first of 2 animations plays; the file has `walk`, `run`"));
    assert!(loaded.has_note("an animation of morph weights is skipped"));
}

#[test]
fn instances_become_nodes() {
    let mut asset = triangle();
    let positions = asset.numbers("VEC3", &[0.0f32, 0.0, 0.0, 1.0, 2.0, 3.0]);
    let turns = asset.numbers("VEC4", &[0i16, 0, 0, 32767, 0, 32767, 0, 0]);
    let attributes = json!({"TRANSLATION": positions, "ROTATION": turns, "_ID": 99});
    asset.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    asset.json["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": attributes}});
    let graph = asset.graph();
    let [_, bush, _, second] = &graph.nodes[..] else { panic!() };
    assert!(bush.primitives.is_empty());
    assert_eq!(
        (second.parent, second.primitives.len(), &second.name[..]),
        (Some(1), 1, "node 0 1")
    );
    let Transform::Trs { translation, rotation, scale } = second.transform else { panic!() };
    assert_eq!((translation, scale), (DVec3::new(1.0, 2.0, 3.0), DVec3::ONE));
    assert_eq!(rotation, DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0));
}

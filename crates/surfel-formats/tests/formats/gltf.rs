//! glTF: storage of buffers, extensions, selection of animations, and real files.

use serde_json::json;
use surfel_core::math::DVec3;
use surfel_core::points::PointCloud;
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Graph, Mesh};
use surfel_formats::{
    LoadOptions, Loaded, inspect, load, load_gltf, load_gltf_bytes, load_graph_bytes,
};

use crate::common::{Folder, Listener, shared};
use crate::gltf_asset::{Asset, animated_asset, triangle};

/// Returns the asset as JSON with its buffer in a Base64 `data:` URI.
pub fn embedded(asset: &Asset) -> Vec<u8> {
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
fn buffers_may_be_embedded_or_in_relative_files() {
    let asset = triangle();
    let mesh = asset.mesh();
    let mesh_of = |graph: Graph<PointCloud>| -> Mesh {
        let [Geometry::Triangles(mesh)] = &graph.geometries[..] else { panic!() };
        mesh.clone()
    };
    let (graph, info) = load_gltf_bytes("a.gltf", &embedded(&asset), &NoProgress).unwrap();
    assert_eq!((mesh_of(graph), &info.format[..]), (mesh.clone(), "glTF 2.0"));
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
        let (graph, info) = load_gltf(&file, &NoProgress).unwrap();
        assert_eq!(graph.nodes[0].name, "scene");
        let [buffer] = &info.external_files[..] else { panic!("{:?}", info.external_files) };
        assert_eq!(buffer.canonicalize().unwrap(), folder.path(path).canonicalize().unwrap());
        assert_eq!(mesh_of(graph), mesh, "{uri}");
        std::fs::remove_file(folder.path(path)).unwrap();
    }
    // Some editors write a byte order mark before the JSON.
    let marked = ["\u{feff}".as_bytes(), &embedded(&asset)].concat();
    assert!(load_gltf_bytes("a.gltf", &marked, &NoProgress).is_ok());
}

#[test]
fn inspect_counts_points_and_triangles() {
    let mut asset = triangle();
    let attributes = asset.json["meshes"][0]["primitives"][0]["attributes"].clone();
    let indices = asset.numbers("SCALAR", &[0u8, 1, 2, 0]);
    asset.json["meshes"][0]["primitives"] = json!([
        { "attributes": attributes, "indices": indices, "mode": 5 },
        { "attributes": attributes, "mode": 0 },
        { "attributes": attributes },
    ]);
    let folder = Folder::new("gltf-inspect");
    let file = folder.path("a.glb");
    std::fs::write(&file, asset.glb()).unwrap();
    let info = inspect(&file).unwrap();
    assert_eq!((info.n_points, info.n_triangles), (Some(3), Some(3)));
    assert_eq!(info.format, "glTF 2.0, binary");
}

#[test]
fn an_animation_is_selected_by_name() {
    let bytes = animated_asset().glb();
    let n_channels = |name: &str| {
        let options = LoadOptions { animation: Some(name.into()), ..LoadOptions::default() };
        let loaded = load_graph_bytes("a.glb", &bytes, &options, &NoProgress);
        loaded.map(|(graph, _)| graph.animation.channels.len())
    };
    assert_eq!((n_channels("walk").unwrap(), n_channels("run").unwrap()), (4, 0));
    let message = n_channels("fly").unwrap_err().to_string();
    assert_eq!(message, "a.glb: has no animation `fly`; there is `walk`, `run`");
    // A file without animations ignores the requested name.
    let options = LoadOptions { animation: Some("fly".into()), ..LoadOptions::default() };
    assert!(load_graph_bytes("a.glb", &triangle().glb(), &options, &NoProgress).is_ok());
}

#[test]
fn unknown_extensions_are_reported_once_and_rejected_if_required() {
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
    let (mut graph, info) = load_gltf(&path, &listener).unwrap();
    graph.validate();
    assert_eq!((&info.format[..], info.n_points), ("glTF 2.0", None));
    assert!(listener.notes.lock().unwrap().is_empty());
    assert_eq!((graph.geometries.len(), graph.materials.len(), graph.textures.len()), (4, 4, 1));
    assert_eq!((graph.textures[0].width, graph.textures[0].height), (2048, 2048));
    assert_eq!(graph.nodes.len(), 6);
    assert_eq!(graph.nodes[0].name, "CesiumMilkTruck");
    let Geometry::Triangles(body) = &graph.geometries[0] else { panic!() };
    assert_eq!((body.positions.len(), body.triangles.len()), (1856, 1744));
    // The mesh has the size stated in the file.
    assert!((body.bounds().max.y - 2.584_37).abs() < 1e-5);
    let wheels: Vec<_> = graph.nodes.iter().filter(|node| node.primitives.len() == 1).collect();
    assert_eq!(
        (wheels.len(), wheels[0].primitives[0].geometry),
        (2, wheels[1].primitives[0].geometry)
    );
    assert_eq!(graph.animation.duration_secs(), 1.25);
    let before = graph.world_from_nodes();
    graph.evaluate_at(0.6);
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
    assert!(
        listener.has_note("KHR_materials_clearcoat, KHR_materials_sheen, KHR_materials_specular")
    );
    let [material] = &graph.materials[..] else { panic!() };
    assert_eq!((material.transmission, material.ior, material.is_thin), (0.75, 1.55, false));
    assert_eq!((material.metallic, material.attenuation_distance), (0.0, 0.155));
    // Textures of clearcoat, sheen, specular and thickness are not decoded.
    assert_eq!(graph.textures.len(), 3);
    let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!() };
    assert!(mesh.tangents.is_some() && mesh.uvs[0].is_some() && mesh.normals.is_some());
}

#[test]
fn point_primitives_become_clouds() {
    let facts = [
        ("gltf/Mesh_PrimitiveMode_00.gltf", 1024, false),
        ("gltf/pumpA_points.glb", 155_201, true),
    ];
    for (name, n_points, has_colors) in facts {
        let Some(path) = shared(name) else { return };
        let (graph, info) = load_gltf(&path, &NoProgress).unwrap();
        graph.validate();
        assert_eq!(info.n_points, Some(n_points as u64));
        let [Geometry::Points(points)] = &graph.geometries[..] else { panic!() };
        assert_eq!(points.len(), n_points);
        assert_eq!(points.colors.is_some(), has_colors);
        // Loaded as a cloud, the same points are rotated to Z up.
        let Loaded { cloud, info } = load(&path, &LoadOptions::default(), &NoProgress).unwrap();
        assert_eq!((cloud.len(), info.n_points), (n_points, Some(n_points as u64)));
        assert_eq!(cloud.colors, points.colors);
        let [p, q] = [points.world_position(7), cloud.world_position(7)];
        assert!(q.distance(DVec3::new(p.x, -p.z, p.y)) < 1e-5, "{p} {q}");
    }
}

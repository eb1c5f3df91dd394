//! Truncated, changed and incomplete glTF files: each is an error or gives a valid graph.

use serde_json::{Value, json};
use surfel_core::image::Image;
use surfel_core::math::Random;
use surfel_core::progress::NoProgress;
use surfel_formats::{ImageOptions, encode_png, load_gltf, load_gltf_bytes};

use crate::common::{Folder, Listener};
use crate::gltf_asset::{full_asset, load_bytes, set, triangle};

#[test]
fn missing_and_malformed_images_are_skipped_with_a_warning() {
    let mut asset = full_asset();
    let external = |uri: &str| json!({ "uri": uri });
    for (image, words) in [
        (external("wood.png"), "/images/0 is skipped: asset.glb: found the reference `wood.png`"),
        (
            external("data:image/png;base64,AAAA"),
            "/images/0 is skipped: asset.glb/images/0: byte 0",
        ),
        (json!({"bufferView": 0}), "is skipped: asset.glb/images/0: byte 0: found `"),
    ] {
        asset.json["images"][0] = image;
        let loaded = asset.load().unwrap();
        assert!(loaded.has_note(words), "{:?}", loaded.notes);
        assert_eq!(loaded.graph.materials[0].textures.base_color, None);
    }
    asset.json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
    assert!(asset.load().unwrap().has_note("/textures/0 has no PNG or JPEG"));
    let folder = Folder::new("gltf-missing");
    let path = folder.path("a.gltf");
    let mut asset = triangle();
    asset.buffer.clear();
    asset.json = json!({"asset": {"version": "2.0"}, "images": [{"uri": "wood%20.png"}],
        "textures": [{"source": 0}], "materials": [{"normalTexture": {"index": 0}}]});
    std::fs::write(&path, asset.json.to_string()).unwrap();
    let listener = Listener::default();
    load_gltf(&path, &listener).unwrap();
    assert!(
        listener.has_note("found `wood%20.png`, and ")
            && listener.has_note("wood .png cannot be read")
    );
}

#[test]
fn missing_or_absolute_buffers_are_rejected() {
    let folder = Folder::new("gltf-elsewhere");
    let path = folder.path("a.gltf");
    let message = |uri: &str| {
        let mut asset = triangle();
        asset.json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        std::fs::write(&path, asset.json.to_string()).unwrap();
        load_gltf(&path, &NoProgress).unwrap_err().to_string()
    };
    let missing = message("far.bin");
    assert!(missing.contains("a.gltf: /buffers/0/uri: found `far.bin`, and"), "{missing}");
    assert!(missing.contains("a file beside this one, copied along with it"), "{missing}");
    for uri in
        ["http://a.b/c.bin", "/etc/passwd", "C:\\a.bin", "file:///etc/passwd", "%2fetc/passwd"]
    {
        let message = message(uri);
        assert!(message.contains(uri) && message.contains("its relative path"), "{message}");
    }
    assert!(message(".").contains("found a folder"));
    std::fs::write(folder.path("short.bin"), [0; 35]).unwrap();
    assert!(message("short.bin").contains("found 36, but the buffer has 35 bytes"));
    assert!(message("a\0b").contains("cannot be read"));
}

#[test]
fn other_content_is_rejected() {
    let message = |bytes: &[u8]| load_bytes("a.glb", bytes).err().unwrap().to_string();
    assert!(message(b"").contains("found an empty file"));
    assert!(message(b"x").contains("a.glb: line 1: found expected value"));
    assert!(message(b"[1]").contains("found no object"));
    assert!(message(b"{}").contains("the whole of its JSON: found no `asset`"));
    assert!(message(b"{\"asset\":\n{\"version\": NaN}}").contains("line 2"));
    assert!(message("[".repeat(100_000).as_bytes()).contains("recursion limit"));
    assert!(message(b"glTF").contains("byte 4: found the end of 4 bytes"));
    let glb = triangle().glb();
    let with = |at: usize, value: u32| {
        let mut glb = glb.clone();
        glb[at..at + 4].copy_from_slice(&value.to_le_bytes());
        message(&glb)
    };
    assert!(with(4, 1).contains("version 1 of GLB"));
    assert!(with(8, u32::MAX).contains("expected the 4294967295 that its header announces"));
    assert!(with(12, u32::MAX).contains("byte 12: found a chunk of 4294967295 bytes"));
    assert!(with(16, 0).contains("found no chunk `JSON`"));
    assert!(with(8, 12).contains("found no chunk `JSON`"));
}

#[test]
fn a_truncated_glb_is_an_error() {
    let glb = full_asset().glb();
    for length in 0..glb.len() {
        assert!(load_bytes("a.glb", &glb[..length]).is_err(), "{length}");
    }
}

#[test]
fn a_glb_with_random_changes_is_an_error_or_a_valid_graph() {
    let glb = full_asset().glb();
    let mut n_read = 0;
    for seed in 0..6000 {
        let mut random = Random::new(7, seed);
        let mut broken = glb.clone();
        for _ in 0..1 + seed % 4 {
            broken[random.below(glb.len() as u64) as usize] ^= 1 << random.below(8);
        }
        // `load_bytes` validates the graph.
        n_read += usize::from(load_bytes("a.glb", &broken).is_ok());
    }
    assert!(500 < n_read && n_read < 5500, "{n_read}");
}

#[test]
fn replacing_any_json_value_does_not_panic() {
    let asset = full_asset();
    let mut pointers = Vec::new();
    all_pointers(&asset.json, String::new(), &mut pointers);
    assert!(200 < pointers.len());
    let huge = json!(1e308);
    for pointer in &pointers {
        let values = [
            json!(0),
            json!(1),
            json!(-1),
            huge.clone(),
            json!("x"),
            json!([]),
            json!({}),
            json!(true),
        ];
        for value in values.into_iter().chain([Value::Null, json!([0, 0, 0, 0])]) {
            let mut broken = asset.clone();
            set(&mut broken.json, pointer, value);
            let _ = load_bytes("a.glb", &broken.glb());
        }
    }
}

#[test]
fn a_buffer_with_many_names_allows_no_more_memory_than_once() {
    let folder = Folder::new("gltf-names");
    std::fs::write(folder.path("a.bin"), vec![0; 1 << 20]).unwrap();
    let load = |n_buffers: usize| {
        let name = |i: usize| format!("{}a.bin", "./".repeat(i));
        let buffers: Vec<Value> =
            (0..n_buffers).map(|i| json!({"uri": name(i), "byteLength": 1 << 20})).collect();
        // 240 MiB of zeros: more than the 64 MiB of any file and 64 bytes for each of the buffer's.
        let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 20 << 20});
        let gltf = json!({
            "asset": {"version": "2.0"}, "buffers": buffers, "accessors": [accessor],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}],
            "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        });
        std::fs::write(folder.path("a.gltf"), gltf.to_string()).unwrap();
        load_gltf(&folder.path("a.gltf"), &NoProgress).map(|_| ())
    };
    for n_buffers in [1, 100] {
        let message = load(n_buffers).unwrap_err().to_string();
        assert!(message.contains("no more memory than a file of this size can need"), "{message}");
    }
}

#[test]
fn an_image_with_many_names_is_decoded_once() {
    let folder = Folder::new("gltf-image-names");
    std::fs::create_dir_all(folder.path("sub")).unwrap();
    let png = encode_png(&Image::new(2, 2), &ImageOptions::default()).unwrap();
    std::fs::write(folder.path("a.png"), png).unwrap();
    std::fs::write(folder.path("b.png"), "no picture").unwrap();
    let names = ["a.png", "./a.png", "sub/../a.png", "%61.png", "b.png", "./b.png"];
    let images: Vec<Value> = names.iter().map(|name| json!({ "uri": name })).collect();
    let textures: Vec<Value> = (0..names.len()).map(|i| json!({ "source": i })).collect();
    let material = |i| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}});
    let materials: Vec<Value> = (0..names.len()).map(material).collect();
    let mut asset = triangle();
    for (list, values) in [("images", images), ("textures", textures), ("materials", materials)] {
        asset.json[list] = json!(values);
    }
    std::fs::write(folder.path("a.glb"), asset.glb()).unwrap();
    let listener = Listener::default();
    let (graph, _) = load_gltf(&folder.path("a.glb"), &listener).unwrap();
    assert_eq!(graph.textures.len(), 1);
    let n_textured =
        graph.materials.iter().filter(|material| material.textures.base_color.is_some()).count();
    assert_eq!(n_textured, 4);
    assert!(listener.has_note("/images/4 is skipped") && !listener.has_note("/images/5"));
}

fn all_pointers(json: &Value, pointer: String, found: &mut Vec<String>) {
    match json {
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                all_pointers(item, format!("{pointer}/{i}"), found);
            }
        }
        Value::Object(members) => {
            for (key, value) in members {
                all_pointers(value, format!("{pointer}/{key}"), found);
            }
        }
        _ => {}
    }
    if !pointer.is_empty() {
        found.push(pointer);
    }
}

#[test]
fn long_node_chains_do_not_overflow_the_stack() {
    let n = 50_000;
    let nodes: Vec<Value> =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    let mut asset = triangle();
    asset.json["nodes"] = json!(nodes);
    assert_eq!(asset.graph().nodes.len(), n + 1);
}

#[test]
fn cancellation_stops_reading() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    let error = load_gltf_bytes("a.glb", &triangle().glb(), &listener).unwrap_err();
    assert!(matches!(error, surfel_formats::Error::Core(surfel_core::Error::Cancelled)));
}

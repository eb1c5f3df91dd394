//! glTF files that are cut, changed or incomplete: an error that names the place, or a whole graph.

use serde_json::{Value, json};
use surfel::math::Random;
use surfel::progress::Silent;
use surfel_formats::{load_gltf, load_gltf_bytes};

use crate::common::{Folder, Listener};
use crate::gltf_asset::{everything, load_bytes, set, triangle};

#[test]
fn missing_and_broken_pictures_are_told_and_left_out() {
    let mut asset = everything();
    let external = |uri: &str| json!({ "uri": uri });
    for (image, words) in [
        (external("wood.png"), "/images/0 is left out: asset.glb: found the reference `wood.png`"),
        (
            external("data:image/png;base64,AAAA"),
            "/images/0 is left out: asset.glb/images/0: byte 0",
        ),
        (json!({"bufferView": 0}), "is left out: asset.glb/images/0: byte 0: found `"),
    ] {
        asset.json["images"][0] = image;
        let loaded = asset.load().unwrap();
        assert!(loaded.heard(words), "{:?}", loaded.notes);
        assert_eq!(loaded.graph.materials[0].textures.base_color, None);
    }
    asset.json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
    assert!(asset.load().unwrap().heard("/textures/0 has no PNG or JPEG"));
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
        listener.heard("found `wood%20.png`, and ") && listener.heard("wood .png cannot be read")
    );
}

#[test]
fn buffers_that_are_missing_or_elsewhere_are_refused_by_name() {
    let folder = Folder::new("gltf-elsewhere");
    let path = folder.path("a.gltf");
    let message = |uri: &str| {
        let mut asset = triangle();
        asset.json["buffers"] = json!([{"byteLength": 36, "uri": uri}]);
        std::fs::write(&path, asset.json.to_string()).unwrap();
        load_gltf(&path, &Silent).unwrap_err().to_string()
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
fn what_is_no_gltf_is_told() {
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
fn a_glb_cut_off_anywhere_is_an_error() {
    let glb = everything().glb();
    for length in 0..glb.len() {
        assert!(load_bytes("a.glb", &glb[..length]).is_err(), "{length}");
    }
}

#[test]
fn a_glb_with_any_bytes_changed_is_an_error_or_whole() {
    let glb = everything().glb();
    let mut n_read = 0;
    for seed in 0..6000 {
        let mut random = Random::new(7, seed);
        let mut broken = glb.clone();
        for _ in 0..1 + seed % 4 {
            broken[random.below(glb.len() as u64) as usize] ^= 1 << random.below(8);
        }
        // A graph that is read is checked.
        n_read += usize::from(load_bytes("a.glb", &broken).is_ok());
    }
    assert!(500 < n_read && n_read < 5500, "{n_read}");
}

#[test]
fn any_value_of_the_json_may_be_anything() {
    let asset = everything();
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
fn long_chains_of_nodes_are_no_trouble() {
    let n = 50_000;
    let nodes: Vec<Value> =
        (0..n).map(|i| if i + 1 < n { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    let mut asset = triangle();
    asset.json["nodes"] = json!(nodes);
    assert_eq!(asset.graph().nodes.len(), n + 1);
}

#[test]
fn reading_stops_when_it_is_cancelled() {
    let listener = Listener::default();
    listener.cancelled.store(true, std::sync::atomic::Ordering::Relaxed);
    let error = load_gltf_bytes("a.glb", &triangle().glb(), &listener).unwrap_err();
    assert!(matches!(error, surfel_formats::Error::Surfel(surfel::Error::Cancelled)));
}

//! glTF files with invalid values: each is an error that names its JSON pointer.

use serde_json::{Value, json};

use crate::gltf_asset::{Asset, full_asset, png, set, square, triangle};

fn message_with(asset: &Asset, pointer: &str, value: Value) -> String {
    let mut broken = asset.clone();
    set(&mut broken.json, pointer, value);
    broken.message()
}

#[test]
fn the_full_asset_is_valid() {
    let graph = full_asset().graph();
    assert_eq!((graph.geometries.len(), graph.textures.len()), (2, 1));
    assert!(graph.nodes.iter().any(|node| node.camera.is_some()));
    assert!(graph.nodes.iter().any(|node| node.light.is_some()));
}

#[test]
fn invalid_references_are_errors_with_a_json_pointer() {
    let asset = full_asset();
    for pointer in [
        "/scene",
        "/scenes/0/nodes/0",
        "/nodes/2/children/0",
        "/nodes/0/mesh",
        "/nodes/0/skin",
        "/nodes/1/camera",
        "/nodes/2/extensions/KHR_lights_punctual/light",
        "/nodes/4/extensions/EXT_mesh_gpu_instancing/attributes/TRANSLATION",
        "/meshes/0/primitives/0/indices",
        "/meshes/0/primitives/0/material",
        "/meshes/0/primitives/0/attributes/POSITION",
        "/meshes/0/primitives/0/attributes/JOINTS_0",
        "/meshes/0/primitives/0/targets/0/POSITION",
        "/meshes/0/primitives/0/targets/1/NORMAL",
        "/skins/0/joints/0",
        "/skins/0/inverseBindMatrices",
        "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
        "/textures/0/source",
        "/textures/0/sampler",
        "/images/0/bufferView",
        "/accessors/0/bufferView",
        "/bufferViews/0/buffer",
        "/animations/0/channels/0/sampler",
        "/animations/0/channels/0/target/node",
        "/animations/0/samplers/0/input",
        "/animations/0/samplers/0/output",
    ] {
        for (value, found) in [
            (json!(99), "found index 99, expected "),
            (json!(u64::MAX), "found index 18446744073709551615"),
            (json!(-1), "found -1, expected a whole number"),
            (json!(0.5), "found 0.5, expected a whole number"),
            (json!("0"), "found `0`, expected a whole number"),
        ] {
            let message = message_with(&asset, pointer, value);
            assert!(message.starts_with(&format!("asset.glb: {pointer}: {found}")), "{message}");
        }
    }
}

#[test]
fn invalid_values_are_errors_with_a_json_pointer() {
    let asset = full_asset();
    let primitive = "/meshes/0/primitives/0";
    let volume = "/materials/0/extensions/KHR_materials_volume";
    let table = [
        ("/asset/version", json!("1.0"), "found glTF 1.0, which surfel cannot read; convert"),
        ("/asset/version", json!(2), "/asset/version: found 2, expected a string"),
        ("/asset/minVersion", json!("2.1"), "found glTF 2.1"),
        ("/asset", json!([]), "/asset: found an array of 0, expected an object"),
        ("/asset", Value::Null, "found no `asset`, expected one"),
        ("/nodes", json!({}), "/nodes: found an object, expected an array"),
        ("/nodes/0", json!(3), "/nodes/0: found 3, expected an object"),
        ("/nodes/2/children", json!([2]), "node 2 below itself"),
        ("/nodes/1/children", json!([2]), "below itself, expected nodes without cycles"),
        ("/nodes/3/children", json!([1]), "node 1, which is already a child of node 2"),
        ("/nodes/3/children", json!([0, 0]), "node 0, which is already a child of node 3"),
        ("/scenes/0/nodes", json!([0, 0]), "/scenes/0/nodes/1: found node 0, which has a parent"),
        ("/scenes/0/nodes", json!([1]), "/scenes/0/nodes/0: found node 1, which has a parent"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "/nodes/0/rotation: found [0.0, 0.0, 0.0, 0.0]"),
        ("/nodes/0/rotation", json!([0, 0, 1]), "found 3 numbers, expected 4"),
        ("/nodes/0/translation", json!([0, 0, 1e300]), "/nodes/0: found node, whose transform"),
        ("/nodes/0/scale", json!([0, 0, "x"]), "/nodes/0/scale/2: found `x`, expected a number"),
        ("/nodes/0/scale", json!([1e200, 1, 1]), "expected a position and a size within 1e30"),
        ("/nodes/0/matrix", json!([1, 2]), "found 2 numbers, expected 16"),
        ("/nodes/0/matrix", json!(vec![1.0; 16]), "as last row, expected 0, 0, 0, 1"),
        ("/nodes/0/weights", json!([1]), "found 1 weight, expected 2"),
        ("/meshes/0/weights", json!([1, 2, 3]), "found 3 weights, expected 2"),
        ("/meshes/0/primitives", Value::Null, "/meshes/0: found no `primitives`"),
        ("/meshes/0/primitives/0/attributes", Value::Null, "found no `attributes`"),
        ("/meshes/0/primitives/0/mode", json!(7), "found 7, expected a mode from 0 to 6"),
        ("/meshes/0/primitives/0/mode", json!("x"), "expected a whole number"),
        (
            "/accessors/0/count",
            json!(5),
            "/accessors/0: found 5 elements of 12 bytes, 12 apart, from 0",
        ),
        ("/accessors/0/count", json!(3), "found 3 at 5, expected less than the 3 positions"),
        ("/accessors/0/count", json!(u64::MAX), "elements of 12 bytes"),
        ("/accessors/0/byteOffset", json!(4), "expected 48 bytes at most"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "expected 48 bytes at most"),
        ("/accessors/0/componentType", json!(5124), "expected 5120, 5121"),
        ("/accessors/0/componentType", json!(4_294_972_422_u64), "expected 5120, 5121"),
        ("/accessors/0/componentType", json!(5125), "found components of type U32"),
        ("/accessors/0/type", json!("VEC4"), "16 bytes, 16 apart"),
        ("/accessors/0/type", json!("VEC2"), "found type VEC2, expected VEC3"),
        ("/accessors/0/type", json!("VEC5"), "expected SCALAR, VEC2"),
        ("/accessors/0/normalized", json!(1), "expected true or false"),
        ("/accessors/1/componentType", json!(5120), "expected 5121, 5123 or 5125"),
        ("/accessors/1/type", json!("VEC2"), "6 elements of 2 bytes, 2 apart, from 0"),
        ("/accessors/2/count", json!(3), "JOINTS_0: found 3 elements in /accessors/2, expected 4"),
        ("/bufferViews/0/byteStride", json!(8), "a byteStride of 8 in bufferView 0"),
        ("/bufferViews/0/byteStride", json!(0), "a byteStride of 0 in bufferView 0"),
        ("/bufferViews/0/byteStride", json!(24), "4 elements of 12 bytes, 24 apart"),
        ("/bufferViews/0/byteStride", json!(u64::MAX), "18446744073709551615 apart"),
        ("/bufferViews/0/byteLength", json!(40), "expected 40 bytes at most"),
        ("/bufferViews/0/byteLength", json!(u64::MAX), "expected a part of the buffer's"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "expected a part of the buffer's"),
        (
            "/buffers",
            json!([{"byteLength": 1_000_000}]),
            "/buffers/0/byteLength: found 1000000, but",
        ),
        ("/buffers", json!([{}]), "/buffers/0: found no `byteLength`"),
        (
            "/buffers",
            json!([{"byteLength": 9, "uri": "data:;base64,AAAA"}]),
            "the buffer has 3 bytes",
        ),
        (
            "/buffers",
            json!([{"byteLength": 9, "uri": "data:;base64,A*AA"}]),
            "`data:` and bytes in Base64",
        ),
        ("/buffers", json!([{"byteLength": 9, "uri": "data:AAAA"}]), "`data:` and bytes in Base64"),
        ("/buffers", json!([{"byteLength": 9, "uri": "a.bin"}]), "pack all into one .glb"),
        ("/skins/0/joints", Value::Null, "/skins/0: found no `joints`"),
        ("/skins/0/joints", json!([1]), "found a skin of 1 joint, expected the 2"),
        ("/skins/0/inverseBindMatrices", json!(0), "found type VEC3, expected MAT4"),
        ("/materials/0/alphaMode", json!("GLASS"), "expected OPAQUE, MASK or BLEND"),
        ("/materials/0/emissiveFactor", json!([1, 1]), "found 2 numbers, expected 3"),
        (
            "/materials/0/emissiveFactor",
            json!([1, 1, 1e99]),
            "numbers in the range of 32-bit floats",
        ),
        ("/materials/0/extensions/KHR_materials_ior/ior", json!(0.5), "expected 0, or 1 and more"),
        (&format!("{volume}/attenuationDistance"), json!(0), "expected a distance above 0"),
        ("/samplers/0/wrapS", json!(1), "/samplers/0/wrapS: found 1, expected 10497"),
        ("/cameras/0/type", Value::Null, "/cameras/0: found no `type`"),
        ("/cameras/0/perspective", Value::Null, "found no `perspective`"),
        ("/cameras/0/perspective/yfov", json!(4), "expected an angle above 0 and below pi"),
        ("/extensions/KHR_lights_punctual/lights/0/range", json!(-1), "a distance above 0"),
        ("/extensions/KHR_lights_punctual/lights/0/type", Value::Null, "found no `type`"),
        (
            "/extensions/KHR_lights_punctual/lights/0/spot/outerConeAngle",
            json!(9),
            "found cones of 0 and 9",
        ),
        ("/extensions", Value::Null, "expected lights in the extension at the top level"),
        ("/animations/0/channels", Value::Null, "/animations/0: found no `channels`"),
        ("/animations/0/channels/0/target", Value::Null, "found no `target`"),
        ("/animations/0/channels/0/target/path", json!("size"), "expected translation, rotation"),
        ("/animations/0/channels/0/target/path", json!("rotation"), "expected VEC4"),
        ("/animations/0/samplers/0/interpolation", json!("EASE"), "expected LINEAR, STEP"),
        (
            "/animations/0/samplers/0/interpolation",
            json!("CUBICSPLINE"),
            "3 values for 3 keys (animation `walk`, /animations/0/channels/0), expected 9",
        ),
        ("/animations/0/samplers/0/output", json!(1), "6 values for 3 keys"),
        ("/extensionsUsed", json!([1]), "/extensionsUsed/0: found 1, expected a string"),
        (&format!("{primitive}/extensions"), json!({"KHR_draco_mesh_compression": 1}), ""),
    ];
    let mut failures = Vec::new();
    for (pointer, value, words) in table {
        if words.is_empty() {
            // The vertices are present without the extension as well.
            let mut valid = asset.clone();
            set(&mut valid.json, pointer, value);
            valid.graph();
            continue;
        }
        let message = message_with(&asset, pointer, value);
        if !(message.starts_with("asset.glb") && message.contains(words)) {
            failures.push(format!("{words}\n  {message}"));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn draco_vertices_are_rejected_even_if_the_extension_is_not_required() {
    let mut asset = triangle();
    asset.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    asset.json["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    assert!(asset.message().contains("gltf-transform copy"));
}

#[test]
fn non_finite_animations_and_skins_are_rejected() {
    let asset = full_asset();
    let byte_offset = |asset: &Asset, accessor: usize| {
        let view = asset.json["accessors"][accessor]["bufferView"].as_u64().unwrap();
        asset.json["bufferViews"][view as usize]["byteOffset"].as_u64().unwrap() as usize
    };
    let sampler = |i: usize, key: &str| {
        asset.json["animations"][0]["samplers"][i][key].as_u64().unwrap() as usize
    };
    let binds = asset.json["skins"][0]["inverseBindMatrices"].as_u64().unwrap() as usize;
    let with = |accessor: usize, at: usize, value: f32| {
        let mut broken = asset.clone();
        let at = byte_offset(&broken, accessor) + 4 * at;
        broken.buffer[at..at + 4].copy_from_slice(&value.to_le_bytes());
        broken.message()
    };
    for (accessor, at, value, words) in [
        (sampler(0, "input"), 1, f32::NAN, "found NaN at key 1 (animation `walk`"),
        (
            sampler(0, "input"),
            1,
            3.0,
            "found 2 s after 3 s at key 2 (animation `walk`, /animations/0/channels/0), expected increasing times",
        ),
        (
            sampler(0, "output"),
            4,
            f32::INFINITY,
            "/animations/0/samplers/0/output: found a value that is not finite at 1",
        ),
        (binds, 3, f32::NAN, "/skins/0/inverseBindMatrices: found a matrix that is not finite"),
    ] {
        let message = with(accessor, at, value);
        assert!(message.contains(words), "{message}");
    }
    // A rotation by a zero quaternion.
    let mut broken = asset.clone();
    let at = byte_offset(&broken, sampler(1, "output"));
    broken.buffer[at..at + 4].fill(0);
    assert!(broken.message().contains("the quaternion [0.0, 0.0, 0.0, 0.0] at 0"));
    let mut broken = asset.clone();
    broken.json["accessors"][sampler(0, "input")]["count"] = json!(0);
    assert!(broken.message().contains("found no keys"));
}

#[test]
fn sparse_accessors_are_checked() {
    let mut asset = square(|_, _| ());
    let indices = asset.view(&[1, 3, 0, 0]);
    let values = asset.view(&[0; 24]);
    set(
        &mut asset.json,
        "/accessors/0/sparse",
        json!({"count": 2,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values}}),
    );
    asset.graph();
    for (pointer, value, words) in [
        ("/count", json!(3), "found 0 after 3, expected increasing indices"),
        ("/count", json!(5), "/accessors/0/sparse/indices: found 5 elements of 1 byte,"),
        ("/count", json!(u64::MAX), "/accessors/0/sparse/indices"),
        ("/indices/componentType", json!(5120), "expected 5121, 5123 or 5125"),
        ("/indices/componentType", json!(5123), "found 0 after 769, expected increasing indices"),
        ("/indices/bufferView", json!(9), "found index 9"),
        ("/indices", Value::Null, "found no `indices`"),
        ("/values/bufferView", json!(indices), "/accessors/0/sparse/values: found 2 elements"),
        ("/values/byteOffset", json!(1), "/accessors/0/sparse/values"),
    ] {
        let message = message_with(&asset, &format!("/accessors/0/sparse{pointer}"), value);
        assert!(message.contains(words), "{message}");
    }
    let beyond = asset.view(&[1, 4]);
    let message = message_with(&asset, "/accessors/0/sparse/indices/bufferView", json!(beyond));
    assert!(message.contains("found index 4, expected less than the count of 4"), "{message}");
}

#[test]
fn excessive_memory_claims_are_rejected() {
    // Accessors of zeros take no space in the file.
    let mut asset = triangle();
    let accessor = asset.json["accessors"][0].as_object_mut().unwrap();
    accessor.remove("bufferView");
    for count in [100_000_000_u64, 4_000_000_000, u64::MAX / 2, u64::MAX] {
        asset.json["accessors"][0]["count"] = json!(count);
        assert!(asset.message().contains("no more memory than a file of this size can need"));
    }
    // Many different primitives share the same vertices.
    let mut asset = Asset::new();
    let positions = vec![0.0f32; 300_000];
    let position = asset.numbers("VEC3", &positions);
    let indices: Vec<u8> = vec![0; 100_000];
    let view = asset.view(&indices);
    let primitives: Vec<Value> = (0..2000)
        .map(|i| {
            let accessor = asset.push(
                "accessors",
                json!({"bufferView": view, "byteOffset": i,
                "componentType": 5121, "type": "SCALAR", "count": 90_000}),
            );
            json!({"mode": 0, "attributes": {"POSITION": position}, "indices": accessor})
        })
        .collect();
    let mesh = asset.push("meshes", json!({ "primitives": primitives }));
    asset.push("nodes", json!({ "mesh": mesh }));
    assert!(asset.message().contains("no more memory"));
    // Several images share the same bytes; each could decode to a gigabyte.
    let picture = [&png()[..], &[0; 1 << 20]].concat();
    for (n_views, is_accepted) in [(1, true), (2, false)] {
        let mut asset = triangle();
        for i in 0..n_views {
            let view = asset.view(if i == 0 { &picture } else { &[] });
            let first = asset.json["bufferViews"][view - i]["byteOffset"].clone();
            let length = json!(picture.len());
            asset.json["bufferViews"][view] =
                json!({"buffer": 0, "byteOffset": first, "byteLength": length});
            asset.push("images", json!({ "bufferView": view }));
            asset.push("textures", json!({ "source": i }));
            let base = json!({"baseColorTexture": {"index": i}});
            asset.push("materials", json!({ "pbrMetallicRoughness": base }));
        }
        let loaded = asset.load();
        assert_eq!(loaded.is_ok(), is_accepted, "{:?}", loaded.err());
    }
}

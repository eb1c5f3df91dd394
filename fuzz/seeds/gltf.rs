//! glTF files.

use std::fs;
use std::path::Path;

use surfel_core::image::Image;
use surfel_core::progress::NoProgress;
use surfel_formats::{ImageOptions, encode_png};

/// Writes a scene with all supported features, as GLB and as JSON.
pub fn write(folder: &Path) -> std::io::Result<()> {
    let png = encode_png(&Image::new(2, 2), &ImageOptions::default());
    let png = png.map_err(std::io::Error::other)?;
    let floats = |floats: &[f32]| -> Vec<u8> {
        floats.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
    let square = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let identity = floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
    let times = floats(&[0.0, 1.0]);
    let bytes = [0, 1, 2, 0, 2, 3, 0, 0, 127, 0, 0, 127, 255, 0, 0, 127];
    let buffer = [&square[..], &identity, &times, &bytes, &png].concat();
    let view = |offset: usize, length: usize| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let views = [view(0, 48), view(48, 64), view(112, 8), view(120, 16), view(136, png.len())];
    let accessor = |view: usize, offset: usize, component: usize, kind: &str, count: usize| {
        format!(
            r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{component},"type":"{kind}","count":{count}}}"#
        )
    };
    let accessors = [
        accessor(0, 0, 5126, "VEC3", 4),
        accessor(3, 0, 5121, "SCALAR", 6),
        accessor(0, 0, 5126, "VEC2", 4),
        accessor(3, 0, 5121, "VEC4", 4),
        accessor(1, 0, 5126, "MAT4", 1),
        accessor(2, 0, 5126, "SCALAR", 2),
        accessor(0, 0, 5126, "VEC3", 2),
        accessor(1, 0, 5126, "VEC4", 2),
        accessor(3, 0, 5120, "VEC3", 4),
        r#"{"componentType":5126,"type":"VEC3","count":4,"sparse":{"count":1,"indices":{"bufferView":3,"byteOffset":1,"componentType":5121},"values":{"bufferView":0,"byteOffset":12}}}"#.into(),
    ];
    let rest = r#""scene":0,"scenes":[{"nodes":[0,1,3]}],
"nodes":[{"mesh":0,"skin":0,"weights":[0.5]},{"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1],"children":[2],"camera":0},
{"translation":[1,2,3],"rotation":[0,0,0,1],"scale":[1,2,1],"extensions":{"KHR_lights_punctual":{"light":0}}},
{"mesh":1,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":6}}}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":8,"TEXCOORD_0":2,"COLOR_0":3,"JOINTS_0":3,"WEIGHTS_0":3,"TANGENT":3},"indices":1,"material":0,"mode":5,"targets":[{"POSITION":9}]}]},
{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":3},"mode":0},{"attributes":{"POSITION":0},"indices":1,"mode":6}]}],
"skins":[{"joints":[2],"inverseBindMatrices":4}],
"materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}},"alphaMode":"MASK","extensions":{"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_volume":{"thicknessFactor":1},"KHR_materials_ior":{"ior":1.4}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],"images":[{"bufferView":4}],
"cameras":[{"type":"perspective","perspective":{"yfov":1}}],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","spot":{"outerConeAngle":0.5}}]}},
"animations":[{"samplers":[{"input":5,"output":6},{"input":5,"output":7,"interpolation":"STEP"},{"input":5,"output":5}],
"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}},{"sampler":1,"target":{"node":2,"path":"rotation"}},{"sampler":2,"target":{"node":0,"path":"weights"}}]}]"#;
    let json = |buffer: &str| {
        let (accessors, views) = (accessors.join(","), views.join(","));
        let start = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{buffer}],"bufferViews":[{views}],"accessors":[{accessors}],"#
        );
        // The skin has only joint 0, so the joints come from a separate accessor of zeros.
        (start + rest + "}").replace(r#""JOINTS_0":3"#, r#""JOINTS_0":10"#).replace(
            r#"],"scene":0"#,
            r#",{"componentType":5121,"type":"VEC4","count":4}],"scene":0"#,
        )
    };
    let escaped: String = buffer.iter().map(|byte| format!("%{byte:02x}")).collect();
    let length = buffer.len();
    let data = format!(r#"{{"byteLength":{length},"uri":"data:,{escaped}"}}"#);
    fs::write(folder.join("scene.gltf"), json(&data))?;
    let mut json = json(&format!(r#"{{"byteLength":{length}}}"#)).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let header =
        [&b"glTF"[..], &word(2), &word(28 + json.len() + length), &word(json.len()), b"JSON"];
    let glb = [&header.concat()[..], &json, &word(length), b"BIN\0", &buffer].concat();
    surfel_formats::load_gltf_bytes("scene.glb", &glb, &NoProgress)
        .map_err(std::io::Error::other)?;
    fs::write(folder.join("scene.glb"), glb)
}

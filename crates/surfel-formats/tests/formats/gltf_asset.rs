//! Builder of small glTF files from JSON and one buffer.

use serde_json::{Value, json};
use surfel_core::math::{DAffine3, DVec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{Geometry, Graph, Mesh};
use surfel_formats::{Error, FileInfo, load_gltf_bytes};

use crate::common::Listener;

#[derive(Clone)]
pub struct Asset {
    pub json: Value,
    pub buffer: Vec<u8>,
}

/// A component type of accessors.
pub trait Component: Copy {
    const CODE: u32;
    fn put(self, bytes: &mut Vec<u8>);
}

macro_rules! components {
    ($($kind:ident $code:literal),*) => {
        $(impl Component for $kind {
            const CODE: u32 = $code;
            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend(self.to_le_bytes());
            }
        })*
    };
}

components!(i8 5120, u8 5121, i16 5122, u16 5123, u32 5125, f32 5126);

impl Asset {
    pub fn new() -> Self {
        Self { json: json!({"asset": {"version": "2.0"}}), buffer: Vec::new() }
    }

    /// Adds a scene of one node with one mesh of one primitive.
    pub fn with_primitive(mut self, primitive: Value) -> Self {
        let mesh = self.push("meshes", json!({"primitives": [primitive]}));
        let node = self.push("nodes", json!({ "mesh": mesh }));
        self.json["scenes"] = json!([{"nodes": [node]}]);
        self
    }

    /// Appends to a top-level array and returns the index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let root = self.json.as_object_mut().unwrap();
        let list = root.entry(list).or_insert(json!([])).as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a buffer view with these bytes and returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.buffer.len().next_multiple_of(4);
        self.buffer.resize(offset, 0);
        self.buffer.extend(bytes);
        let view = json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()});
        self.push("bufferViews", view)
    }

    /// Adds an accessor of type SCALAR, VEC2 and so on with these numbers and returns its index.
    pub fn numbers<T: Component>(&mut self, kind: &str, numbers: &[T]) -> usize {
        let mut bytes = Vec::new();
        numbers.iter().for_each(|number| number.put(&mut bytes));
        let view = self.view(&bytes);
        let n_components = match kind {
            "SCALAR" => 1,
            "MAT4" => 16,
            _ => kind[3..].parse().unwrap(),
        };
        let accessor = json!({
            "bufferView": view, "componentType": T::CODE, "type": kind,
            "count": numbers.len() / n_components,
        });
        self.push("accessors", accessor)
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.buffer.is_empty() {
            let buffers = json!([{"byteLength": self.buffer.len()}]);
            json.as_object_mut().unwrap().entry("buffers").or_insert(buffers);
        }
        let mut json = json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut buffer = self.buffer.clone();
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        let length = 12 + 8 + json.len() + 8 + buffer.len();
        let word = |n: usize| (n as u32).to_le_bytes();
        let header = [&b"glTF"[..], &word(2), &word(length), &word(json.len()), b"JSON"].concat();
        [&header, &json, &word(buffer.len())[..], b"BIN\0", &buffer].concat()
    }

    pub fn load(&self) -> Result<Loaded, Error> {
        load_bytes("asset.glb", &self.glb())
    }

    /// Loads the asset, which must be valid.
    pub fn graph(&self) -> Graph<PointCloud> {
        self.load().unwrap().graph
    }

    /// Loads the mesh of the only primitive.
    pub fn mesh(&self) -> Mesh {
        match &self.graph().geometries[..] {
            [Geometry::Triangles(mesh)] => mesh.clone(),
            other => panic!("{other:?}"),
        }
    }

    /// Returns the message of the error on loading.
    pub fn message(&self) -> String {
        match self.load() {
            Ok(_) => panic!("reads, but should not: {}", self.json),
            Err(error) => error.to_string(),
        }
    }
}

pub struct Loaded {
    pub graph: Graph<PointCloud>,
    pub info: FileInfo,
    pub notes: Vec<String>,
}

impl Loaded {
    pub fn has_note(&self, words: &str) -> bool {
        self.notes.iter().any(|note| note.contains(words))
    }
}

pub fn load_bytes(name: &str, bytes: &[u8]) -> Result<Loaded, Error> {
    let listener = Listener::default();
    let (graph, info) = load_gltf_bytes(name, bytes, &listener)?;
    graph.validate();
    let notes = listener.notes.into_inner().unwrap();
    Ok(Loaded { graph, info, notes })
}

/// The corners of a square, counter-clockwise.
pub const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0];

/// Returns a triangle with positions only.
pub fn triangle() -> Asset {
    let mut asset = Asset::new();
    let position = asset.numbers("VEC3", &SQUARE[..9]);
    asset.with_primitive(json!({"attributes": {"POSITION": position}}))
}

/// Returns a square, to which `more` can add attributes.
pub fn square(more: impl FnOnce(&mut Asset, &mut Value)) -> Asset {
    let mut asset = Asset::new();
    let position = asset.numbers("VEC3", &SQUARE);
    let indices = asset.numbers("SCALAR", &[0u8, 1, 2, 0, 2, 3]);
    let mut primitive = json!({"attributes": {"POSITION": position}, "indices": indices});
    more(&mut asset, &mut primitive);
    asset.with_primitive(primitive)
}

/// Returns a PNG image of one red texel.
pub fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[255, 0, 0]).unwrap();
    writer.finish().unwrap();
    bytes
}

/// Returns a square with two joints and two morph targets.
pub fn skinned_asset() -> Asset {
    let mut asset = square(|asset, primitive| {
        let joints = [0u8, 1, 0, 200].repeat(4);
        primitive["attributes"]["JOINTS_0"] = asset.numbers("VEC4", &joints).into();
        let weights = [51u8, 204, 0, 0].repeat(4);
        primitive["attributes"]["WEIGHTS_0"] = asset.numbers("VEC4", &weights).into();
        let normals = asset.numbers("VEC3", &[0i8, 0, 1].repeat(4));
        primitive["attributes"]["NORMAL"] = normals.into();
        let up = asset.numbers("VEC3", &[0.0f32, 0.0, 1.0].repeat(4));
        let tilt = asset.numbers("VEC3", &[1i8, 0, 0].repeat(4));
        primitive["targets"] = json!([{"POSITION": up}, {"NORMAL": tilt}]);
    });
    let identity = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
    let columns = identity.to_cols_array().map(|x| x as f32);
    let columns: Vec<f32> = columns
        .as_chunks::<3>()
        .0
        .iter()
        .enumerate()
        .flat_map(|(i, [x, y, z])| [*x, *y, *z, if i == 3 { 1.0 } else { 0.0 }])
        .collect();
    let binds = asset.numbers("MAT4", &columns.repeat(2));
    asset.json["meshes"][0]["weights"] = json!([0.25, 0.5]);
    asset.json["skins"] = json!([{"joints": [2, 1], "inverseBindMatrices": binds}]);
    asset.json["nodes"] =
        json!([{"mesh": 0, "skin": 0}, {}, {"children": [1]}, {"mesh": 0, "weights": [1, 0]}]);
    asset.json["scenes"] = json!([{"nodes": [0, 2, 3]}]);
    asset
}

/// Returns an asset with all kinds of channels and interpolations.
pub fn animated_asset() -> Asset {
    let mut asset = skinned_asset();
    let times = asset.numbers("SCALAR", &[0.0f32, 0.5, 2.0]);
    let positions = asset.numbers("VEC3", &[0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 4.0, 0.0]);
    let turns = asset.numbers("VEC4", &[0i8, 0, 0, 127, 0, 0, 127, 0, 0, 127, 0, 0]);
    let sizes = asset.numbers("VEC3", &[1.0f32; 27]);
    let weights = asset.numbers("SCALAR", &[0u8, 255, 51, 0, 0, 0]);
    asset.json["animations"] = json!([
        {"name": "walk", "samplers": [
            {"input": times, "output": positions, "interpolation": "LINEAR"},
            {"input": times, "output": turns, "interpolation": "STEP"},
            {"input": times, "output": sizes, "interpolation": "CUBICSPLINE"},
            {"input": times, "output": weights},
        ], "channels": [
            {"sampler": 0, "target": {"node": 3, "path": "translation"}},
            {"sampler": 1, "target": {"node": 3, "path": "rotation"}},
            {"sampler": 2, "target": {"node": 3, "path": "scale"}},
            {"sampler": 3, "target": {"node": 3, "path": "weights"}},
            {"sampler": 3, "target": {"path": "pointer"}},
            {"sampler": 3, "target": {"node": 2, "path": "weights"}},
        ]},
        {"name": "run", "samplers": [], "channels": []},
    ]);
    asset
}

/// Returns an asset with every supported feature.
pub fn full_asset() -> Asset {
    let mut asset = animated_asset();
    let view = asset.view(&png());
    asset.push("images", json!({"bufferView": view}));
    asset.push("samplers", json!({"wrapS": 33071}));
    asset.push("textures", json!({"source": 0, "sampler": 0}));
    let texture = json!({"index": 0, "extensions": {"KHR_texture_transform": {"offset": [1, 2]}}});
    let extensions = json!({
        "KHR_materials_ior": {"ior": 1.4},
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 1},
    });
    let base = json!({"baseColorTexture": texture});
    asset.push("materials", json!({"pbrMetallicRoughness": base, "extensions": extensions}));
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    asset.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1}}));
    asset.json["nodes"][1]["camera"] = json!(0);
    let lights = "KHR_lights_punctual";
    asset.json["extensions"] = json!({lights: {"lights": [{"type": "spot", "spot": {}}]}});
    asset.json["nodes"][2]["extensions"] = json!({lights: {"light": 0}});
    let positions = asset.numbers("VEC3", &[0.0f32, 0.0, 0.0, 1.0, 2.0, 3.0]);
    let instancing = json!({"attributes": {"TRANSLATION": positions}});
    let cloud = asset.numbers("VEC3", &SQUARE);
    let primitive = json!({"attributes": {"POSITION": cloud}, "mode": 0});
    let mesh = asset.push("meshes", json!({"primitives": [primitive]}));
    let node = json!({"mesh": mesh, "extensions": {"EXT_mesh_gpu_instancing": instancing}});
    let node = asset.push("nodes", node);
    asset.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(node));
    asset
}

/// Replaces the value at a JSON pointer.
pub fn set(json: &mut Value, pointer: &str, value: Value) {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = json.pointer_mut(parent).unwrap_or_else(|| panic!("no {pointer}"));
    match parent {
        Value::Array(items) => items[key.parse::<usize>().unwrap()] = value,
        parent => parent[key] = value,
    }
}

//! Which extensions are read, and what becomes of files that need others.

use std::collections::BTreeSet;

use super::accessor::Accessor;
use super::document::Document;
use super::json::{Json, shortened};
use crate::error::{Error, Result};

/// Those that are read.
const KNOWN: [&str; 10] = [
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Those that change nothing in a picture.
const HARMLESS: [&str; 3] = ["KHR_materials_variants", "KHR_xmp", "KHR_xmp_json_ld"];

const DRACO: &str = "KHR_draco_mesh_compression";

/// Refuses a file that needs what surfel lacks, and tells what else it uses.
pub(super) fn check(document: &Document) -> Result<()> {
    for required in document.root.list("extensionsRequired")? {
        let name = required.text()?;
        if !KNOWN.contains(&name) && !HARMLESS.contains(&name) {
            return Err(unsupported(&required, name));
        }
    }
    let mut lacking = BTreeSet::new();
    for used in document.root.list("extensionsUsed")? {
        let name = used.text()?;
        if !KNOWN.contains(&name) && !HARMLESS.contains(&name) {
            lacking.insert(name);
        }
    }
    if !lacking.is_empty() {
        let names: Vec<String> = lacking.into_iter().take(20).map(shortened).collect();
        let names = names.join(", ");
        document.note(format!("drawn without {names}, which surfel does not read"));
    }
    Ok(())
}

/// Refuses vertices that an extension was to decode: some files use it without requiring it.
pub(super) fn refuse_compressed(primitive: &Json, position: &Accessor) -> Result<()> {
    match primitive.extension(DRACO) {
        Some(compressed) if position.is_absent() => Err(unsupported(&compressed, DRACO)),
        _ => Ok(()),
    }
}

fn unsupported(json: &Json, name: &str) -> Error {
    let advice = match name {
        DRACO | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "write it without compression: `gltf-transform copy in.glb out.glb`"
        }
        "KHR_texture_basisu" => {
            "write its textures as PNG: `gltf-transform ktxdecompress in.glb out.glb`"
        }
        "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => {
            "write its textures as PNG: `gltf-transform png in.glb out.glb`"
        }
        "KHR_materials_pbrSpecularGlossiness" => {
            "write its materials anew: `gltf-transform metalrough in.glb out.glb`"
        }
        _ => "export it again without this extension",
    };
    Error::Unsupported {
        file: json.file().into(),
        action: "read",
        found: format!("the extension {}, which the file requires", shortened(name)),
        advice,
    }
}

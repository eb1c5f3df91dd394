//! Supported extensions, and errors and warnings for the others.

use std::collections::BTreeSet;

use super::accessor::Accessor;
use super::document::Document;
use super::json::Json;
use crate::error::{Error, Result, shorten};

/// Extensions that are read.
const SUPPORTED: [&str; 10] = [
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

/// Extensions that do not change the image.
const IGNORABLE: [&str; 3] = ["KHR_materials_variants", "KHR_xmp", "KHR_xmp_json_ld"];

const DRACO: &str = "KHR_draco_mesh_compression";

/// Rejects a file that requires an unsupported extension, and warns about the unsupported extensions that it
/// merely uses.
pub(super) fn check(document: &Document) -> Result<()> {
    for required in document.root.array_or_empty("extensionsRequired")? {
        let name = required.string()?;
        if !SUPPORTED.contains(&name) && !IGNORABLE.contains(&name) {
            return Err(unsupported(&required, name));
        }
    }
    let mut unsupported_names = BTreeSet::new();
    for used in document.root.array_or_empty("extensionsUsed")? {
        let name = used.string()?;
        if !SUPPORTED.contains(&name) && !IGNORABLE.contains(&name) {
            unsupported_names.insert(name);
        }
    }
    if !unsupported_names.is_empty() {
        let names: Vec<String> = unsupported_names.into_iter().take(20).map(shorten).collect();
        let names = names.join(", ");
        document.warn(format!("drawn without {names}, which surfel does not read"));
    }
    Ok(())
}

/// Rejects vertices that only Draco decompression could provide. Some files use that extension without
/// requiring it.
pub(super) fn reject_compressed(primitive: &Json, position: &Accessor) -> Result<()> {
    match primitive.extension(DRACO) {
        Some(compressed) if position.has_no_data() => Err(unsupported(&compressed, DRACO)),
        _ => Ok(()),
    }
}

/// Returns the error for an unsupported extension, with advice on how to remove it.
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
            "convert its materials: `gltf-transform metalrough in.glb out.glb`"
        }
        _ => "export it again without this extension",
    };
    Error::Unsupported {
        file: json.file().into(),
        action: "read",
        found: format!("the extension {}, which the file requires", shorten(name)),
        advice,
    }
}

//! Nodes with their meshes, skins, cameras and lights.

use std::f64::consts::{FRAC_PI_2, PI};
use surfel_core::words::counted;

use surfel_core::math::{DAffine3, DQuat, DVec3, Vec3};
use surfel_core::scene::{Joint, Node, Projection, PunctualLight, PunctualLightKind, Transform};

use super::accessor::{Accessor, IntegerPolicy};
use super::document::Document;
use super::hierarchy::{Entry, Hierarchy, ROOT};
use super::instancing;
use super::json::Json;
use super::mesh::MeshCache;
use super::transform;
use crate::error::{Result, shorten};

/// Reads the nodes of the scene below a root called `name`, which rotates +Y to +Z.
pub(super) fn read_all<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    meshes: &mut MeshCache<'_, 'a>,
    name: String,
) -> Result<Vec<Node>> {
    let mut root = Node::new(name);
    let rotation = DQuat::from_rotation_x(FRAC_PI_2);
    root.transform = Transform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
    let mut nodes = vec![root];
    for entry in &hierarchy.entries {
        nodes.push(read(document, hierarchy, meshes, entry)?);
    }
    for (entry_idx, entry) in hierarchy.entries.iter().enumerate() {
        if let Some(instancing) = entry.json.extension("EXT_mesh_gpu_instancing") {
            let parent = ROOT + 1 + entry_idx;
            let instances = instancing::read(document, &instancing, parent, &mut nodes[parent])?;
            nodes.extend(instances);
        }
    }
    Ok(nodes)
}

fn read<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    meshes: &mut MeshCache<'_, 'a>,
    entry: &Entry<'a>,
) -> Result<Node> {
    let json = &entry.json;
    let mut node = Node::new(name(document, json));
    node.parent = Some(entry.parent);
    node.transform = transform::read(json)?;
    node.is_visible = entry.is_visible && entry.is_in_scene;
    if !entry.is_in_scene {
        return Ok(node);
    }
    if let Some(mesh) = json.get("mesh") {
        let weights = json.get("weights");
        (node.primitives, node.morph_weights) = meshes.load(&mesh, weights.as_ref())?;
        if let Some(skin) = json.get("skin") {
            node.joints =
                read_joints(document, hierarchy, &skin, meshes.n_joints_used(&node.primitives))?;
        }
    }
    if let Some(camera) = json.get("camera") {
        node.camera = read_camera(document, &document.resolve("cameras", &camera)?)?;
    }
    const LIGHTS: &str = "KHR_lights_punctual";
    if let Some(reference) = json.extension(LIGHTS).and_then(|light| light.get("light")) {
        let Some(lights) = document.root.extension(LIGHTS) else {
            return Err(
                reference.error("a light", "lights in the extension at the top level of the file")
            );
        };
        node.light = read_lamp(document, &lights.resolve("lights", &reference)?)?;
    }
    Ok(node)
}

/// Returns the name of a node, of its mesh or of its camera, or else its number.
fn name<'a>(document: &Document<'a>, json: &Json<'a>) -> String {
    let name_of = |json: &Json<'a>| json.get("name")?.string().ok();
    let name_of_its = |key: &str, list: &str| {
        let reference = json.get(key)?;
        name_of(&document.resolve(list, &reference).ok()?)
    };
    let number = json.pointer().trim_start_matches("/nodes/");
    let name = name_of(json)
        .or_else(|| name_of_its("mesh", "meshes"))
        .or_else(|| name_of_its("camera", "cameras"));
    name.map_or_else(|| format!("node {number}"), str::to_owned)
}

/// Reads the joints of a skin for meshes that use `n_used` of them.
fn read_joints<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    reference: &Json<'a>,
    n_used: usize,
) -> Result<Vec<Joint>> {
    let skin = document.resolve("skins", reference)?;
    if n_used == 0 {
        document.warn("a skin whose mesh has no joint attributes is skipped");
        return Ok(Vec::new());
    }
    let list = skin.require("joints")?;
    let n_joints = list.array()?.len();
    if n_joints < n_used {
        let found = format!("a skin of {}", counted(n_joints, "joint"));
        return Err(reference.error(found, format!("the {n_used} that its mesh uses")));
    }
    document.reserve(&skin, n_joints, size_of::<Joint>())?;
    let mut binds = Vec::new();
    if let Some(matrices) = skin.get("inverseBindMatrices") {
        let accessor = Accessor::open(document, &matrices)?;
        if accessor.count < n_joints {
            let found = format!("{} matrices for {}", accessor.count, counted(n_joints, "joint"));
            return Err(matrices.error(found, "one per joint"));
        }
        for matrix in accessor.floats::<16>(document, IntegerPolicy::Reject, None)? {
            if !matrix.iter().all(|number| number.is_finite()) {
                return Err(matrices.error("a matrix that is not finite", "finite numbers"));
            }
            let columns = matrix.as_chunks::<4>().0.iter().map(|[x, y, z, _]| [*x, *y, *z]);
            let columns: Vec<f64> = columns.flatten().map(f64::from).collect();
            binds.push(DAffine3::from_cols_slice(&columns));
        }
    }
    let mut joints = Vec::with_capacity(n_joints);
    for (i, joint) in list.array()?.enumerate() {
        let Some(node) = hierarchy.graph_idx(document, &joint)? else {
            return Err(joint.type_error("a node of the scene"));
        };
        let joint_from_mesh = binds.get(i).copied().unwrap_or(DAffine3::IDENTITY);
        joints.push(Joint { node, joint_from_mesh });
    }
    Ok(joints)
}

fn read_camera(document: &Document, camera: &Json) -> Result<Option<Projection>> {
    let kind = camera.require("type")?;
    match kind.string()? {
        "perspective" => {
            let angle = camera.require("perspective")?.require("yfov")?;
            let view_angle = angle.number()?;
            if !(0.0 < view_angle && view_angle < PI) {
                return Err(angle.type_error("an angle above 0 and below pi"));
            }
            Ok(Some(Projection::Perspective { view_angle_deg: view_angle.to_degrees() }))
        }
        "orthographic" => {
            let half = camera.require("orthographic")?.require("ymag")?;
            let height = 2.0 * half.number()?.abs();
            if !(0.0 < height && height.is_finite()) {
                return Err(half.type_error("a height other than 0"));
            }
            Ok(Some(Projection::Orthographic { height }))
        }
        other => {
            document.warn(format!("a camera of type `{}` is skipped", shorten(other)));
            Ok(None)
        }
    }
}

fn read_lamp(document: &Document, light: &Json) -> Result<Option<PunctualLight>> {
    let kind = match light.require("type")?.string()? {
        "directional" => PunctualLightKind::Directional,
        "point" => PunctualLightKind::Point,
        "spot" => read_spot(light)?,
        other => {
            document.warn(format!("a light of type `{}` is skipped", shorten(other)));
            return Ok(None);
        }
    };
    let color = Vec3::from(light.floats_or("color", [1.0; 3])?).max(Vec3::ZERO);
    let intensity = light.float_or("intensity", 1.0)?.max(0.0);
    let range = light.float_or("range", f32::INFINITY)?;
    if range <= 0.0 {
        return Err(light.require("range")?.type_error("a distance above 0"));
    }
    // The limit keeps sums of several lights finite.
    let color = (intensity * color).min(Vec3::splat(1e30));
    Ok(Some(PunctualLight { kind, color, range, radius: 0.0 }))
}

fn read_spot(light: &Json) -> Result<PunctualLightKind> {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let Some(spot) = light.get("spot") else {
        return Ok(PunctualLightKind::Spot { inner_rad: 0.0, outer_rad: FRAC_PI_4 });
    };
    let outer_rad = spot.float_or("outerConeAngle", FRAC_PI_4)?;
    let inner_rad = spot.float_or("innerConeAngle", 0.0)?;
    // Some exporters write angles that are slightly too large, or equal angles.
    if !(0.0 < outer_rad && outer_rad < FRAC_PI_2 + 1e-3 && 0.0 <= inner_rad) {
        let found = format!("cones of {inner_rad} and {outer_rad}");
        return Err(spot.error(found, "0 <= inner < outer <= pi / 2"));
    }
    let outer_rad = outer_rad.min(FRAC_PI_2);
    Ok(PunctualLightKind::Spot { inner_rad: inner_rad.min(outer_rad), outer_rad })
}

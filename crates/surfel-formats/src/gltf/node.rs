//! Nodes: what stands where. Cameras and lamps hang on them.

use std::f64::consts::{FRAC_PI_2, PI};

use surfel::math::{DAffine3, DQuat, DVec3, Vec3};
use surfel::scene::{Joint, Lamp, LampKind, Node, Projection, Transform};

use super::accessor::{Accessor, Meaning};
use super::document::Document;
use super::hierarchy::{Entry, Hierarchy, ROOT};
use super::instancing;
use super::json::{Json, shortened};
use super::mesh::Meshes;
use super::transform;
use crate::error::Result;

/// The nodes of the scene, below one called `name` that turns +Y up to Z up.
pub(super) fn read_all<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    meshes: &mut Meshes<'_, 'a>,
    name: String,
) -> Result<Vec<Node>> {
    let mut root = Node::new(name);
    let rotation = DQuat::from_rotation_x(FRAC_PI_2);
    root.transform = Transform::Parts { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
    let mut nodes = vec![root];
    for entry in &hierarchy.entries {
        nodes.push(read(document, hierarchy, meshes, entry)?);
    }
    for (place, entry) in hierarchy.entries.iter().enumerate() {
        if let Some(instancing) = entry.json.extension("EXT_mesh_gpu_instancing") {
            let parent = ROOT + 1 + place;
            let instances = instancing::read(document, &instancing, parent, &mut nodes[parent])?;
            nodes.extend(instances);
        }
    }
    Ok(nodes)
}

fn read<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    meshes: &mut Meshes<'_, 'a>,
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
        (node.parts, node.morph_weights) = meshes.refer(&mesh, weights.as_ref())?;
        if let Some(skin) = json.get("skin") {
            node.joints = read_joints(document, hierarchy, &skin, meshes.most_joints(&node.parts))?;
        }
    }
    if let Some(camera) = json.get("camera") {
        node.camera = read_camera(document, &document.referred("cameras", &camera)?)?;
    }
    const LIGHTS: &str = "KHR_lights_punctual";
    if let Some(reference) = json.extension(LIGHTS).and_then(|light| light.get("light")) {
        let Some(lights) = document.root.extension(LIGHTS) else {
            return Err(reference.error("a light", "lights in the extension of the whole file"));
        };
        node.lamp = read_lamp(document, &lights.referred("lights", &reference)?)?;
    }
    Ok(node)
}

/// A node's own name, or that of its mesh or camera, or its number.
fn name<'a>(document: &Document<'a>, json: &Json<'a>) -> String {
    let name_of = |json: &Json<'a>| json.get("name")?.text().ok();
    let name_of_its = |key: &str, list: &str| {
        let reference = json.get(key)?;
        name_of(&document.referred(list, &reference).ok()?)
    };
    let number = json.pointer().trim_start_matches("/nodes/");
    let name = name_of(json)
        .or_else(|| name_of_its("mesh", "meshes"))
        .or_else(|| name_of_its("camera", "cameras"));
    name.map_or_else(|| format!("node {number}"), str::to_owned)
}

/// The joints of a skin for meshes that use `n_used` of them; none for what is not bound to joints.
fn read_joints<'a>(
    document: &Document<'a>,
    hierarchy: &Hierarchy<'a>,
    reference: &Json<'a>,
    n_used: usize,
) -> Result<Vec<Joint>> {
    let skin = document.referred("skins", reference)?;
    if n_used == 0 {
        document.note("a skin whose mesh is not bound to joints is left out");
        return Ok(Vec::new());
    }
    let list = skin.need("joints")?;
    let n_joints = list.items()?.len();
    if n_joints < n_used {
        let found = format!("a skin of {n_joints} joints");
        return Err(reference.error(found, format!("the {n_used} that its mesh uses")));
    }
    document.charge(&skin, n_joints, size_of::<Joint>())?;
    let mut binds = Vec::new();
    if let Some(matrices) = skin.get("inverseBindMatrices") {
        let accessor = Accessor::open(document, &matrices)?;
        if accessor.count < n_joints {
            let found = format!("{} matrices for {n_joints} joints", accessor.count);
            return Err(matrices.error(found, "one a joint"));
        }
        for matrix in accessor.floats::<16>(document, Meaning::Float, None)? {
            if !matrix.iter().all(|number| number.is_finite()) {
                return Err(matrices.error("a matrix that is not finite", "finite numbers"));
            }
            let columns = matrix.as_chunks::<4>().0.iter().map(|[x, y, z, _]| [*x, *y, *z]);
            let columns: Vec<f64> = columns.flatten().map(f64::from).collect();
            binds.push(DAffine3::from_cols_slice(&columns));
        }
    }
    let mut joints = Vec::with_capacity(n_joints);
    for (i, joint) in list.items()?.enumerate() {
        let Some(node) = hierarchy.node(document, &joint)? else {
            return Err(joint.unlike("a node of the scene"));
        };
        let joint_from_mesh = binds.get(i).copied().unwrap_or(DAffine3::IDENTITY);
        joints.push(Joint { node, joint_from_mesh });
    }
    Ok(joints)
}

fn read_camera(document: &Document, camera: &Json) -> Result<Option<Projection>> {
    let kind = camera.need("type")?;
    match kind.text()? {
        "perspective" => {
            let angle = camera.need("perspective")?.need("yfov")?;
            let view_angle = angle.number()?;
            if !(0.0 < view_angle && view_angle < PI) {
                return Err(angle.unlike("an angle above 0 and below pi"));
            }
            Ok(Some(Projection::Perspective { view_angle_deg: view_angle.to_degrees() }))
        }
        "orthographic" => {
            let half = camera.need("orthographic")?.need("ymag")?;
            let height = 2.0 * half.number()?.abs();
            if !(0.0 < height && height.is_finite()) {
                return Err(half.unlike("a height other than 0"));
            }
            Ok(Some(Projection::Orthographic { height }))
        }
        other => {
            document.note(format!("a camera of type `{}` is left out", shortened(other)));
            Ok(None)
        }
    }
}

fn read_lamp(document: &Document, light: &Json) -> Result<Option<Lamp>> {
    let kind = match light.need("type")?.text()? {
        "directional" => LampKind::Directional,
        "point" => LampKind::Point,
        "spot" => read_spot(light)?,
        other => {
            document.note(format!("a light of type `{}` is left out", shortened(other)));
            return Ok(None);
        }
    };
    let color = Vec3::from(light.floats_or("color", [1.0; 3])?).max(Vec3::ZERO);
    let intensity = light.float_or("intensity", 1.0)?.max(0.0);
    let range = light.float_or("range", f32::INFINITY)?;
    if range <= 0.0 {
        return Err(light.need("range")?.unlike("a distance above 0"));
    }
    // The largest finite light still adds up with others.
    let color = (intensity * color).min(Vec3::splat(1e30));
    Ok(Some(Lamp { kind, color, range, radius: 0.0 }))
}

fn read_spot(light: &Json) -> Result<LampKind> {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let Some(spot) = light.get("spot") else {
        return Ok(LampKind::Spot { inner_rad: 0.0, outer_rad: FRAC_PI_4 });
    };
    let outer_rad = spot.float_or("outerConeAngle", FRAC_PI_4)?;
    let inner_rad = spot.float_or("innerConeAngle", 0.0)?;
    // Some programs write angles that are a rounding too large, or the same twice.
    if !(0.0 < outer_rad && outer_rad < FRAC_PI_2 + 1e-3 && 0.0 <= inner_rad) {
        let found = format!("cones of {inner_rad} and {outer_rad}");
        return Err(spot.error(found, "0 <= inner < outer <= pi / 2"));
    }
    let outer_rad = outer_rad.min(FRAC_PI_2);
    Ok(LampKind::Spot { inner_rad: inner_rad.min(outer_rad), outer_rad })
}

//! Where nodes stand.

use surfel::math::{DAffine3, DQuat, DVec3};
use surfel::scene::{Animation, Graph, Track, Transform};

use super::document::Document;
use super::hierarchy::Hierarchy;
use super::json::Json;
use crate::error::Result;
use crate::number::numbers;

/// From a node's coordinates to its parent's.
pub(super) fn read(node: &Json) -> Result<Transform> {
    if let Some(json) = node.get("matrix") {
        let matrix: [f64; 16] = json.numbers()?;
        let [_, _, _, a, _, _, _, b, _, _, _, c, _, _, _, d] = matrix;
        if 1e-4 < (DVec3::new(a, b, c).abs().max_element()).max((d - 1.0).abs()) {
            let found = format!("{a}, {b}, {c}, {d} as last row");
            return Err(json.error(found, "0, 0, 0, 1"));
        }
        let columns = matrix.as_chunks::<4>().0.iter().map(|[x, y, z, _]| [*x, *y, *z]);
        let columns: Vec<f64> = columns.flatten().collect();
        return Ok(Transform::Matrix(DAffine3::from_cols_slice(&columns)));
    }
    let vector = |key: &str, default: DVec3| {
        node.get(key).map_or(Ok(default), |json| json.numbers().map(DVec3::from_array))
    };
    let rotation = match node.get("rotation") {
        Some(json) => {
            let numbers: [f64; 4] = json.numbers()?;
            let rotation = rotation(numbers);
            rotation
                .ok_or_else(|| json.error(format!("{numbers:?}"), "a quaternion of length 1"))?
        }
        None => DQuat::IDENTITY,
    };
    Ok(Transform::Parts {
        translation: vector("translation", DVec3::ZERO)?,
        rotation,
        scale: vector("scale", DVec3::ONE)?,
    })
}

/// The rotation that a quaternion stands for, unless it is zero or has no length.
pub(super) fn rotation(numbers: [f64; 4]) -> Option<DQuat> {
    let length = DQuat::from_array(numbers).length();
    // Shorter than this, rounding leaves no direction.
    let is_usual = 1e-6 < length && length < 1e6;
    is_usual.then(|| DQuat::from_array(numbers).normalize())
}

/// Refuses nodes that stand nowhere, and hides those that are scaled to nothing or flat, and stay so: rays
/// cannot be taken into their coordinates.
pub(super) fn check(document: &Document, hierarchy: &Hierarchy, graph: &mut Graph) -> Result<()> {
    let is_scaled = scaled_over_time(graph);
    let mut hidden = Vec::new();
    for (i, world_from_node) in graph.world_from_nodes().into_iter().enumerate() {
        const FAR: f64 = 1e30;
        let largest = world_from_node.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        let is_somewhere = largest < FAR && world_from_node.is_finite();
        // What stands beyond the entries are instances, which belong to their parents.
        let entry = |node: usize| hierarchy.entries.get(node.checked_sub(1)?);
        let entry = entry(i).or_else(|| entry(graph.nodes[i].parent?));
        if let Some(entry) = entry.filter(|_| !is_somewhere) {
            let title = entry.json.title();
            let at = numbers(world_from_node.translation);
            let found = format!("node{title}, which its transform takes to {at} or scales as much");
            return Err(entry.json.error(found, "a place and a size within 1e30"));
        }
        let is_flat = !world_from_node.matrix3.determinant().recip().is_finite();
        let node = &mut graph.nodes[i];
        if is_flat && !is_scaled[i] && node.is_visible {
            if !node.parts.is_empty() {
                hidden.push(node.name.clone());
            }
            node.is_visible = false;
        }
    }
    if let Some(first) = hidden.first() {
        let n = hidden.len();
        document
            .note(format!("not shown, since they are scaled to 0: `{first}`, {n} nodes in all"));
    }
    Ok(())
}

/// Whether each node, or one above it, changes its size.
fn scaled_over_time(graph: &Graph) -> Vec<bool> {
    let Animation { channels } = &graph.animation;
    let mut is_scaled = vec![false; graph.nodes.len()];
    for channel in channels {
        is_scaled[channel.node] |= matches!(channel.track, Track::Scale(_));
    }
    for (i, node) in graph.nodes.iter().enumerate() {
        is_scaled[i] |= node.parent.is_some_and(|parent| is_scaled[parent]);
    }
    is_scaled
}

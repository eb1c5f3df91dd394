//! Transforms of nodes.

use surfel_core::math::{DAffine3, DQuat, DVec3};
use surfel_core::points::PointCloud;
use surfel_core::scene::{Animation, Graph, Track, Transform};
use surfel_core::words::counted;

use super::document::Document;
use super::hierarchy::Hierarchy;
use super::json::Json;
use crate::error::Result;
use crate::number_text::format_vector;

/// Reads the transform from a node's coordinates to its parent's.
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
            unit_quaternion(numbers)
                .ok_or_else(|| json.error(format!("{numbers:?}"), "a quaternion of length 1"))?
        }
        None => DQuat::IDENTITY,
    };
    Ok(Transform::Trs {
        translation: vector("translation", DVec3::ZERO)?,
        rotation,
        scale: vector("scale", DVec3::ONE)?,
    })
}

/// Normalises a quaternion; `None` if its length is zero, not finite or extreme.
pub(super) fn unit_quaternion(numbers: [f64; 4]) -> Option<DQuat> {
    let length = DQuat::from_array(numbers).length();
    // In a shorter quaternion, rounding errors dominate.
    let is_valid = 1e-6 < length && length < 1e6;
    is_valid.then(|| DQuat::from_array(numbers).normalize())
}

/// Rejects world transforms with huge or non-finite components, and hides nodes whose transform is singular
/// at all times: rays cannot be transformed into their coordinates.
pub(super) fn check_all(
    document: &Document,
    hierarchy: &Hierarchy,
    graph: &mut Graph<PointCloud>,
) -> Result<()> {
    let has_animated_scale = nodes_with_animated_scale(graph);
    let mut hidden = Vec::new();
    for (i, world_from_node) in graph.world_from_nodes().into_iter().enumerate() {
        /// Largest magnitude of a component of a world transform.
        const MAX_COMPONENT: f64 = 1e30;
        let largest = world_from_node.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        let is_in_range = largest < MAX_COMPONENT && world_from_node.is_finite();
        // Nodes after the entries are instances, which belong to their parents.
        let entry = |node: usize| hierarchy.entries.get(node.checked_sub(1)?);
        let entry = entry(i).or_else(|| entry(graph.nodes[i].parent?));
        if let Some(entry) = entry.filter(|_| !is_in_range) {
            let title = entry.json.quoted_name();
            let at = format_vector(world_from_node.translation);
            let found =
                format!("node{title}, whose transform moves it to {at} or scales it as much");
            return Err(entry.json.error(found, "a position and a size within 1e30"));
        }
        let is_singular = !world_from_node.matrix3.determinant().recip().is_finite();
        let node = &mut graph.nodes[i];
        if is_singular && !has_animated_scale[i] && node.is_visible {
            if !node.primitives.is_empty() {
                hidden.push(node.name.clone());
            }
            node.is_visible = false;
        }
    }
    if let Some(first) = hidden.first() {
        let n = hidden.len();
        document.warn(format!(
            "not shown because they are scaled to 0: `{first}`, {} in all",
            counted(n, "node")
        ));
    }
    Ok(())
}

/// Returns for each node whether an animation scales it or one of its ancestors.
fn nodes_with_animated_scale(graph: &Graph<PointCloud>) -> Vec<bool> {
    let Animation { channels } = &graph.animation;
    let mut has_animated_scale = vec![false; graph.nodes.len()];
    for channel in channels {
        has_animated_scale[channel.node] |= matches!(channel.track, Track::Scale(_));
    }
    for (i, node) in graph.nodes.iter().enumerate() {
        has_animated_scale[i] |= node.parent.is_some_and(|parent| has_animated_scale[parent]);
    }
    has_animated_scale
}

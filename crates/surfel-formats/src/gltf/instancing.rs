//! EXT_mesh_gpu_instancing: each instance of a mesh becomes a node.

use surfel_core::math::{DQuat, DVec3};
use surfel_core::scene::{Node, Transform};
use surfel_core::words::counted;

use super::accessor::{Accessor, IntegerPolicy};
use super::document::Document;
use super::json::Json;
use super::transform::unit_quaternion;
use crate::error::Result;

/// Returns the instances as children of `node`, which has index `parent` in the graph, and moves its parts to
/// them.
pub(super) fn read<'a>(
    document: &Document<'a>,
    json: &Json<'a>,
    parent: usize,
    node: &mut Node,
) -> Result<Vec<Node>> {
    let attributes = json.require("attributes")?;
    let mut count = None;
    let mut open = |key: &str| -> Result<Option<Accessor<'a>>> {
        let Some(reference) = attributes.get(key) else { return Ok(None) };
        let accessor = Accessor::open(document, &reference)?;
        if count.is_some_and(|count| count != accessor.count) {
            let found = counted(accessor.count, "element");
            return Err(reference.error(found, "as many as the other attributes have"));
        }
        count = Some(accessor.count);
        Ok(Some(accessor))
    };
    let accessors = [open("TRANSLATION")?, open("ROTATION")?, open("SCALE")?];
    let [translations, rotations, scales] = &accessors;
    let vectors = |accessor: &Option<Accessor>| {
        let column = accessor.as_ref().map(|accessor| vectors(document, accessor));
        column.transpose()
    };
    let (translations, scales) = (vectors(translations)?, vectors(scales)?);
    let rotations = rotations.as_ref().map(|accessor| quaternions(document, accessor));
    let rotations = rotations.transpose()?;
    let n = count.unwrap_or(0);
    let parts = std::mem::take(&mut node.primitives);
    let bytes_per_copy = size_of_val(&parts[..]) + size_of_val(&node.morph_weights[..]);
    let bytes_each = size_of::<Node>() + 32 + bytes_per_copy;
    document.reserve(json, n, bytes_each)?;
    let value = |column: &Option<Vec<DVec3>>, i: usize, default: DVec3| {
        column.as_ref().map_or(default, |column| column[i])
    };
    let instances = (0..n).map(|i| Node {
        parent: Some(parent),
        transform: Transform::Trs {
            translation: value(&translations, i, DVec3::ZERO),
            rotation: rotations.as_ref().map_or(DQuat::IDENTITY, |column| column[i]),
            scale: value(&scales, i, DVec3::ONE),
        },
        primitives: parts.clone(),
        is_visible: node.is_visible,
        morph_weights: node.morph_weights.clone(),
        ..Node::new(format!("{} {i}", node.name))
    });
    Ok(instances.collect())
}

fn vectors(document: &Document, accessor: &Accessor) -> Result<Vec<DVec3>> {
    let column = accessor.floats::<3>(document, IntegerPolicy::Reject, None)?;
    let column = column.into_iter().map(|vector| DVec3::from_array(vector.map(f64::from)));
    let column: Vec<DVec3> = column.collect();
    match column.iter().position(|vector| !vector.is_finite()) {
        Some(at) => Err(accessor.json.error(format!("{} at {at}", column[at]), "finite numbers")),
        None => Ok(column),
    }
}

fn quaternions(document: &Document, accessor: &Accessor) -> Result<Vec<DQuat>> {
    let column = accessor.floats::<4>(document, IntegerPolicy::Normalize, None)?;
    let column = column.into_iter().map(|numbers| {
        let error = || accessor.json.error(format!("{numbers:?}"), "quaternions of length 1");
        unit_quaternion(numbers.map(f64::from)).ok_or_else(error)
    });
    column.collect()
}

//! EXT_mesh_gpu_instancing: a mesh at many places, each a node of its own.

use surfel::math::{DQuat, DVec3};
use surfel::scene::{Node, Transform};

use super::accessor::{Accessor, Meaning};
use super::document::Document;
use super::json::Json;
use super::transform::rotation;
use crate::error::Result;

/// Children of `node`, which stands at `parent` in the graph; they show its parts in its place.
pub(super) fn read<'a>(
    document: &Document<'a>,
    json: &Json<'a>,
    parent: usize,
    node: &mut Node,
) -> Result<Vec<Node>> {
    let attributes = json.need("attributes")?;
    let mut count = None;
    let mut open = |key: &str| -> Result<Option<Accessor<'a>>> {
        let Some(reference) = attributes.get(key) else { return Ok(None) };
        let accessor = Accessor::open(document, &reference)?;
        if count.is_some_and(|count| count != accessor.count) {
            let found = format!("{} elements", accessor.count);
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
    let parts = std::mem::take(&mut node.parts);
    let own = size_of_val(&parts[..]) + size_of_val(&node.morph_weights[..]);
    let each = size_of::<Node>() + 32 + own;
    document.charge(json, n, each)?;
    let at = |column: &Option<Vec<DVec3>>, i: usize, default: DVec3| {
        column.as_ref().map_or(default, |column| column[i])
    };
    let instances = (0..n).map(|i| Node {
        parent: Some(parent),
        transform: Transform::Parts {
            translation: at(&translations, i, DVec3::ZERO),
            rotation: rotations.as_ref().map_or(DQuat::IDENTITY, |column| column[i]),
            scale: at(&scales, i, DVec3::ONE),
        },
        parts: parts.clone(),
        is_visible: node.is_visible,
        morph_weights: node.morph_weights.clone(),
        ..Node::new(format!("{} {i}", node.name))
    });
    Ok(instances.collect())
}

fn vectors(document: &Document, accessor: &Accessor) -> Result<Vec<DVec3>> {
    let column = accessor.floats::<3>(document, Meaning::Float, None)?;
    let column = column.into_iter().map(|vector| DVec3::from_array(vector.map(f64::from)));
    let column: Vec<DVec3> = column.collect();
    match column.iter().position(|vector| !vector.is_finite()) {
        Some(at) => Err(accessor.json.error(format!("{} at {at}", column[at]), "finite numbers")),
        None => Ok(column),
    }
}

fn quaternions(document: &Document, accessor: &Accessor) -> Result<Vec<DQuat>> {
    let column = accessor.floats::<4>(document, Meaning::Share, None)?;
    let column = column.into_iter().map(|numbers| {
        let unfit = || accessor.json.error(format!("{numbers:?}"), "quaternions of length 1");
        rotation(numbers.map(f64::from)).ok_or_else(unfit)
    });
    column.collect()
}

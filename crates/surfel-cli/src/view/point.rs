//! What is told about a place that was clicked at.

use super::made::{INDEX, Made};
use crate::assemble::Assembly;
use serde_json::{Value, json};
use surfel::flat::{FlatGeometry, FlatScene};
use surfel::points::{PointCloud, Values};
use surfel::scene::{Geometry, Graph};
use surfel_web::Place;

/// An 8-bit value times this is the same colour with 16 bits.
const WIDEN: u16 = 257;
/// Colours that tell how many bits the file has.
const SAMPLE: usize = 4096;

/// The point or triangle at a place, with all columns of the file that it came from.
///
/// `flat` and `graph` are those of `made`, at the time at which it was looked at.
pub fn describe(
    base: &Assembly,
    made: &Made,
    flat: &FlatScene,
    graph: &Graph,
    place: &Place,
) -> Value {
    let mut told = json!({
        "surface": place.position.to_array(),
        "normal": place.normal.to_array(),
        "distance": place.depth,
        "index": place.id,
        "position": place.position.to_array(),
        "columns": [],
    });
    let Some(instance) = flat.instances.get(place.instance as usize) else { return told };
    told["kind"] = match flat.geometry(instance) {
        FlatGeometry::Cloud(_) => json!("point"),
        FlatGeometry::Mesh(_) => json!("triangle"),
    };
    let node = &graph.nodes[instance.node as usize];
    told["object"] = json!(name(graph, instance.node as usize));
    let part = node.parts.iter().find(|part| part.material == instance.material as usize);
    let Some(geometry) = part.map(|part| part.geometry) else { return told };
    let index = made.indices[geometry].get(place.id as usize);
    let Some((Geometry::Points(points), &index)) = base.graph.geometries.get(geometry).zip(index)
    else {
        return told;
    };
    let (cloud, index) = (&points.cloud, index as usize);
    told["index"] = json!(index);
    // A point that bends is where it was met.
    if cloud.morphs.is_empty() && cloud.skin.is_none() {
        let world = graph.world_from_nodes()[instance.node as usize];
        told["position"] = json!(world.transform_point3(cloud.world_position(index)).to_array());
    }
    told["columns"] = columns(cloud, index).into();
    told
}

/// The nearest name at a node or above it.
fn name(graph: &Graph, node: usize) -> &str {
    let nodes = &graph.nodes;
    let mut above = std::iter::successors(Some(node), |node| nodes[*node].parent);
    let named = above.find(|node| !nodes[*node].name.is_empty());
    named.map_or("", |node| &nodes[node].name)
}

fn columns(cloud: &PointCloud, index: usize) -> Vec<Value> {
    let column = |name: &str, value: Value| json!({ "name": name, "value": value });
    let mut columns = Vec::new();
    if let Some(colors) = &cloud.colors {
        let names = ["red", "green", "blue"];
        let channels = names.into_iter().zip(channels(colors, index));
        columns.extend(channels.map(|(name, channel)| column(name, channel.into())));
    }
    if let Some(intensity) = &cloud.intensity {
        columns.push(column("intensity", shortest(intensity[index])));
    }
    if let Some(classes) = &cloud.classification {
        let class = classes[index];
        columns.push(column("classification", class.into()));
        columns.push(column("class", surfel::image::class_name(class).into()));
    }
    if let Some(normals) = &cloud.normals {
        let names = ["nx", "ny", "nz"].into_iter().zip(normals[index].to_array());
        columns.extend(names.map(|(name, value)| column(name, shortest(value))));
    }
    if let Some(radii) = &cloud.radii {
        columns.push(column("radius", shortest(radii[index])));
    }
    for scalar in cloud.scalars.iter().filter(|scalar| scalar.name != INDEX) {
        let value = match &scalar.values {
            Values::F32(values) => shortest(values[index]),
            values => json!(values.get(index)),
        };
        columns.push(column(&scalar.name, value));
    }
    columns
}

/// With 8 bits where that is all that the file seems to hold: of a large cloud not every point is looked at.
fn channels(colors: &[[u16; 3]], index: usize) -> [u16; 3] {
    let is_narrow = |color: &[u16; 3]| color.iter().all(|channel| channel % WIDEN == 0);
    let mut sample = colors.iter().step_by(colors.len().div_ceil(SAMPLE));
    let color = colors[index];
    if is_narrow(&color) && sample.all(is_narrow) {
        color.map(|channel| channel / WIDEN)
    } else {
        color
    }
}

/// With the digits that tell it from others of its kind, not those of the double that it becomes.
fn shortest(value: f32) -> Value {
    value.to_string().parse::<f64>().map_or(Value::Null, Value::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_have_as_many_bits_as_in_the_file() {
        assert_eq!(channels(&[[131 * 257, 0, 65535], [0; 3]], 0), [131, 0, 255]);
        assert_eq!(channels(&[[131 * 257, 0, 65535], [1, 0, 0]], 0), [131 * 257, 0, 65535]);
        assert_eq!(channels(&[[131 * 257, 0, 65535], [1, 0, 0]], 1), [1, 0, 0]);
    }
}

//! Facts about a picked point, as the page shows them.

use super::coordinates::{coordinates, shortest};
use serde_json::{Value, json};
use surfel::live_view::SceneTrees;
use surfel::resolve::LoadedScene;
use surfel_core::flat::{FlatGeometry, FlatScene};
use surfel_core::math::DAffine3;
use surfel_core::points::{COLOR_8_TO_16, PointCloud, Values, have_8_bits};
use surfel_core::scene::{Geometry, Graph};
use surfel_web::PickedPoint;

/// Returns the picked point or triangle with all columns of its file. `flat` and `graph` are those of `trees` at the
/// time of the picture.
pub fn describe(
    loaded: &LoadedScene,
    trees: &SceneTrees,
    flat: &FlatScene,
    graph: &Graph,
    picked: &PickedPoint,
) -> Value {
    let mut facts = json!({
        "surface": picked.position.to_array(),
        "normal": picked.normal.to_array(),
        "distance": picked.depth,
        "index": picked.primitive_idx,
        "position": picked.position.to_array(),
        "columns": [],
    });
    let Some(instance) = flat.instances.get(picked.instance_idx as usize) else { return facts };
    facts["kind"] = match flat.geometry(instance) {
        FlatGeometry::Cloud(_) => json!("point"),
        FlatGeometry::Mesh(_) => json!("triangle"),
    };
    facts["object"] = json!(name(graph, instance.node_idx as usize));
    let geometry = instance.graph_geometry_idx as usize;
    let index = trees.source_indices[geometry].get(picked.primitive_idx as usize);
    let source = loaded.graph.geometries.get(geometry).zip(index);
    let Some((Geometry::Points(cloud), &index)) = source else { return facts };
    let index = index as usize;
    facts["index"] = json!(index);
    // A deformed point is where it was hit.
    if cloud.morphs.is_empty() && cloud.skin.is_none() {
        let world = graph.world_from_nodes()[instance.node_idx as usize];
        let in_file = coordinates(cloud, index, &loaded.file_info());
        if world == DAffine3::IDENTITY {
            facts["position"] = json!(in_file.map(|coordinate| coordinate.value));
            facts["decimals"] = json!(in_file.map(|coordinate| coordinate.decimals));
        } else {
            let moved = world.transform_point3(cloud.world_position(index));
            facts["position"] = json!(moved.to_array());
        }
    }
    facts["columns"] = columns(cloud, index).into();
    facts
}

/// Returns the nearest name at a node or above it.
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
        columns.push(column("intensity", shortest(intensity[index]).into()));
    }
    if let Some(classes) = &cloud.classification {
        let class = classes[index];
        columns.push(column("classification", class.into()));
        columns.push(column("class", surfel_core::image::class_name(class).into()));
    }
    if let Some(normals) = &cloud.normals {
        let names = ["nx", "ny", "nz"].into_iter().zip(normals[index].to_array());
        columns.extend(names.map(|(name, value)| column(name, shortest(value).into())));
    }
    if let Some(radii) = &cloud.radii {
        columns.push(column("radius", shortest(radii[index]).into()));
    }
    for scalar in &cloud.scalars {
        let value = match &scalar.values {
            Values::F32(values) => json!(shortest(values[index])),
            values => json!(values.get(index)),
        };
        columns.push(column(&scalar.name, value));
    }
    columns
}

/// Returns a colour with 8 bits per channel if these hold all colours of the cloud.
fn channels(colors: &[[u16; 3]], index: usize) -> [u16; 3] {
    let unit = if have_8_bits(colors) { COLOR_8_TO_16 } else { 1 };
    colors[index].map(|channel| channel / unit)
}

#[cfg(test)]
mod tests {
    //! The number of bits of colours.

    use super::*;

    #[test]
    fn colors_have_as_many_bits_as_in_the_file() {
        assert_eq!(channels(&[[131 * 257, 0, 65535], [0; 3]], 0), [131, 0, 255]);
        assert_eq!(channels(&[[131 * 257, 0, 65535], [1, 0, 0]], 0), [131 * 257, 0, 65535]);
        assert_eq!(channels(&[[131 * 257, 0, 65535], [1, 0, 0]], 1), [1, 0, 0]);
    }
}

//! Facts about a picked point, as the page shows them.

use super::coordinates::{coordinates, shortest};
use serde_json::{Value, json};
use surfel::live_view::SceneTrees;
use surfel::resolve::LoadedScene;
use surfel_core::flat::{FlatGeometry, FlatScene, Instance, PointId};
use surfel_core::math::DAffine3;
use surfel_core::points::{COLOR_8_TO_16, PointCloud, Values, have_8_bits};
use surfel_core::scene::{Geometry, Graph};
use surfel_formats::FileInfo;
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
    let Some(index) = source_index(trees, instance, picked.primitive_idx) else { return facts };
    facts["index"] = json!(index);
    let Some(cloud) = source(loaded, instance) else { return facts };
    let world = graph.world_from_nodes()[instance.node_idx as usize];
    if let Some(found) = position(cloud, index, &world, &loaded.file_info()) {
        facts["position"] = json!(found.position);
        if let Some(decimals) = found.decimals {
            facts["decimals"] = json!(decimals);
        }
    }
    facts["columns"] = columns(cloud, index).into();
    facts
}

/// Returns the positions of points as exact as their files have them, in world coordinates; none for deformed ones.
pub fn locate(
    loaded: &LoadedScene,
    trees: &SceneTrees,
    flat: &FlatScene,
    graph: &Graph,
    points: &[PointId],
) -> Vec<Option<[f64; 3]>> {
    let (info, world_from_nodes) = (loaded.file_info(), graph.world_from_nodes());
    let located = points.iter().map(|point| {
        let instance = flat.instances.get(point.instance_idx as usize)?;
        let index = source_index(trees, instance, point.primitive_idx)?;
        let cloud = source(loaded, instance)?;
        let world = &world_from_nodes[instance.node_idx as usize];
        position(cloud, index, world, &info).map(|found| found.position)
    });
    located.collect()
}

/// Returns the index that a point of an instance has in its file; none of a triangle.
fn source_index(trees: &SceneTrees, instance: &Instance, primitive_idx: u32) -> Option<usize> {
    let indices = &trees.source_indices[instance.graph_geometry_idx as usize];
    indices.get(primitive_idx as usize).map(|index| *index as usize)
}

/// Returns the cloud of an instance as it was read; none of a sequence, of which one file is in memory at a time.
fn source<'l>(loaded: &'l LoadedScene, instance: &Instance) -> Option<&'l PointCloud> {
    let geometry = instance.graph_geometry_idx as usize;
    match loaded.graph.geometries.get(geometry)? {
        Geometry::Points(cloud) if !loaded.is_of_sequence(geometry) => Some(cloud),
        _ => None,
    }
}

/// The place of a point as exact as its file has it.
struct ExactPosition {
    /// World coordinates.
    position: [f64; 3],
    /// Decimals of the coordinates in the file; none where it is moved.
    decimals: Option<[Option<usize>; 3]>,
}

/// Returns the exact position of a point of a cloud; none for a deformed point, which is where it was hit.
fn position(
    cloud: &PointCloud,
    index: usize,
    world_from_cloud: &DAffine3,
    info: &FileInfo,
) -> Option<ExactPosition> {
    if !cloud.morphs.is_empty() || cloud.skin.is_some() {
        return None;
    }
    if *world_from_cloud != DAffine3::IDENTITY {
        let moved = world_from_cloud.transform_point3(cloud.world_position(index));
        return Some(ExactPosition { position: moved.to_array(), decimals: None });
    }
    let in_file = coordinates(cloud, index, info);
    Some(ExactPosition {
        position: in_file.map(|coordinate| coordinate.value),
        decimals: Some(in_file.map(|coordinate| coordinate.decimals)),
    })
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

//! The looks of what was read: surfaces, colours, hidden parts, materials.

use super::cloud::apply_surface_and_color;
use super::loaded::LoadedScene;
use super::sequence::Sequence;
use super::unlit::unlit_without_lights;
use crate::description::{
    Invalid, LightKind, MaterialChoice, MaterialDescription, ObjectDescription, SceneDescription,
};
use crate::error::Result;
use std::path::Path;
use surfel_core::math::Vec3;
use surfel_core::points::{PointCloud, PreparedCloud};
use surfel_core::progress::Progress;
use surfel_core::scene::{Clip, Geometry, Graph};
use surfel_core::surface::SurfaceKind;

/// Colours prepared clouds, hides what is clipped, and gives everything its material. `raw` is the scene's graph, whose
/// points are not used; `clouds` are in its order.
pub fn finish_graph(
    scene: &LoadedScene,
    raw: Graph<PointCloud>,
    clouds: Vec<PreparedCloud>,
    description: &SceneDescription,
    up: Vec3,
    progress: &dyn Progress,
) -> Result<(Graph, Vec<Sequence>)> {
    let geometries = raw.geometries.iter().enumerate();
    let of_clouds = geometries.filter(|(_, geometry)| matches!(geometry, Geometry::Points(_)));
    let indices: Vec<usize> = of_clouds.map(|(i, _)| i).collect();
    let mut prepared = indices.into_iter().zip(clouds);
    let mut graph = raw.try_map_clouds(|_| {
        let (geometry, cloud) = prepared.next().unwrap_or_default();
        let settings = scene.settings_of(geometry, description);
        apply_surface_and_color(cloud, &settings, up, progress)
            .map_err(|cause| scene.content_error(geometry, description, cause))
    })?;
    scene.up_parts.turn(&mut graph, up);
    for (node, is_visible) in scene.visibility(&graph, description) {
        graph.nodes[node].is_visible = is_visible;
    }
    let mut sequences = scene.sequences_under(description);
    clip(scene, &mut graph, &mut sequences, description)?;
    let shows_color_alone = assign_materials(scene, &mut graph, &mut sequences, description);
    if shows_color_alone {
        let line = "the surface points shows nothing of a material but its colour";
        progress.warning(line, &["surface", "material"]);
    }
    Ok((graph, sequences))
}

/// Hides what the settings cut away, but not everything.
fn clip(
    scene: &LoadedScene,
    graph: &mut Graph,
    sequences: &mut [Sequence],
    description: &SceneDescription,
) -> Result<()> {
    let world_from_geometries = graph.world_from_geometries();
    for sequence in sequences {
        sequence.world_from_file = world_from_geometries[sequence.slots.geometries[0]];
    }
    let clips = (0..scene.n_geometries()).map(|i| scene.settings_of(i, description).surface.clip());
    let clips: Vec<Clip> = clips.collect();
    graph.clip(&clips);
    let with_box = clips.iter().any(|clip| clip.bounds.is_some()).then_some("clip_box");
    let with_plane = clips.iter().any(|clip| clip.plane.is_some()).then_some("clip_plane");
    let keys: Vec<&str> = with_box.into_iter().chain(with_plane).collect();
    if !keys.is_empty() && graph.n_points_and_triangles() == (0, 0) {
        let text =
            "everything is hidden; give coordinates of the file, whose bounds `surfel info` shows";
        return Err(Invalid::at(keys.join(", "), text).into());
    }
    Ok(())
}

/// Returns true if points that are drawn as pixels got a material of which they show the colour alone.
fn assign_materials(
    scene: &LoadedScene,
    graph: &mut Graph,
    sequences: &mut [Sequence],
    description: &SceneDescription,
) -> bool {
    let mut shows_color_alone = false;
    let is_raster: Vec<bool> = graph
        .geometries
        .iter()
        .map(|it| matches!(it, Geometry::Points(cloud) if cloud.surface == SurfaceKind::Points))
        .collect();
    let of_files = scene.files.iter().map(|(file, nodes)| {
        (nodes, material_of_file(description, file).map(|choice| &choice.material))
    });
    let of_objects = scene.objects.iter().zip(&description.objects);
    let of_objects =
        of_objects.map(|(nodes, object)| (&nodes.all, material_of_object(description, object)));
    for (nodes, material) in of_files.chain(of_objects) {
        let Some(material) = material else { continue };
        let material_idx = graph.materials.len();
        graph.materials.push(material.material());
        let is_plain = ["matte", "unlit"].contains(&material.kind().as_str());
        for primitive in graph.nodes[nodes.clone()].iter_mut().flat_map(|node| &mut node.primitives)
        {
            primitive.material = material_idx;
            shows_color_alone |= !is_plain && is_raster[primitive.geometry];
        }
    }
    let has_lamps = graph.nodes.iter().any(|node| node.light.is_some());
    let light = &description.light;
    let is_lit = !light.has(LightKind::None) || light.environment.is_some();
    let is_dark = !is_lit && !has_lamps;
    if is_dark {
        unlit_without_lights(&mut graph.materials);
    }
    sequences.iter_mut().for_each(|sequence| sequence.bind_nodes(graph, is_dark));
    shows_color_alone
}

/// Returns the material for a file: its own before that for everything, the last one given.
pub fn material_of_file<'d>(
    description: &'d SceneDescription,
    file: &Path,
) -> Option<&'d MaterialChoice> {
    let mut choices = description.materials.choices().iter().rev();
    choices.find(|choice| choice.names(file)).or_else(|| material_of_everything(description))
}

/// Returns the material for an object: one chosen by its name, its own, or that for everything.
pub fn material_of_object<'d>(
    description: &'d SceneDescription,
    object: &'d ObjectDescription,
) -> Option<&'d MaterialDescription> {
    let names = object.names();
    let by_name =
        |name| description.materials.choices().iter().rev().find(|choice| choice.names(name));
    let named = names.iter().find_map(|name| by_name(name.as_path()));
    let chosen =
        named.or_else(|| material_of_everything(description).filter(|_| object.material.is_none()));
    chosen.map(|choice| &choice.material).or(object.material.as_ref())
}

fn material_of_everything(description: &SceneDescription) -> Option<&MaterialChoice> {
    description.materials.choices().iter().rev().find(|choice| choice.target.is_none())
}

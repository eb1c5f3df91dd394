//! Checks of a description against the content of its files: memory, surfaces and columns of colours.

use super::super::check_files::picture_bytes;
use super::super::cloud::can_be_colored;
use super::super::memory::MemoryEstimate;
use super::LoadedScene;
use crate::description::{SceneDescription, nearest_if_any};
use crate::error::{Error, Result};
use surfel_core::points::{STRUCTURE, SURFACE_VARIATION};
use surfel_core::render::check_surfaces;
use surfel_core::scene::Geometry;
use surfel_core::scene::color::ColorSource;
use surfel_core::surface::SurfaceKind;

impl LoadedScene {
    /// Fails if trees and picture need more memory than they may take.
    pub(in crate::resolve) fn check_memory(&self, description: &SceneDescription) -> Result<()> {
        let subsample = description.objects_default.preparation.subsample;
        MemoryEstimate::from_graph(&self.graph, subsample, picture_bytes(description))
            .with_surfaces_of(description)
            .check(description.run.memory_limit)
    }

    /// Checks what the renderer would refuse at a time: points as pixels together with traced surfaces.
    ///
    /// # Errors
    ///
    /// Fails as rendering does.
    pub fn check_surfaces(&self, description: &SceneDescription, time_secs: f64) -> Result<()> {
        let mut graph = self.graph_without_points();
        for (node, is_visible) in self.visibility(&self.graph, description) {
            graph.nodes[node].is_visible = is_visible;
        }
        graph.evaluate_at(time_secs);
        let nodes = graph.nodes.iter().zip(graph.visible_nodes());
        let shown =
            nodes.filter(|(_, is_visible)| *is_visible).flat_map(|(node, _)| &node.primitives);
        let is_raster = |geometry: usize| {
            let surface = self.settings_of(geometry, description).surface.surface();
            let is_cloud = matches!(graph.geometries[geometry], Geometry::Points(_));
            is_cloud && surface == SurfaceKind::Points
        };
        Ok(check_surfaces(shown.map(|primitive| is_raster(primitive.geometry)))?)
    }

    /// Fails before the preparation if no file has the column asked for. The library knows only the columns that were
    /// loaded, which are those asked for.
    pub(crate) fn check_colors(&self, description: &SceneDescription) -> Result<()> {
        for (i, cloud) in self.clouds() {
            let Some(color) = self.settings_of(i, description).color.color else { continue };
            if can_be_colored(cloud, &color) {
                continue;
            }
            let info = self.file_info();
            let columns = colorable_columns(&info.columns);
            let text = if color == ColorSource::Class && columns.contains(&"class") {
                "all classes are zero; choose other colours".to_owned()
            } else {
                format!(
                    "no column {color}{}; there are {}, {SURFACE_VARIATION}, {STRUCTURE}, #RRGGBB, CSS colour names and \
                     what the file has: {}",
                    nearest_if_any(&color.to_string(), columns.iter().copied()),
                    ColorSource::names_where(ColorSource::is_computed).join(", "),
                    if columns.is_empty() {
                        "only positions".to_owned()
                    } else {
                        columns.join(", ")
                    },
                )
            };
            let files = self.files_of(i, description).to_vec();
            return Err(Error::MissingColumn { files, key: "color", text });
        }
        Ok(())
    }
}

/// Returns the columns of a file as `color` takes them.
fn colorable_columns(columns: &[String]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for column in columns {
        let name = match column.to_ascii_lowercase().as_str() {
            "x" | "y" | "z" | "nx" | "ny" | "nz" | "normal" | "radius" => continue,
            "red" | "green" | "blue" | "r" | "g" | "b" | "rgb" => "rgb",
            "classification" => "class",
            _ => column,
        };
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

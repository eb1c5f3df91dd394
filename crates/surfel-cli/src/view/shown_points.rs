//! The points that a view shows, with the columns of their files, for download.

use super::temp_download::TempDownload;
use std::sync::Arc;
use surfel::live_view::LiveView;
use surfel_core::points::{PointCloud, merge};
use surfel_core::progress::Progress;
use surfel_core::scene::{Geometry, Graph};
use surfel_formats::{SaveOptions, TempFile};
use surfel_web::{Error, Result, WrittenFile};

/// Formats of downloads.
const FORMATS: [&str; 2] = ["laz", "ply"];

/// Writes the points of a view at a time to a file.
///
/// # Errors
///
/// Fails for other formats, for a view without points, as writing does, and if cancelled.
pub fn write_shown_points(
    view: &LiveView,
    time_secs: f64,
    format: &str,
    progress: &dyn Progress,
) -> Result<Arc<dyn WrittenFile>> {
    if !FORMATS.contains(&format) {
        let text = format!("found the format {format}, expected {}", FORMATS.join(" or "));
        return Err(Error::invalid_request(text));
    }
    if view.loaded.has_sequences() {
        let text = "points of sequences cannot be downloaded; save a file of the sequence instead";
        return Err(Error::invalid_request(text));
    }
    let mut graph = view.trees.graph.clone();
    graph.evaluate_at(time_secs);
    let clouds = shown_clouds(view, &graph);
    if clouds.is_empty() {
        return Err(Error::invalid_request("no points are shown"));
    }
    let (cloud, _) = merge(clouds);
    let options = SaveOptions::from_source(&view.loaded.file_info());
    let name = format!("points.{format}");
    let file =
        TempFile::write(&name, |path| surfel_formats::save(path, &cloud, &options, progress));
    let file = file.map_err(|error| match surfel::Error::from(error) {
        error if error.is_cancelled() => Error::Cancelled,
        // The error names the temporary folder of the server.
        _ => Error::invalid_request("the server cannot write the points to a temporary file"),
    })?;
    Ok(Arc::new(TempDownload { n_items: cloud.len() as u64, file }))
}

/// The shown points of each visible instance of a cloud, in the order of its file.
fn shown_clouds(view: &LiveView, graph: &Graph) -> Vec<PointCloud> {
    let transforms = graph.world_from_nodes();
    let nodes = graph.nodes.iter().zip(transforms).zip(graph.visible_nodes());
    let visible = nodes.filter(|(_, is_visible)| *is_visible);
    let instances = visible.flat_map(|((node, world_from_node), _)| {
        node.primitives.iter().map(move |part| (part.geometry, world_from_node))
    });
    let clouds = instances.filter_map(|(geometry, world_from_cloud)| {
        let Geometry::Points(source) = &view.loaded.graph.geometries[geometry] else { return None };
        let mut indices = view.trees.source_indices[geometry].clone();
        if indices.is_empty() {
            return None;
        }
        indices.sort_unstable();
        let mut cloud = source.subset(&indices);
        cloud.transform(&world_from_cloud);
        Some(cloud)
    });
    clouds.collect()
}

//! The points that a view shows, with the columns of their files, for download.

use super::temp_download::TempDownload;
use std::sync::Arc;
use surfel::live_view::LiveView;
use surfel_core::math::{DAffine3, DMat3, DVec3};
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
        move_by(&mut cloud, &world_from_cloud);
        Some(cloud)
    });
    clouds.collect()
}

/// Moves a cloud to world coordinates.
fn move_by(cloud: &mut PointCloud, world_from_cloud: &DAffine3) {
    if *world_from_cloud == DAffine3::IDENTITY {
        return;
    }
    let linear = world_from_cloud.matrix3;
    cloud.origin = world_from_cloud.transform_point3(cloud.origin);
    for position in &mut cloud.positions {
        *position = (linear * position.as_dvec3()).as_vec3();
    }
    let of_normals: DMat3 = linear.inverse().transpose();
    for normal in cloud.normals.iter_mut().flatten() {
        *normal = (of_normals * normal.as_dvec3()).normalize_or_zero().as_vec3();
    }
    // As instances scale the radii of hits.
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    let max_scale = lengths.into_iter().fold(0.0, f64::max) as f32;
    for radius in cloud.radii.iter_mut().flatten() {
        *radius *= max_scale;
    }
}

#[cfg(test)]
mod tests {
    //! Points at other places.

    use super::*;
    use surfel_core::math::Vec3;

    #[test]
    fn points_are_moved_with_their_normals() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::new(1.0, 2.0, 3.0)]);
        cloud.origin = DVec3::new(500_000.0, 0.0, 0.0);
        cloud.normals = Some(vec![Vec3::new(0.6, 0.0, 0.8)]);
        let moved = DAffine3::from_translation(DVec3::new(0.0, 7.0, 0.0))
            * DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0));
        move_by(&mut cloud, &moved);
        assert_eq!(cloud.world_position(0), DVec3::new(500_001.0, 9.0, 6.0));
        let normal = cloud.normals.unwrap()[0];
        assert!((normal - Vec3::new(0.6, 0.0, 0.4).normalize()).length() < 1e-6, "{normal}");
    }

    #[test]
    fn radii_grow_by_the_largest_scale() {
        let mut cloud = PointCloud::from_positions(vec![Vec3::X, Vec3::Y]);
        cloud.radii = Some(vec![0.25, 1.0]);
        let scale = DAffine3::from_scale(DVec3::new(1.0, 4.0, -2.0));
        move_by(&mut cloud, &(DAffine3::from_rotation_z(0.5) * scale));
        let radii = cloud.radii.unwrap();
        assert!((radii[0] - 1.0).abs() < 1e-6 && (radii[1] - 4.0).abs() < 1e-6, "{radii:?}");
    }
}

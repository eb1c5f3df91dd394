//! Filters the points of a scene and drops columns that are not wanted.

use surfel_core::points::{PointCloud, PointFilter};
use surfel_core::progress::Progress;
use surfel_core::scene::{Geometry, Graph, Primitive};

use super::point_cloud::{in_world, reserve};
use crate::error::Result;
use crate::file::Input;
use crate::options::{FileInfo, LoadOptions};
use crate::table::note_kept;

/// The points of a geometry that a node shows.
struct Subset {
    /// Index of the geometry before the filter.
    source: usize,
    /// Indices of the points; empty for a mesh.
    kept: Vec<u32>,
}

/// Keeps the points of a scene that the filter of `options` keeps, and the columns that `options` choose.
///
/// The filter sees world coordinates. Nodes that show one geometry share it as long as they show the same points of it.
/// Meshes stay as they are.
///
/// # Errors
///
/// Fails if a cloud lacks a column of the filter, if the points of all nodes do not fit in memory, or if the work is
/// cancelled.
pub(crate) fn filter_points(
    input: &Input,
    (mut graph, mut info): (Graph<PointCloud>, FileInfo),
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<(Graph<PointCloud>, FileInfo)> {
    let has_points = graph.geometries.iter().any(|part| matches!(part, Geometry::Points(_)));
    if let Some(filter) = options.filter.as_ref().filter(|_| has_points) {
        apply(input, &mut graph, filter, progress)?;
        let (n_points, _) = graph.n_points_and_triangles();
        info.n_points = Some(n_points as u64);
    }
    for geometry in &mut graph.geometries {
        let Geometry::Points(cloud) = geometry else { continue };
        options.columns.drop_others(cloud);
        if cloud.normals.is_none() {
            cloud.morphs.iter_mut().for_each(|morph| morph.normals = None);
        }
    }
    Ok((graph, info))
}

/// Replaces the clouds of each node by the points that the filter keeps. Nodes no longer show a cloud of which it keeps
/// nothing, except for one if nothing at all is left: an empty cloud, as the filter leaves of files with one cloud.
fn apply(
    input: &Input,
    graph: &mut Graph<PointCloud>,
    filter: &PointFilter,
    progress: &dyn Progress,
) -> Result<()> {
    let n_shown = graph.nodes.iter().flat_map(|node| &node.primitives).map(|part| {
        let geometry = &graph.geometries[part.geometry];
        if let Geometry::Points(cloud) = geometry { cloud.len() as u64 } else { 0 }
    });
    let n_shown = n_shown.fold(0, u64::saturating_add);
    // In the worst case each node shows other points.
    reserve::<[u32; 9]>(input, n_shown)?;
    let world = graph.world_from_nodes();
    let sources = std::mem::take(&mut graph.geometries);
    // The geometries after the filter, and which of them come from each geometry before.
    let mut subsets: Vec<Subset> = Vec::new();
    let mut subsets_of_source = vec![Vec::<usize>::new(); sources.len()];
    let mut n_kept = 0;
    let mut first_dropped = None;
    for (node_idx, (node, world)) in graph.nodes.iter_mut().zip(&world).enumerate() {
        let mut primitives = Vec::new();
        for Primitive { geometry: source, material } in std::mem::take(&mut node.primitives) {
            progress.check()?;
            let kept: Vec<u32> = match &sources[source] {
                Geometry::Triangles(_) => Vec::new(),
                geometry @ Geometry::Points(_) => {
                    let matches = filter.matches(&in_world(geometry, world), 0)?;
                    (0..matches.len() as u32).filter(|i| matches[*i as usize]).collect()
                }
            };
            n_kept += kept.len() as u64;
            if kept.is_empty() && matches!(sources[source], Geometry::Points(_)) {
                first_dropped.get_or_insert((node_idx, source, material));
                continue;
            }
            let known = &mut subsets_of_source[source];
            let same = known.iter().copied().find(|i| subsets[*i].kept == kept);
            let geometry = same.unwrap_or(subsets.len());
            if same.is_none() {
                known.push(geometry);
                subsets.push(Subset { source, kept });
            }
            primitives.push(Primitive { geometry, material });
        }
        node.primitives = primitives;
    }
    if let Some((node_idx, source, material)) = first_dropped.filter(|_| subsets.is_empty()) {
        graph.nodes[node_idx].primitives.push(Primitive { geometry: 0, material });
        subsets.push(Subset { source, kept: Vec::new() });
    }
    let mut sources: Vec<Option<Geometry<PointCloud>>> = sources.into_iter().map(Some).collect();
    for Subset { source, kept } in subsets {
        let geometry = match &sources[source] {
            Some(Geometry::Points(cloud)) => Some(Geometry::Points(cloud.subset(&kept))),
            _ => sources[source].take(),
        };
        graph.geometries.extend(geometry);
    }
    note_kept(input, n_kept, n_shown, filter, progress);
    Ok(())
}

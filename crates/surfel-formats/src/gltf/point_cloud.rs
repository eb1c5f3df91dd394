//! Conversion of a scene to a single point cloud.

use surfel_core::image::encode_srgb;
use surfel_core::math::{DAffine3, DVec3, Vec3, Vec4};
use surfel_core::points::PointCloud;
use surfel_core::scene::{Geometry, Graph};

use crate::error::{Error, Result};
use crate::file::Input;
use crate::options::{FileInfo, Loaded};

/// Merges the points of all visible clouds and the vertices of all visible meshes in world coordinates.
/// Columns that only some of them have are dropped.
///
/// The origin is that of the largest of them if `origin` is absent.
///
/// # Errors
///
/// Fails if the points do not fit in memory. Each node that shows a geometry has its own copy of the points, so a small
/// file may describe any number of them.
pub(crate) fn merge_points(
    input: &Input,
    (graph, info): (Graph<PointCloud>, FileInfo),
    origin: Option<DVec3>,
) -> Result<Loaded> {
    let (world, is_visible) = (graph.world_from_nodes(), graph.visible_nodes());
    let nodes = graph.nodes.iter().zip(&world).zip(&is_visible).filter(|(_, visible)| **visible);
    let instances: Vec<(&Geometry<PointCloud>, &DAffine3)> = nodes
        .flat_map(|((node, world), _)| node.primitives.iter().map(move |part| (part, world)))
        .map(|(part, world)| (&graph.geometries[part.geometry], world))
        .filter(|(geometry, _)| !geometry.positions().is_empty())
        .collect();
    let n_points = instances.iter().map(|(geometry, _)| geometry.positions().len() as u64);
    let n_points = n_points.fold(0, u64::saturating_add);
    let has_normals = instances.iter().all(|(geometry, _)| has_normals(geometry));
    let has_colors = instances.iter().all(|(geometry, _)| has_colors(geometry));
    let mut cloud = PointCloud {
        positions: reserve(input, n_points)?,
        normals: has_normals.then(|| reserve(input, n_points)).transpose()?,
        colors: has_colors.then(|| reserve(input, n_points)).transpose()?,
        ..PointCloud::default()
    };
    // Of equally large geometries the first counts.
    let largest = instances.iter().rev().max_by_key(|(geometry, _)| geometry.positions().len());
    let origin_of_largest =
        || largest.map_or(DVec3::ZERO, |(geometry, world)| in_world(geometry, world).origin);
    cloud.origin = origin.unwrap_or_else(origin_of_largest);
    for (geometry, world) in instances {
        let mut part = in_world(geometry, world);
        if part.origin != cloud.origin {
            part.rebase(cloud.origin);
        }
        cloud.positions.extend(part.positions);
        cloud.normals.iter_mut().for_each(|column| column.extend(part.normals.iter().flatten()));
        cloud.colors.iter_mut().for_each(|column| column.extend(part.colors.iter().flatten()));
    }
    if cloud.is_empty() {
        cloud = PointCloud::default();
    }
    Ok(Loaded { cloud, info: FileInfo { n_points: Some(n_points), ..info } })
}

/// Returns an empty column with memory for `n_points`.
///
/// # Errors
///
/// Fails if there is no such memory, or if the number exceeds the limit of 32-bit indices.
pub(super) fn reserve<T>(input: &Input, n_points: u64) -> Result<Vec<T>> {
    let mut column = Vec::new();
    let fits = u32::try_from(n_points).is_ok_and(|n| column.try_reserve_exact(n as usize).is_ok());
    match fits {
        true => Ok(column),
        false => Err(Error::OutOfMemory { file: input.name.to_string(), n_points }),
    }
}

fn has_normals(geometry: &Geometry<PointCloud>) -> bool {
    match geometry {
        Geometry::Points(cloud) => cloud.normals.is_some(),
        Geometry::Triangles(mesh) => mesh.normals.is_some(),
    }
}

fn has_colors(geometry: &Geometry<PointCloud>) -> bool {
    match geometry {
        Geometry::Points(cloud) => cloud.colors.is_some(),
        Geometry::Triangles(mesh) => mesh.colors.is_some(),
    }
}

/// Encodes a linear colour of glTF as clouds store it.
pub(super) fn encode_color(color: Vec4) -> [u16; 3] {
    let channels = color.truncate().to_array();
    channels.map(|channel| (65535.0 * encode_srgb(channel) + 0.5) as u16)
}

/// Returns the points or vertices of a geometry in world coordinates.
pub(super) fn in_world(geometry: &Geometry<PointCloud>, world: &DAffine3) -> PointCloud {
    let (positions, normals, colors) = match geometry {
        Geometry::Points(cloud) => (&cloud.positions, cloud.normals.as_ref(), cloud.colors.clone()),
        Geometry::Triangles(mesh) => {
            let colors = mesh.colors.as_ref();
            let colors = colors.map(|colors| colors.iter().copied().map(encode_color).collect());
            (&mesh.positions, mesh.normals.as_ref(), colors)
        }
    };
    let world_position = |p: &Vec3| world.transform_point3(geometry.origin() + p.as_dvec3());
    let world_positions: Vec<_> = positions.iter().map(world_position).collect();
    let origin = PointCloud::choose_origin(&world_positions);
    let normal_matrix = world.matrix3.inverse().transpose();
    let world_normal =
        |normal: &Vec3| (normal_matrix * normal.as_dvec3()).normalize_or_zero().as_vec3();
    PointCloud {
        origin,
        positions: world_positions.iter().map(|position| (*position - origin).as_vec3()).collect(),
        normals: normals.map(|normals| normals.iter().map(world_normal).collect()),
        colors,
        ..PointCloud::default()
    }
}

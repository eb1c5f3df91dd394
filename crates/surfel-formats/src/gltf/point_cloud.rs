//! Conversion of a scene to a single point cloud.

use surfel_core::math::{DAffine3, Vec3};
use surfel_core::points::{PointCloud, merge};
use surfel_core::scene::{Geometry, Graph};

use crate::options::{FileInfo, Loaded};

/// Merges the points of all visible clouds and the vertices of all visible meshes in world coordinates.
/// Columns that only some of them have are dropped.
pub(crate) fn merge_points((graph, info): (Graph<PointCloud>, FileInfo)) -> Loaded {
    let (world, is_visible) = (graph.world_from_nodes(), graph.visible_nodes());
    let nodes = graph.nodes.iter().zip(&world).zip(&is_visible).filter(|(_, visible)| **visible);
    let parts =
        nodes.flat_map(|((node, world), _)| node.primitives.iter().map(move |p| (p, world)));
    let clouds = parts.map(|(part, world)| in_world(&graph.geometries[part.geometry], world));
    let (cloud, _) = merge(clouds.collect());
    let n_points = Some(cloud.len() as u64);
    Loaded { cloud, info: FileInfo { n_points, ..info } }
}

/// Returns the points or vertices of a geometry in world coordinates.
fn in_world(geometry: &Geometry<PointCloud>, world: &DAffine3) -> PointCloud {
    let (positions, normals, colors) = match geometry {
        Geometry::Points(cloud) => (&cloud.positions, cloud.normals.as_ref(), cloud.colors.clone()),
        Geometry::Triangles(mesh) => (&mesh.positions, mesh.normals.as_ref(), None),
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

//! The points of a scene as one cloud.

use surfel::math::{DAffine3, Vec3};
use surfel::points::{PointCloud, merge};
use surfel::scene::{Geometry, Graph};

use crate::options::{Loaded, Source};

/// Points of clouds and vertices of meshes, where the nodes that show them put them. Columns that only some
/// have are left out.
pub(crate) fn points_of((graph, source): (Graph, Source)) -> Loaded {
    let (world, is_visible) = (graph.world_from_nodes(), graph.visible_nodes());
    let nodes = graph.nodes.iter().zip(&world).zip(&is_visible).filter(|(_, visible)| **visible);
    let parts = nodes.flat_map(|((node, world), _)| node.parts.iter().map(move |p| (p, world)));
    let clouds = parts.map(|(part, world)| placed(&graph.geometries[part.geometry], world));
    let (cloud, _) = merge(clouds.collect());
    let n_points = Some(cloud.len() as u64);
    Loaded { cloud, source: Source { n_points, ..source } }
}

fn placed(geometry: &Geometry, world: &DAffine3) -> PointCloud {
    let (positions, normals, colors) = match geometry {
        Geometry::Points(points) => {
            (&points.cloud.positions, points.cloud.normals.as_ref(), points.cloud.colors.clone())
        }
        Geometry::Triangles(mesh) => (&mesh.positions, mesh.normals.as_ref(), None),
    };
    let place = |p: &Vec3| world.transform_point3(geometry.origin() + p.as_dvec3());
    let places: Vec<_> = positions.iter().map(place).collect();
    let origin = PointCloud::choose_origin(&places);
    let turn = world.matrix3.inverse().transpose();
    let turned = |normal: &Vec3| (turn * normal.as_dvec3()).normalize_or_zero().as_vec3();
    PointCloud {
        origin,
        positions: places.iter().map(|place| (*place - origin).as_vec3()).collect(),
        normals: normals.map(|normals| normals.iter().map(turned).collect()),
        colors,
        ..PointCloud::default()
    }
}

//! Hiding a part of what there is, to see what lies behind or within.

use super::graph::{Geometry, Graph, Points};
use super::mesh::Mesh;
use crate::math::{DAffine3, DVec3};
use rayon::prelude::*;

/// Which part of the world is kept; the default keeps all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clip {
    pub bounds: Option<ClipBox>,
    pub plane: Option<ClipPlane>,
}

/// Hides what lies outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipBox {
    pub low: DVec3,
    pub high: DVec3,
}

/// Hides what lies on the side to which the normal points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    pub point: DVec3,
    /// Of any length but zero.
    pub normal: DVec3,
}

impl Clip {
    /// Whether what is at this place of the world stays; the box and the plane themselves do.
    pub fn keeps(&self, place: DVec3) -> bool {
        let is_inside =
            |bounds: ClipBox| bounds.low.cmple(place).all() && place.cmple(bounds.high).all();
        let is_behind = |plane: ClipPlane| (place - plane.point).dot(plane.normal) <= 0.0;
        self.bounds.is_none_or(is_inside) && self.plane.is_none_or(is_behind)
    }

    fn keeps_all(&self) -> bool {
        *self == Self::default()
    }
}

impl Points {
    /// Hides points by their centres; all others stay as they are. Returns which stay, if not all do.
    pub fn clip(&mut self, clip: &Clip, world_from_points: &DAffine3) -> Option<Vec<u32>> {
        if clip.keeps_all() {
            return None;
        }
        let cloud = &self.cloud;
        let place = |i: u32| world_from_points.transform_point3(cloud.world_position(i as usize));
        let points = (0..cloud.len() as u32).into_par_iter();
        let kept: Vec<u32> = points.filter(|i| clip.keeps(place(*i))).collect();
        if kept.len() == cloud.len() {
            return None;
        }
        self.cloud = cloud.subset(&kept);
        self.colors = kept.iter().map(|i| self.colors[*i as usize]).collect();
        Some(kept)
    }
}

impl Mesh {
    /// Hides triangles by the middle of their corners, at rest where the mesh bends.
    pub fn clip(&mut self, clip: &Clip, world_from_mesh: &DAffine3) {
        if clip.keeps_all() {
            return;
        }
        let Self { origin, positions, triangles, .. } = self;
        let corner = |vertex: u32| *origin + positions[vertex as usize].as_dvec3();
        triangles.retain(|triangle| {
            let middle = triangle.map(corner).iter().sum::<DVec3>() / 3.0;
            clip.keeps(world_from_mesh.transform_point3(middle))
        });
    }
}

impl Geometry {
    /// Hides a part of it; returns which points stay: none for meshes, and for clouds that are whole.
    pub fn clip(&mut self, clip: &Clip, world_from_geometry: &DAffine3) -> Option<Vec<u32>> {
        match self {
            Self::Points(points) => points.clip(clip, world_from_geometry),
            Self::Triangles(mesh) => {
                mesh.clip(clip, world_from_geometry);
                None
            }
        }
    }
}

impl Graph {
    /// Hides a part of each geometry, by a clip for each. What several nodes show is cut where the first of
    /// them stands, and what moves takes its cut along.
    ///
    /// Returns which points stay of each geometry, as [`Geometry::clip`].
    pub fn clip(&mut self, clips: &[Clip]) -> Vec<Option<Vec<u32>>> {
        let places = self.world_from_geometries();
        let geometries = self.geometries.iter_mut().zip(clips).zip(&places);
        geometries.map(|((geometry, clip), place)| geometry.clip(clip, place)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::points::PointCloud;
    use crate::scene::{Material, Node, Part, Transform};

    fn half_space(point: DVec3, normal: DVec3) -> Clip {
        Clip { plane: Some(ClipPlane { point, normal }), ..Clip::default() }
    }

    fn within(low: DVec3, high: DVec3) -> Clip {
        Clip { bounds: Some(ClipBox { low, high }), ..Clip::default() }
    }

    /// Points at x = 0 to 9, of which each has its number as a radius and in its colour.
    fn row() -> Geometry {
        let positions = (0..10).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        let radii = Some((0..10).map(|i| i as f32).collect());
        let cloud = PointCloud { radii, ..PointCloud::from_positions(positions) };
        let colors = (0..10).map(|i| [i; 3]).collect();
        Geometry::Points(Points { cloud, colors, ..Points::default() })
    }

    fn points(graph: &Graph) -> &Points {
        match &graph.geometries[0] {
            Geometry::Points(points) => points,
            Geometry::Triangles(_) => panic!("points have become triangles"),
        }
    }

    #[test]
    fn box_and_plane_keep_what_lies_on_them() {
        let unit = within(DVec3::ZERO, DVec3::ONE);
        assert!(unit.keeps(DVec3::ZERO) && unit.keeps(DVec3::ONE));
        assert!(!unit.keeps(DVec3::new(0.5, 0.5, 1.001)) && !unit.keeps(DVec3::NAN));
        let below = half_space(DVec3::Z, 5.0 * DVec3::Z);
        assert!(below.keeps(DVec3::Z) && below.keeps(DVec3::NEG_Z) && !below.keeps(2.0 * DVec3::Z));
        let both = Clip { plane: half_space(0.5 * DVec3::X, DVec3::X).plane, ..unit };
        assert!(both.keeps(DVec3::ZERO) && !both.keeps(DVec3::X) && !both.keeps(DVec3::NEG_X));
        assert!(Clip::default().keeps_all() && Clip::default().keeps(DVec3::splat(1e30)));
    }

    #[test]
    fn points_that_stay_keep_all_they_have() {
        let mut graph = Graph::of(row(), Material::MATTE);
        let kept = graph.clip(&[within(DVec3::new(2.0, -1.0, -1.0), DVec3::new(4.5, 1.0, 1.0))]);
        assert_eq!(kept, [Some(vec![2, 3, 4])]);
        let left = points(&graph);
        assert_eq!(left.cloud.radii, Some(vec![2.0, 3.0, 4.0]));
        assert_eq!(left.colors, [[2; 3], [3; 3], [4; 3]]);
        graph.validate();
        assert_eq!(graph.clip(&[half_space(9.0 * DVec3::X, DVec3::X)]), [None]);
        assert_eq!(graph.clip(&[half_space(DVec3::X, DVec3::X)]), [Some(vec![])]);
        assert!(points(&graph).cloud.is_empty());
    }

    #[test]
    fn the_first_place_of_a_geometry_counts() {
        let mut graph = Graph::of(row(), Material::MATTE);
        graph.nodes[0].transform = Transform::translated(500_000.0 * DVec3::X);
        let second = Node { transform: Transform::IDENTITY, ..graph.nodes[0].clone() };
        graph.nodes.push(second);
        let kept = graph.clip(&[half_space(500_002.0 * DVec3::X, DVec3::X)]);
        assert_eq!(kept, [Some(vec![0, 1, 2])]);
    }

    #[test]
    fn coordinates_far_from_zero_are_told_apart() {
        let mut graph = Graph::of(row(), Material::MATTE);
        if let Geometry::Points(points) = &mut graph.geometries[0] {
            points.cloud.origin = DVec3::new(484_800.0, 6_632_800.0, 100.0);
        }
        let clip = half_space(DVec3::new(484_806.999, 0.0, 0.0), DVec3::NEG_X);
        assert_eq!(graph.clip(&[clip]), [Some(vec![7, 8, 9])]);
    }

    #[test]
    fn triangles_go_by_the_middle_of_their_corners() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, 3.0 * Vec3::X].to_vec();
        let triangles = vec![[0, 1, 2], [1, 3, 2]];
        let mesh = Mesh { origin: DVec3::Z, positions, triangles, ..Mesh::default() };
        let mut graph = Graph::of(Geometry::Triangles(mesh), Material::MATTE);
        graph.geometries.push(row());
        graph.nodes[0].parts.push(Part { geometry: 1, material: 0 });
        // The middles are at x = 1/3 and 4/3.
        let kept = graph.clip(&[half_space(DVec3::X, DVec3::X), Clip::default()]);
        assert_eq!(kept, [None, None]);
        let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!("no mesh") };
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }
}

//! Clipping: it hides a part of the geometry, to show what lies behind or inside.

use super::cloud_geometry::CloudGeometry;
use super::graph::{Geometry, Graph};
use super::mesh::Mesh;
use crate::math::{DAffine3, DVec3, Ray};
use rayon::prelude::*;

/// The part of the world that is kept, in world coordinates; the default keeps all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clip {
    /// A box outside of which everything is hidden.
    pub bounds: Option<ClipBox>,
    /// A plane beyond which everything is hidden.
    pub plane: Option<ClipPlane>,
}

/// A box that hides everything outside of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipBox {
    /// Lowest coordinates of the box.
    pub min: DVec3,
    /// Highest coordinates of the box.
    pub max: DVec3,
}

/// A plane that hides everything on the side that its normal points to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    /// A point on the plane.
    pub point: DVec3,
    /// The plane's normal, of any length but zero.
    pub normal: DVec3,
}

impl Clip {
    /// True if a position is kept. Positions on the box and on the plane are.
    pub fn contains(&self, position: DVec3) -> bool {
        let is_inside =
            |bounds: ClipBox| bounds.min.cmple(position).all() && position.cmple(bounds.max).all();
        self.bounds.is_none_or(is_inside) && self.plane.is_none_or(|plane| !plane.hides(position))
    }

    fn is_unbounded(&self) -> bool {
        *self == Self::default()
    }
}

impl ClipPlane {
    /// Returns true if a position is hidden. Positions on the plane are not.
    pub fn hides(&self, position: DVec3) -> bool {
        // NaN is hidden.
        let is_kept = (position - self.point).dot(self.normal) <= 0.0;
        !is_kept
    }

    /// Returns a ray that ends where the plane begins to hide, and begins where it ends. Positions of the ray are
    /// relative to `origin`.
    pub fn limited(&self, ray: Ray, origin: DVec3) -> Ray {
        let normal = self.normal.as_vec3();
        let height = normal.dot(ray.origin - (self.point - origin).as_vec3());
        let rise = normal.dot(ray.direction);
        let crossing = -height / rise;
        if rise < 0.0 {
            Ray { t_min: ray.t_min.max(crossing), ..ray }
        } else if 0.0 < rise {
            Ray { t_max: ray.t_max.min(crossing), ..ray }
        } else if 0.0 < height {
            Ray { t_max: ray.t_min, ..ray }
        } else {
            ray
        }
    }
}

impl CloudGeometry {
    /// Removes the points whose centres are clipped. Returns the indices of the points kept, or `None` if all
    /// are.
    pub fn clip(&mut self, clip: &Clip, world_from_points: &DAffine3) -> Option<Vec<u32>> {
        if clip.is_unbounded() {
            return None;
        }
        let cloud = self.cloud();
        let position =
            |i: u32| world_from_points.transform_point3(cloud.world_position(i as usize));
        let points = (0..cloud.len() as u32).into_par_iter();
        let kept: Vec<u32> = points.filter(|i| clip.contains(position(*i))).collect();
        if kept.len() == cloud.len() {
            return None;
        }
        self.retain(&kept);
        Some(kept)
    }
}

impl Mesh {
    /// Removes the triangles whose centroids are clipped, before any deformation.
    pub fn clip(&mut self, clip: &Clip, world_from_mesh: &DAffine3) {
        if clip.is_unbounded() {
            return;
        }
        let Self { origin, positions, triangles, .. } = self;
        let corner = |vertex: u32| *origin + positions[vertex as usize].as_dvec3();
        triangles.retain(|triangle| {
            let centroid = triangle.map(corner).iter().sum::<DVec3>() / 3.0;
            clip.contains(world_from_mesh.transform_point3(centroid))
        });
    }
}

impl Geometry {
    /// Removes the clipped part. Returns the indices of the points kept, or `None` for a mesh or if all are.
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
    /// Clips each geometry by a clip of its own.
    ///
    /// A geometry with several instances is clipped where the first of them is, and an animated one takes
    /// its cut along. Returns the points kept of each geometry, as [`Geometry::clip`] does.
    pub fn clip(&mut self, clips: &[Clip]) -> Vec<Option<Vec<u32>>> {
        let transforms = self.world_from_geometries();
        let geometries = self.geometries.iter_mut().zip(clips).zip(&transforms);
        geometries.map(|((geometry, clip), world)| geometry.clip(clip, world)).collect()
    }
}

#[cfg(test)]
mod tests {
    //! Clips keep exactly the points and triangles inside of them.

    use super::*;
    use crate::math::Vec3;
    use crate::points::{PointCloud, PreparedCloud};
    use crate::scene::{Material, Node, Primitive, Transform};

    fn half_space(point: DVec3, normal: DVec3) -> Clip {
        Clip { plane: Some(ClipPlane { point, normal }), ..Clip::default() }
    }

    fn within(min: DVec3, max: DVec3) -> Clip {
        Clip { bounds: Some(ClipBox { min, max }), ..Clip::default() }
    }

    /// Points at x = 0 to 9, with their indices as radii and colours.
    fn row() -> Geometry {
        row_at(DVec3::ZERO)
    }

    fn row_at(origin: DVec3) -> Geometry {
        let positions = (0..10).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect();
        let (normals, radii) = (vec![Vec3::Z; 10], (0..10).map(|i| i as f32).collect());
        let cloud = PointCloud {
            origin,
            normals: Some(normals),
            radii: Some(radii),
            ..PointCloud::from_positions(positions)
        };
        let colors = (0..10).map(|i| [i; 3]).collect();
        let cloud = PreparedCloud::new(cloud).unwrap();
        Geometry::Points(CloudGeometry::new(cloud, colors).unwrap())
    }

    fn points(graph: &Graph) -> &CloudGeometry {
        match &graph.geometries[0] {
            Geometry::Points(points) => points,
            Geometry::Triangles(_) => panic!("points have become triangles"),
        }
    }

    #[test]
    fn box_and_plane_keep_what_lies_on_them() {
        let unit = within(DVec3::ZERO, DVec3::ONE);
        assert!(unit.contains(DVec3::ZERO) && unit.contains(DVec3::ONE));
        assert!(!unit.contains(DVec3::new(0.5, 0.5, 1.001)) && !unit.contains(DVec3::NAN));
        let below = half_space(DVec3::Z, 5.0 * DVec3::Z);
        assert!(
            below.contains(DVec3::Z)
                && below.contains(DVec3::NEG_Z)
                && !below.contains(2.0 * DVec3::Z)
        );
        let both = Clip { plane: half_space(0.5 * DVec3::X, DVec3::X).plane, ..unit };
        assert!(
            both.contains(DVec3::ZERO) && !both.contains(DVec3::X) && !both.contains(DVec3::NEG_X)
        );
        assert!(!below.contains(DVec3::NAN));
        assert!(Clip::default().is_unbounded() && Clip::default().contains(DVec3::splat(1e30)));
    }

    #[test]
    fn rays_are_limited_to_what_a_plane_keeps() {
        let plane = ClipPlane { point: DVec3::new(103.0, 0.0, 0.0), normal: 2.0 * DVec3::X };
        let origin = DVec3::new(100.0, 7.0, 0.0);
        let range = |x: f32, direction: Vec3| {
            let Ray { t_min, t_max, .. } =
                plane.limited(Ray::new(Vec3::new(x, 1.0, 0.0), direction), origin);
            (t_min, t_max)
        };
        assert_eq!(range(5.0, Vec3::NEG_X), (2.0, f32::INFINITY));
        assert_eq!(range(1.0, Vec3::X), (0.0, 2.0));
        assert_eq!(range(1.0, Vec3::NEG_X), (0.0, f32::INFINITY));
        assert_eq!(range(1.0, Vec3::Y), (0.0, f32::INFINITY));
        for nothing in [range(5.0, Vec3::Y), range(5.0, Vec3::X)] {
            assert!(nothing.1 <= nothing.0, "{nothing:?}");
        }
    }

    #[test]
    fn kept_points_keep_all_their_columns() {
        let mut graph = Graph::from_geometry(row(), Material::MATTE);
        let kept = graph.clip(&[within(DVec3::new(2.0, -1.0, -1.0), DVec3::new(4.5, 1.0, 1.0))]);
        assert_eq!(kept, [Some(vec![2, 3, 4])]);
        let left = points(&graph);
        assert_eq!(left.cloud().radii(), [2.0, 3.0, 4.0]);
        assert_eq!(left.colors(), [[2; 3], [3; 3], [4; 3]]);
        graph.validate();
        assert_eq!(graph.clip(&[half_space(9.0 * DVec3::X, DVec3::X)]), [None]);
        assert_eq!(graph.clip(&[half_space(DVec3::X, DVec3::X)]), [Some(vec![])]);
        assert!(points(&graph).cloud().is_empty());
    }

    #[test]
    fn a_geometry_is_clipped_at_its_first_instance() {
        let mut graph = Graph::from_geometry(row(), Material::MATTE);
        graph.nodes[0].transform = Transform::from_translation(500_000.0 * DVec3::X);
        let second = Node { transform: Transform::IDENTITY, ..graph.nodes[0].clone() };
        graph.nodes.push(second);
        let kept = graph.clip(&[half_space(500_002.0 * DVec3::X, DVec3::X)]);
        assert_eq!(kept, [Some(vec![0, 1, 2])]);
    }

    #[test]
    fn clipping_is_exact_far_from_zero() {
        let origin = DVec3::new(484_800.0, 6_632_800.0, 100.0);
        let mut graph = Graph::from_geometry(row_at(origin), Material::MATTE);
        let clip = half_space(DVec3::new(484_806.999, 0.0, 0.0), DVec3::NEG_X);
        assert_eq!(graph.clip(&[clip]), [Some(vec![7, 8, 9])]);
    }

    #[test]
    fn triangles_are_clipped_by_their_centroids() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, 3.0 * Vec3::X].to_vec();
        let triangles = vec![[0, 1, 2], [1, 3, 2]];
        let mesh = Mesh { origin: DVec3::Z, positions, triangles, ..Mesh::default() };
        let mut graph = Graph::from_geometry(Geometry::Triangles(mesh), Material::MATTE);
        graph.geometries.push(row());
        graph.nodes[0].primitives.push(Primitive { geometry: 1, material: 0 });
        // The centroids are at x = 1/3 and 4/3.
        let kept = graph.clip(&[half_space(DVec3::X, DVec3::X), Clip::default()]);
        assert_eq!(kept, [None, None]);
        let Geometry::Triangles(mesh) = &graph.geometries[0] else { panic!("no mesh") };
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }
}

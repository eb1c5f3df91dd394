//! Triangle meshes as ground truth for point clouds of the same shape.

use std::path::Path;
use surfel_core::bvh::{self, Bvh, BvhPrimitive, Child, NO_PRIMITIVE};
use surfel_core::math::{Aabb, LANES, Ray, Vec3};
use surfel_core::progress::NoProgress;
use surfel_core::scene::{Geometry, Mesh};
use surfel_formats::{LoadOptions, load_graph};

/// Triangles and a tree over them.
pub struct GroundTruth {
    /// The positions of the vertices.
    pub vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Unit normals of the vertices, interpolated over triangles; without them triangles are flat.
    vertex_normals: Option<Vec<Vec3>>,
    tree: Bvh,
}

/// A hit of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct GroundTruthHit {
    /// The distance along the ray.
    pub distance: f32,
    /// The unit normal of the surface, turned toward the ray's origin.
    pub normal: Vec3,
}

impl GroundTruth {
    /// Reads a file with one mesh.
    ///
    /// # Panics
    ///
    /// Panics if there is no such file or it has no mesh or several.
    pub fn from_file(path: &Path) -> Self {
        let (graph, _) = load_graph(path, &LoadOptions::default(), &NoProgress).unwrap();
        match &graph.geometries[..] {
            [Geometry::Triangles(mesh)] => Self::from_mesh(mesh),
            _ => panic!("{}: not one mesh", path.display()),
        }
    }

    /// Builds the tree over the triangles of a mesh, which are flat whatever its vertex normals.
    pub fn from_mesh(mesh: &Mesh) -> Self {
        Self::new(mesh.positions.clone(), mesh.triangles.clone())
    }

    /// Builds the tree over the triangles of a mesh, whose vertex normals are interpolated.
    pub fn from_smooth_mesh(mesh: &Mesh) -> Self {
        Self { vertex_normals: mesh.normals.clone(), ..Self::from_mesh(mesh) }
    }

    /// Returns the corners of every triangle.
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        self.triangles.iter().map(|triangle| triangle.map(|i| self.vertices[i as usize]))
    }

    /// Returns three indices of vertices for each triangle.
    pub fn triangle_indices(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the bounds of the triangles.
    pub fn bounds(&self) -> Aabb {
        Aabb::of_points(self.triangles().flatten())
    }

    /// Builds the tree over triangles, each three indices of vertices.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|i| vertices[i as usize]);
        let boxes = triangles.iter().map(|triangle| Aabb::of_points(corners(triangle)));
        let boxes: Vec<Aabb> = boxes.collect();
        let primitives = (0u32..).zip(&boxes).map(|(i, bounds)| BvhPrimitive::new(*bounds, i, 0.0));
        let mut tree = bvh::build(primitives.collect(), |_| true, &NoProgress).unwrap();
        bvh::refit_boxes(&mut tree.nodes, |block| {
            let members = tree.blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE);
            members.fold(Aabb::EMPTY, |all, &i| all.union(boxes[i as usize]))
        });
        Self { vertices, triangles, vertex_normals: None, tree }
    }

    /// Returns the nearest hit by a traversal that is slow but short.
    pub fn closest_hit(&self, ray: &Ray) -> Option<GroundTruthHit> {
        let mut nearest: Option<GroundTruthHit> = None;
        let mut open = vec![0u32];
        while let Some(node_idx) = open.pop() {
            let node = &self.tree.nodes[node_idx as usize];
            for lane in 0..LANES {
                let Some(child) = node.child(lane) else { continue };
                let limit = nearest.map_or(f32::INFINITY, |hit| hit.distance);
                if !intersects_box(ray, node.bounds(lane), limit) {
                    continue;
                }
                match child {
                    Child::Node(child) => open.push(child),
                    Child::Block(block) => {
                        for &index in &self.tree.blocks[block as usize] {
                            let hit = (index != NO_PRIMITIVE).then(|| self.intersect(index, ray));
                            let limit = nearest.map_or(f32::INFINITY, |hit| hit.distance);
                            nearest = hit.flatten().filter(|hit| hit.distance < limit).or(nearest);
                        }
                    }
                }
            }
        }
        nearest
    }

    /// Intersects a ray and a triangle by the method of Möller and Trumbore (1997).
    fn intersect(&self, index: u32, ray: &Ray) -> Option<GroundTruthHit> {
        let [a, b, c] = self.triangles[index as usize].map(|i| self.vertices[i as usize]);
        let (ab, ac) = (b - a, c - a);
        let p = ray.direction.cross(ac);
        let determinant = ab.dot(p);
        let from_a = ray.origin - a;
        let u = from_a.dot(p) / determinant;
        let q = from_a.cross(ab);
        let v = ray.direction.dot(q) / determinant;
        let distance = ac.dot(q) / determinant;
        let inside = 0.0 <= u && 0.0 <= v && u + v <= 1.0 && ray.t_min < distance;
        let normal = match &self.vertex_normals {
            Some(normals) => {
                let [a, b, c] = self.triangles[index as usize].map(|i| normals[i as usize]);
                ((1.0 - u - v) * a + u * b + v * c).normalize_or(-ray.direction)
            }
            None => ab.cross(ac).normalize_or(-ray.direction),
        };
        let normal = if 0.0 < normal.dot(ray.direction) { -normal } else { normal };
        inside.then_some(GroundTruthHit { distance, normal })
    }
}

fn intersects_box(ray: &Ray, bounds: Aabb, limit: f32) -> bool {
    let (low, high) =
        ((bounds.min - ray.origin) / ray.direction, (bounds.max - ray.origin) / ray.direction);
    let enter = low.min(high).max_element().max(ray.t_min);
    let leave = low.max(high).min_element().min(limit);
    // The interval is widened by more than any rounding error.
    enter <= leave * (1.0 + 1e-5) + 1e-6
}

//! The whole: geometry once, instances of it, light, camera.

use super::cloud::FlatCloud;
use super::deform::{Bent, Pose, is_deformed};
use super::instance::{Instance, Placement, tree_over};
use super::lamp::FlatLamp;
use super::mesh::FlatMesh;
use crate::bvh::{Bvh, Node};
use crate::error::Result;
use crate::math::{Aabb, DAffine3, DVec3, LANES};
use crate::progress::Progress;
use crate::scene::{Background, Camera, Geometry, Graph, Light, Material, Scene, Texture};
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Clone, Debug)]
pub struct FlatScene {
    /// World coordinates of the zero of everything below.
    pub origin: DVec3,
    /// Shared by the clones of a scene: one geometry in other light costs no memory.
    pub geometries: Vec<Arc<FlatGeometry>>,
    pub instances: Vec<Instance>,
    /// Over the instances; blocks hold their indices.
    pub top: Bvh,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub lights: Vec<Light>,
    pub lamps: Vec<FlatLamp>,
    pub background: Background,
    pub camera: Camera,
    /// Whether light may go through any instance.
    pub is_see_through: bool,
    built: BTreeMap<MadeFrom, Built>,
}

/// What a geometry is made from: that of the graph, and the node that bends it.
type MadeFrom = (usize, Option<usize>);

#[derive(Clone, Debug)]
struct Built {
    /// Index in the scene's geometries.
    geometry: u32,
    /// In which it was last bent.
    pose: Pose,
    /// Of what is bent too far for its first tree, that tree. Each pose starts from it, so that a frame does
    /// not depend on those before: blocks hold points as exactly as their tree lets them, and of surfaces
    /// equally near the first in the tree is seen.
    first: Option<Arc<FlatGeometry>>,
}

#[derive(Clone, Debug)]
pub enum FlatGeometry {
    Cloud(FlatCloud),
    Mesh(FlatMesh),
}

impl FlatGeometry {
    /// Sorts points or triangles into their tree; points have to be prepared.
    pub fn new(geometry: &Geometry, progress: &dyn Progress) -> Result<Self> {
        match geometry {
            Geometry::Points(points) => Ok(Self::Cloud(FlatCloud::new(points, progress)?)),
            Geometry::Triangles(mesh) => Ok(Self::Mesh(FlatMesh::new(mesh, progress)?)),
        }
    }

    /// `geometry` as it is bent.
    fn bent(geometry: &Geometry, bent: Bent, progress: &dyn Progress) -> Result<Self> {
        match geometry {
            Geometry::Points(points) => Ok(Self::Cloud(FlatCloud::bent(points, bent, progress)?)),
            Geometry::Triangles(mesh) => Ok(Self::Mesh(FlatMesh::bent(mesh, bent, progress)?)),
        }
    }

    fn nodes(&self) -> &[Node] {
        match self {
            Self::Cloud(cloud) => &cloud.points.nodes,
            Self::Mesh(mesh) => &mesh.triangles.nodes,
        }
    }

    /// Empty if there is nothing to hit.
    pub fn bounds(&self) -> Aabb {
        let Some(root) = self.nodes().first() else { return Aabb::EMPTY };
        let children = (0..LANES).filter(|&lane| root.child(lane).is_some());
        children.map(|lane| root.bounds(lane)).fold(Aabb::EMPTY, Aabb::union)
    }
}

impl FlatScene {
    /// Sorts the scene's geometry into trees. The result does not depend on the number of threads.
    pub fn new(scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        let world = scene.graph.world_from_nodes();
        let mut flat = Self {
            origin: origin(&scene.graph, &world),
            geometries: Vec::new(),
            instances: Vec::new(),
            top: Bvh::default(),
            materials: scene.graph.materials.clone(),
            textures: scene.graph.textures.clone(),
            lights: scene.lights.clone(),
            lamps: Vec::new(),
            background: scene.background,
            camera: scene.camera,
            is_see_through: false,
            built: BTreeMap::new(),
        };
        flat.add_geometry(&scene.graph, &world, progress)?;
        flat.place(&scene.graph, &world)?;
        Ok(flat)
    }

    /// Builds what nodes show and is not there yet.
    fn add_geometry(
        &mut self,
        graph: &Graph,
        world: &[DAffine3],
        progress: &dyn Progress,
    ) -> Result<()> {
        let shown = graph.nodes.iter().enumerate();
        let shown = shown.flat_map(|(i, node)| node.parts.iter().map(move |part| (i, part)));
        for (node_idx, part) in shown {
            let made_from = made_from(graph, node_idx, part.geometry);
            if self.built.contains_key(&made_from) {
                continue;
            }
            let geometry = &graph.geometries[made_from.0];
            let pose = made_from.1.map(|node| Pose::of(graph, node, world));
            let flat = match &pose {
                Some(pose) => FlatGeometry::bent(geometry, pose.bend(geometry), progress)?,
                None => FlatGeometry::new(geometry, progress)?,
            };
            let (pose, n_built) = (pose.unwrap_or_default(), self.geometries.len());
            self.built.insert(made_from, Built { geometry: n_built as u32, pose, first: None });
            self.geometries.push(Arc::new(flat));
        }
        Ok(())
    }

    /// Follows the graph, of which only nodes may have changed, to where they now are: what bends is
    /// refitted, or built where nothing bent it before, instances and lamps are placed anew, all else stays.
    /// After an error the scene is of no use.
    pub fn update(&mut self, graph: &Graph, progress: &dyn Progress) -> Result<()> {
        let world = graph.world_from_nodes();
        for ((geometry, node), built) in &mut self.built {
            let Some(node) = node else { continue };
            let pose = Pose::of(graph, *node, &world);
            if pose == built.pose {
                continue;
            }
            let flat = &mut self.geometries[built.geometry as usize];
            built.bend(flat, &graph.geometries[*geometry], pose, progress)?;
        }
        self.add_geometry(graph, &world, progress)?;
        self.place(graph, &world)
    }

    /// Puts other points or triangles in place of a geometry of the graph that no node bends; `update` has
    /// to follow.
    pub fn replace(
        &mut self,
        geometry_idx: usize,
        geometry: &Geometry,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Some(built) = self.built.get(&(geometry_idx, None)) else { return Ok(()) };
        let place = &mut self.geometries[built.geometry as usize];
        // Frees its memory before the new one takes as much.
        *place = Arc::new(FlatGeometry::Mesh(FlatMesh::default()));
        *place = Arc::new(FlatGeometry::new(geometry, progress)?);
        Ok(())
    }

    /// Sets instances, the tree over them, and lamps.
    fn place(&mut self, graph: &Graph, world: &[DAffine3]) -> Result<()> {
        let is_visible = graph.visible_nodes();
        self.instances.clear();
        self.lamps.clear();
        let bounds: Vec<Aabb> = self.geometries.iter().map(|geometry| geometry.bounds()).collect();
        for (node_idx, node) in graph.nodes.iter().enumerate().filter(|(i, _)| is_visible[*i]) {
            if let Some(lamp) = &node.lamp {
                self.lamps.extend(FlatLamp::place(lamp, world[node_idx], self.origin));
            }
            for part in &node.parts {
                let made_from = made_from(graph, node_idx, part.geometry);
                let Some(&Built { geometry, .. }) = self.built.get(&made_from) else { continue };
                let object_bounds = bounds[geometry as usize];
                if object_bounds.is_empty() {
                    continue;
                }
                let place = Placement {
                    world_from_object: world[node_idx],
                    object_origin: graph.geometries[part.geometry].origin(),
                    object_bounds,
                    scene_origin: self.origin,
                };
                let is_see_through = self.materials[part.material].is_see_through();
                self.instances.extend(Instance::new(place).map(|instance| Instance {
                    geometry,
                    material: part.material as u32,
                    node: node_idx as u32,
                    is_see_through,
                    ..instance
                }));
            }
        }
        self.is_see_through = self.instances.iter().any(|instance| instance.is_see_through);
        self.top = tree_over(&self.instances)?;
        Ok(())
    }

    pub fn geometry(&self, instance: &Instance) -> &FlatGeometry {
        &self.geometries[instance.geometry as usize]
    }

    /// Whether an instance's own orientation tells its inside from its outside.
    pub fn has_outside(&self, instance_idx: u32) -> bool {
        match self.geometry(&self.instances[instance_idx as usize]) {
            FlatGeometry::Cloud(cloud) => cloud.has_outward_normals,
            FlatGeometry::Mesh(_) => true,
        }
    }

    /// Geometry of clouds, each once.
    pub fn clouds(&self) -> impl Iterator<Item = &FlatCloud> {
        self.geometries.iter().filter_map(|geometry| match &**geometry {
            FlatGeometry::Cloud(cloud) => Some(cloud),
            FlatGeometry::Mesh(_) => None,
        })
    }

    /// Geometry of meshes, each once.
    pub fn meshes(&self) -> impl Iterator<Item = &FlatMesh> {
        self.geometries.iter().filter_map(|geometry| match &**geometry {
            FlatGeometry::Mesh(mesh) => Some(mesh),
            FlatGeometry::Cloud(_) => None,
        })
    }
}

impl Built {
    /// Refits what was built to a pose.
    fn bend(
        &mut self,
        flat: &mut Arc<FlatGeometry>,
        geometry: &Geometry,
        pose: Pose,
        progress: &dyn Progress,
    ) -> Result<()> {
        if let Some(first) = self.first.take() {
            *flat = first;
        }
        let bent = pose.bend(geometry);
        let anew = match (Arc::make_mut(flat), geometry) {
            (FlatGeometry::Mesh(flat), Geometry::Triangles(mesh)) => {
                flat.refit(mesh, bent, progress)?.map(FlatGeometry::Mesh)
            }
            (FlatGeometry::Cloud(flat), Geometry::Points(points)) => {
                flat.refit(points, bent, progress)?.map(FlatGeometry::Cloud)
            }
            _ => None,
        };
        if let Some(anew) = anew {
            self.first = Some(std::mem::replace(flat, Arc::new(anew)));
        }
        self.pose = pose;
        Ok(())
    }
}

/// What a part of a node is made from.
fn made_from(graph: &Graph, node_idx: usize, geometry: usize) -> MadeFrom {
    let bends = is_deformed(&graph.geometries[geometry], &graph.nodes[node_idx]);
    (geometry, bends.then_some(node_idx))
}

/// The first part's own zero where it stands: a single cloud keeps its coordinates bit by bit.
fn origin(graph: &Graph, world: &[DAffine3]) -> DVec3 {
    let first = graph.nodes.iter().zip(world).find_map(|(node, world)| {
        let part = node.parts.first()?;
        Some(world.transform_point3(graph.geometries[part.geometry].origin()))
    });
    first.filter(|origin| origin.is_finite()).unwrap_or(DVec3::ZERO)
}

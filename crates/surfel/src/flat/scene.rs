//! The whole: geometry once, instances of it, light, camera.

use super::cloud::FlatCloud;
use super::deform::{deformed, is_deformed};
use super::instance::{Instance, TopTree};
use super::lamp::FlatLamp;
use super::mesh::FlatMesh;
use crate::bvh::Node;
use crate::error::{Error, Result};
use crate::math::{Aabb, Affine3A, DAffine3, DVec3, LANES, Mat3};
use crate::progress::Progress;
use crate::scene::{Background, Camera, Geometry, Graph, Light, Material, Scene, Texture};

#[derive(Clone, Debug)]
pub struct FlatScene {
    /// World coordinates of the zero of everything below.
    pub origin: DVec3,
    pub geometries: Vec<FlatGeometry>,
    pub instances: Vec<Instance>,
    pub top: TopTree,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub lights: Vec<Light>,
    pub lamps: Vec<FlatLamp>,
    pub background: Background,
    pub camera: Camera,
    /// What each geometry was made from: that of the graph, and the node that bends it.
    sources: Vec<(usize, Option<usize>)>,
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
            Geometry::Points(points) if points.cloud.is_empty() => Err(Error::EmptyCloud),
            Geometry::Points(points) => Ok(Self::Cloud(FlatCloud::new(points, progress)?)),
            Geometry::Triangles(mesh) => Ok(Self::Mesh(FlatMesh::new(mesh, progress)?)),
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
            top: TopTree::default(),
            materials: scene.graph.materials.clone(),
            textures: scene.graph.textures.clone(),
            lights: scene.lights.clone(),
            lamps: Vec::new(),
            background: scene.background,
            camera: scene.camera,
            sources: Vec::new(),
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
        for source in sources(graph) {
            if self.sources.contains(&source) {
                continue;
            }
            let geometry = match (&graph.geometries[source.0], source.1) {
                (Geometry::Triangles(mesh), Some(node)) => {
                    let bent = deformed(mesh, graph, node, world);
                    FlatGeometry::Mesh(FlatMesh::new(&bent, progress)?)
                }
                (geometry, _) => FlatGeometry::new(geometry, progress)?,
            };
            self.geometries.push(geometry);
            self.sources.push(source);
        }
        Ok(())
    }

    /// Follows the graph, of which only nodes may have changed, to where they now are: what bends is
    /// refitted, or built where nothing bent it before, instances and lamps are placed anew, all else stays.
    pub fn update(&mut self, graph: &Graph, progress: &dyn Progress) -> Result<()> {
        let world = graph.world_from_nodes();
        for (geometry, source) in self.geometries.iter_mut().zip(&self.sources) {
            let (FlatGeometry::Mesh(flat), Some(node)) = (geometry, source.1) else { continue };
            if let Geometry::Triangles(mesh) = &graph.geometries[source.0] {
                flat.refit(&deformed(mesh, graph, node, &world), progress)?;
            }
        }
        self.add_geometry(graph, &world, progress)?;
        self.place(graph, &world)
    }

    /// Sets instances, the tree over them, and lamps.
    fn place(&mut self, graph: &Graph, world: &[DAffine3]) -> Result<()> {
        let is_visible = graph.visible_nodes();
        self.instances.clear();
        self.lamps.clear();
        let bounds: Vec<Aabb> = self.geometries.iter().map(FlatGeometry::bounds).collect();
        for (node_idx, node) in graph.nodes.iter().enumerate().filter(|(i, _)| is_visible[*i]) {
            if let Some(lamp) = &node.lamp {
                self.lamps.extend(FlatLamp::place(lamp, world[node_idx], self.origin));
            }
            for part in &node.parts {
                let source = source(graph, node_idx, part.geometry);
                let Some(geometry) = self.sources.iter().position(|known| *known == source) else {
                    continue;
                };
                if bounds[geometry].is_empty() {
                    continue;
                }
                let mut instance = Instance {
                    geometry: geometry as u32,
                    material: part.material as u32,
                    node: node_idx as u32,
                    is_see_through: self.materials[part.material].is_see_through(),
                    ..Instance::NOWHERE
                };
                let origin = graph.geometries[part.geometry].origin();
                if instance.place(world[node_idx], origin, self.origin, bounds[geometry]) {
                    self.instances.push(instance);
                }
            }
        }
        self.top = TopTree::new(&self.instances)?;
        Ok(())
    }

    /// Of all that is there, relative to the origin.
    pub fn bounds(&self) -> Aabb {
        self.instances.iter().fold(Aabb::EMPTY, |all, instance| all.union(instance.bounds))
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
        self.geometries.iter().filter_map(|geometry| match geometry {
            FlatGeometry::Cloud(cloud) => Some(cloud),
            FlatGeometry::Mesh(_) => None,
        })
    }

    /// Geometry of meshes, each once.
    pub fn meshes(&self) -> impl Iterator<Item = &FlatMesh> {
        self.geometries.iter().filter_map(|geometry| match geometry {
            FlatGeometry::Mesh(mesh) => Some(mesh),
            FlatGeometry::Cloud(_) => None,
        })
    }
}

impl Instance {
    const NOWHERE: Self = Self {
        object_from_world: Affine3A::IDENTITY,
        world_from_object: Affine3A::IDENTITY,
        world_from_normal: Mat3::IDENTITY,
        scale: 1.0,
        is_in_place: true,
        bounds: Aabb::EMPTY,
        geometry: 0,
        material: 0,
        node: 0,
        is_see_through: false,
    };
}

/// What a part of a node is made from.
fn source(graph: &Graph, node_idx: usize, geometry: usize) -> (usize, Option<usize>) {
    let node = &graph.nodes[node_idx];
    let bends = match &graph.geometries[geometry] {
        Geometry::Triangles(mesh) => is_deformed(mesh, node),
        Geometry::Points(_) => false,
    };
    (geometry, bends.then_some(node_idx))
}

/// All that nodes show, each once, in the order of the nodes.
fn sources(graph: &Graph) -> Vec<(usize, Option<usize>)> {
    let mut sources = Vec::new();
    for (node_idx, node) in graph.nodes.iter().enumerate() {
        for part in &node.parts {
            let source = source(graph, node_idx, part.geometry);
            if !sources.contains(&source) {
                sources.push(source);
            }
        }
    }
    sources
}

/// The first part's own zero where it stands: a single cloud keeps its coordinates bit by bit.
fn origin(graph: &Graph, world: &[DAffine3]) -> DVec3 {
    let first = graph.nodes.iter().zip(world).find_map(|(node, world)| {
        let part = node.parts.first()?;
        Some(world.transform_point3(graph.geometries[part.geometry].origin()))
    });
    first.filter(|origin| origin.is_finite()).unwrap_or(DVec3::ZERO)
}

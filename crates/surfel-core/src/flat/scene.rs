//! The flat scene: geometries, instances of them, lights and camera.

use super::cloud::{FlatCloud, root_bounds};
use super::deform::{Deformed, Pose, is_deformed};
use super::instance::{Instance, Placement, build_tlas};
use super::mesh::FlatMesh;
use super::punctual_light::FlatPunctualLight;
use crate::bvh::Bvh;
use crate::error::Result;
use crate::math::{Aabb, DAffine3, DVec3};
use crate::progress::Progress;
use crate::scene::{
    Background, Camera, ClipPlane, Geometry, Graph, Light, Material, Scene, Texture,
};
use crate::surface::SurfaceKind;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One instant of a scene as plain arrays.
#[derive(Clone, Debug)]
pub struct FlatScene {
    /// World coordinates of the scene's origin. All positions below are relative to it.
    pub origin: DVec3,
    /// Geometries, shared by the clones of a scene: a clone with other lights costs no memory for them.
    pub geometries: Vec<Arc<FlatGeometry>>,
    /// Instances of the geometries.
    pub instances: Vec<Instance>,
    /// The tree over the instances (top-level acceleration structure). Its blocks hold their indices.
    pub tlas: Bvh,
    /// Materials of the graph.
    pub materials: Vec<Material>,
    /// Textures of the graph.
    pub textures: Vec<Texture>,
    /// Lights that belong to no node.
    pub lights: Vec<Light>,
    /// Punctual lights of nodes.
    pub punctual_lights: Vec<FlatPunctualLight>,
    /// The colour of rays that leave the scene.
    pub background: Background,
    /// The camera.
    pub camera: Camera,
    /// Planes beyond which camera rays see nothing; light and reflections meet what is there.
    pub camera_planes: Vec<ClipPlane>,
    /// True if light can pass through any instance.
    pub is_transmissive: bool,
    /// True if any instance is Gaussians.
    pub has_gaussians: bool,
    built: BTreeMap<GeometryKey, BuiltGeometry>,
}

/// The source of a built geometry: the index of a geometry in the graph, and of the node that deforms it.
type GeometryKey = (usize, Option<usize>);

#[derive(Clone, Debug)]
struct BuiltGeometry {
    /// Index in the scene's geometries.
    geometry_idx: u32,
    /// The pose of the last deformation.
    pose: Pose,
    /// The original BVH, kept when a pose is too far from it to refit. Each pose is refitted from it, so that
    /// frames do not depend on earlier frames: the precision of a block and the order of equally near surfaces
    /// depend on the tree.
    original: Option<Arc<FlatGeometry>>,
}

/// Points or triangles with their tree.
#[derive(Clone, Debug)]
pub enum FlatGeometry {
    /// A point cloud.
    Cloud(FlatCloud),
    /// A triangle mesh.
    Mesh(FlatMesh),
}

impl FlatGeometry {
    /// Sorts points or triangles into their tree.
    ///
    /// # Errors
    ///
    /// Fails if points lack the radii or normals that their surface needs, if there are too many primitives for
    /// 32-bit indices, or if `progress` is cancelled.
    pub fn new(geometry: &Geometry, progress: &dyn Progress) -> Result<Self> {
        match geometry {
            Geometry::Points(points) => Ok(Self::Cloud(FlatCloud::new(points, progress)?)),
            Geometry::Triangles(mesh) => Ok(Self::Mesh(FlatMesh::new(mesh, progress)?)),
        }
    }

    /// Sorts deformed points or triangles into their tree.
    fn deformed(geometry: &Geometry, deformed: Deformed, progress: &dyn Progress) -> Result<Self> {
        match geometry {
            Geometry::Points(points) => {
                Ok(Self::Cloud(FlatCloud::deformed(points, &deformed, progress)?))
            }
            Geometry::Triangles(mesh) => {
                Ok(Self::Mesh(FlatMesh::deformed(mesh, deformed, progress)?))
            }
        }
    }

    /// Returns true for a cloud of Gaussians.
    fn is_gaussian(&self) -> bool {
        matches!(self, Self::Cloud(cloud) if cloud.surface == SurfaceKind::Gaussian)
    }

    /// Returns the bounding box of the geometry, which is empty if no primitive is traceable.
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Cloud(cloud) => cloud.bounds(),
            Self::Mesh(mesh) => root_bounds(&mesh.triangles.nodes),
        }
    }
}

impl FlatScene {
    /// Sorts the scene's geometries into trees. The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// Fails if a geometry cannot be built (see `FlatGeometry::new`), or if `progress` is cancelled.
    pub fn new(scene: &Scene, progress: &dyn Progress) -> Result<Self> {
        Self::with_known(scene, &|_| None, progress)
    }

    /// Sorts the scene's geometries into trees, except those that `known` has by their index in the graph: trees that
    /// were built of an equal geometry, which no node deforms.
    ///
    /// # Errors
    ///
    /// Fails as [`new`](Self::new) does.
    pub fn with_known(
        scene: &Scene,
        known: &dyn Fn(usize) -> Option<Arc<FlatGeometry>>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let world = scene.graph.world_from_nodes();
        let mut flat = Self {
            origin: origin(&scene.graph, &world),
            geometries: Vec::new(),
            instances: Vec::new(),
            tlas: Bvh::default(),
            materials: scene.graph.materials.clone(),
            textures: scene.graph.textures.clone(),
            lights: scene.lights.clone(),
            punctual_lights: Vec::new(),
            background: scene.background,
            camera: scene.camera,
            camera_planes: Vec::new(),
            is_transmissive: false,
            has_gaussians: false,
            built: BTreeMap::new(),
        };
        flat.build_missing_geometries(&scene.graph, &world, known, progress)?;
        flat.update_instances(&scene.graph, &world)?;
        Ok(flat)
    }

    /// Returns the trees of a geometry of the graph, unless nodes deform it or none shows it.
    pub fn undeformed(&self, geometry_idx: usize) -> Option<&Arc<FlatGeometry>> {
        let built = self.built.get(&(geometry_idx, None))?;
        Some(&self.geometries[built.geometry_idx as usize])
    }

    /// Builds the geometries that nodes show and that are neither built yet nor known.
    fn build_missing_geometries(
        &mut self,
        graph: &Graph,
        world: &[DAffine3],
        known: &dyn Fn(usize) -> Option<Arc<FlatGeometry>>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let shown = graph.nodes.iter().enumerate();
        let shown = shown.flat_map(|(i, node)| node.primitives.iter().map(move |part| (i, part)));
        for (node_idx, part) in shown {
            let key = geometry_key(graph, node_idx, part.geometry);
            if self.built.contains_key(&key) {
                continue;
            }
            let geometry = &graph.geometries[key.0];
            let pose = key.1.map(|node_idx| Pose::new(graph, node_idx, world));
            let known = if pose.is_none() { known(key.0) } else { None };
            let flat = match (&pose, known) {
                (_, Some(known)) => known,
                (Some(pose), _) => {
                    Arc::new(FlatGeometry::deformed(geometry, pose.deform(geometry), progress)?)
                }
                (None, _) => Arc::new(FlatGeometry::new(geometry, progress)?),
            };
            let (pose, geometry_idx) = (pose.unwrap_or_default(), self.geometries.len() as u32);
            self.built.insert(key, BuiltGeometry { geometry_idx, pose, original: None });
            self.geometries.push(flat);
        }
        Ok(())
    }

    /// Updates the scene after nodes of the graph have changed: refits deformed geometries, builds those that
    /// are shown or deformed for the first time, and recomputes instances and punctual lights. Nothing else of the
    /// graph may have changed.
    ///
    /// # Errors
    ///
    /// Fails if a geometry cannot be built (see `FlatGeometry::new`), or if `progress` is cancelled. The scene
    /// must not be used after an error.
    pub fn update(&mut self, graph: &Graph, progress: &dyn Progress) -> Result<()> {
        let world = graph.world_from_nodes();
        for ((geometry_idx, node_idx), built) in &mut self.built {
            let Some(node_idx) = node_idx else { continue };
            let pose = Pose::new(graph, *node_idx, &world);
            if pose == built.pose {
                continue;
            }
            let flat = &mut self.geometries[built.geometry_idx as usize];
            built.deform(flat, &graph.geometries[*geometry_idx], pose, progress)?;
        }
        self.build_missing_geometries(graph, &world, &|_| None, progress)?;
        self.update_instances(graph, &world)
    }

    /// Replaces a geometry of the graph that no node deforms. The caller has to call `update` afterwards.
    ///
    /// # Errors
    ///
    /// Fails if the geometry cannot be built (see `FlatGeometry::new`), or if `progress` is cancelled. The scene
    /// must not be used after an error.
    pub fn replace(
        &mut self,
        geometry_idx: usize,
        geometry: &Geometry,
        progress: &dyn Progress,
    ) -> Result<()> {
        let Some(built) = self.built.get(&(geometry_idx, None)) else { return Ok(()) };
        let flat = &mut self.geometries[built.geometry_idx as usize];
        // This frees the memory of the old geometry before the new one allocates as much.
        *flat = Arc::new(FlatGeometry::Mesh(FlatMesh::default()));
        *flat = Arc::new(FlatGeometry::new(geometry, progress)?);
        Ok(())
    }

    /// Recomputes the instances, the tree over them, and the punctual lights.
    fn update_instances(&mut self, graph: &Graph, world: &[DAffine3]) -> Result<()> {
        let is_visible = graph.visible_nodes();
        self.instances.clear();
        self.punctual_lights.clear();
        let bounds: Vec<Aabb> = self.geometries.iter().map(|geometry| geometry.bounds()).collect();
        for (node_idx, node) in graph.nodes.iter().enumerate().filter(|(i, _)| is_visible[*i]) {
            if let Some(light) = &node.light {
                self.punctual_lights.extend(FlatPunctualLight::new(
                    light,
                    world[node_idx],
                    self.origin,
                ));
            }
            for part in &node.primitives {
                let key = geometry_key(graph, node_idx, part.geometry);
                let Some(&BuiltGeometry { geometry_idx, .. }) = self.built.get(&key) else {
                    continue;
                };
                let object_bounds = bounds[geometry_idx as usize];
                if object_bounds.is_empty() {
                    continue;
                }
                let placement = Placement {
                    world_from_object: world[node_idx],
                    object_origin: graph.geometries[part.geometry].origin(),
                    object_bounds,
                    scene_origin: self.origin,
                };
                let is_gaussian = self.geometries[geometry_idx as usize].is_gaussian();
                let is_transmissive =
                    !is_gaussian && self.materials[part.material].is_transmissive();
                self.instances.extend(Instance::new(placement).map(|instance| Instance {
                    geometry_idx,
                    material_idx: part.material as u32,
                    node_idx: node_idx as u32,
                    graph_geometry_idx: part.geometry as u32,
                    is_transmissive,
                    is_gaussian,
                    ..instance
                }));
            }
        }
        self.is_transmissive = self.instances.iter().any(|instance| instance.is_transmissive);
        self.has_gaussians = self.instances.iter().any(|instance| instance.is_gaussian);
        self.tlas = build_tlas(&self.instances)?;
        Ok(())
    }

    /// Returns the geometry of an instance.
    pub fn geometry(&self, instance: &Instance) -> &FlatGeometry {
        &self.geometries[instance.geometry_idx as usize]
    }

    /// Returns true if the normals of an instance point out of its body, so that a back face is seen from inside.
    pub fn has_outward_normals(&self, instance_idx: u32) -> bool {
        match self.geometry(&self.instances[instance_idx as usize]) {
            FlatGeometry::Cloud(cloud) => cloud.has_outward_normals,
            FlatGeometry::Mesh(_) => true,
        }
    }

    /// Returns the geometries that are clouds.
    pub fn clouds(&self) -> impl Iterator<Item = &FlatCloud> {
        self.geometries.iter().filter_map(|geometry| match &**geometry {
            FlatGeometry::Cloud(cloud) => Some(cloud),
            FlatGeometry::Mesh(_) => None,
        })
    }

    /// Returns the geometries that are meshes.
    pub fn meshes(&self) -> impl Iterator<Item = &FlatMesh> {
        self.geometries.iter().filter_map(|geometry| match &**geometry {
            FlatGeometry::Mesh(mesh) => Some(mesh),
            FlatGeometry::Cloud(_) => None,
        })
    }
}

impl BuiltGeometry {
    /// Refits the geometry to a pose, or rebuilds it if the pose is too far from the original.
    fn deform(
        &mut self,
        flat: &mut Arc<FlatGeometry>,
        geometry: &Geometry,
        pose: Pose,
        progress: &dyn Progress,
    ) -> Result<()> {
        if let Some(original) = self.original.take() {
            *flat = original;
        }
        let deformed = pose.deform(geometry);
        let rebuilt = match (Arc::make_mut(flat), geometry) {
            (FlatGeometry::Mesh(flat), Geometry::Triangles(mesh)) => {
                flat.refit(mesh, deformed, progress)?.map(FlatGeometry::Mesh)
            }
            (FlatGeometry::Cloud(flat), Geometry::Points(points)) => {
                flat.refit(points, &deformed, progress)?.map(FlatGeometry::Cloud)
            }
            _ => None,
        };
        if let Some(rebuilt) = rebuilt {
            self.original = Some(std::mem::replace(flat, Arc::new(rebuilt)));
        }
        self.pose = pose;
        Ok(())
    }
}

/// Returns the key of a geometry as a node shows it.
fn geometry_key(graph: &Graph, node_idx: usize, geometry_idx: usize) -> GeometryKey {
    let is_deformed = is_deformed(&graph.geometries[geometry_idx], &graph.nodes[node_idx]);
    (geometry_idx, is_deformed.then_some(node_idx))
}

/// Returns the world position of the first geometry's origin. Relative to it, the coordinates of a single cloud
/// that is not transformed stay unchanged bit by bit.
fn origin(graph: &Graph, world: &[DAffine3]) -> DVec3 {
    let first = graph.nodes.iter().zip(world).find_map(|(node, world)| {
        let part = node.primitives.first()?;
        Some(world.transform_point3(graph.geometries[part.geometry].origin()))
    });
    first.filter(|origin| origin.is_finite()).unwrap_or(DVec3::ZERO)
}

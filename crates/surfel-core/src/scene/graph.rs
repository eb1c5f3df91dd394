//! The scene graph after glTF 2.0: geometries, materials, and nodes with transforms.

use super::animation::{Animation, Channel};
use super::camera::{Camera, Projection};
use super::cloud_geometry::CloudGeometry;
use super::inliers::PART;
use super::light::PunctualLight;
use super::material::Material;
use super::mesh::Mesh;
use super::texture::Texture;
use crate::math::{DAffine3, DQuat, DVec3, Vec3};
use crate::points::{Morph, PointCloud, Scalar, Skin, Values};

/// A scene graph, of one file or of several. Indices refer to the columns of the graph.
///
/// `C` is the type of its clouds: [`PointCloud`] as in files, [`CloudGeometry`] once they are prepared and
/// coloured. Only the latter can be rendered. [`Graph::try_map_clouds`] converts one to the other.
#[derive(Clone, Debug)]
pub struct Graph<C = CloudGeometry> {
    /// Clouds and meshes, which several nodes can share.
    pub geometries: Vec<Geometry<C>>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures of the materials.
    pub textures: Vec<Texture>,
    /// Nodes; parents come before their children.
    pub nodes: Vec<Node>,
    /// Changes of the nodes over time.
    pub animation: Animation,
}

/// A cloud or a mesh.
#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "a scene has few geometries, and their columns lie elsewhere"
)]
pub enum Geometry<C = CloudGeometry> {
    /// A point cloud.
    Points(C),
    /// A triangle mesh.
    Triangles(Mesh),
}

/// A coordinate system in the world or in that of another node, with all that is attached to it.
#[derive(Clone, Debug)]
pub struct Node {
    /// Name of the node in its file; need not be unique.
    pub name: String,
    /// Index of the parent, which is lower than that of this node; `None` for a root.
    pub parent: Option<usize>,
    /// Transform from the node's coordinates to its parent's.
    pub transform: Transform,
    /// Geometries that the node instantiates.
    pub primitives: Vec<Primitive>,
    /// A light at the node.
    pub light: Option<PunctualLight>,
    /// A camera at the node, which looks along -Z, with +Y up.
    pub camera: Option<Projection>,
    /// True if the node is visible; a hidden node hides its descendants, too.
    pub is_visible: bool,
    /// Weights of the morph targets of the node's geometries.
    pub morph_weights: Vec<f32>,
    /// Joints of the node's skinned geometries.
    pub joints: Vec<Joint>,
}

/// A geometry with its material, as instantiated by a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Primitive {
    /// Index of the geometry.
    pub geometry: usize,
    /// Index of the material.
    pub material: usize,
}

/// A node that carries vertices of skinned geometries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Index of the node.
    pub node: usize,
    /// Inverse bind matrix: the transform from the mesh's coordinates to the joint's.
    pub joint_from_mesh: DAffine3,
}

/// A transform from a node's coordinates to its parent's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// A scale, then a rotation, then a translation.
    Trs {
        /// Translation, applied last.
        translation: DVec3,
        /// Rotation (unit quaternion).
        rotation: DQuat,
        /// Scale along the axes, applied first.
        scale: DVec3,
    },
    /// Any affine transform.
    Matrix(DAffine3),
}

impl Transform {
    /// The identity.
    pub const IDENTITY: Self =
        Self::Trs { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// Makes a translation.
    pub const fn from_translation(translation: DVec3) -> Self {
        Self::Trs { translation, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }

    /// Returns the transform as a matrix.
    pub fn matrix(&self) -> DAffine3 {
        match *self {
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

impl Node {
    /// Makes a visible root node with the identity transform and nothing attached.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            parent: None,
            transform: Transform::IDENTITY,
            primitives: Vec::new(),
            light: None,
            camera: None,
            is_visible: true,
            morph_weights: Vec::new(),
            joints: Vec::new(),
        }
    }
}

impl<C: AsRef<PointCloud>> Geometry<C> {
    /// Returns the object coordinates of the origin of its positions.
    pub fn origin(&self) -> DVec3 {
        match self {
            Self::Points(cloud) => cloud.as_ref().origin,
            Self::Triangles(mesh) => mesh.origin,
        }
    }

    /// Returns the positions of points or vertices, relative to the origin.
    pub fn positions(&self) -> &[Vec3] {
        match self {
            Self::Points(cloud) => &cloud.as_ref().positions,
            Self::Triangles(mesh) => &mesh.positions,
        }
    }

    /// Returns the morph targets.
    pub fn morphs(&self) -> &[Morph] {
        match self {
            Self::Points(cloud) => &cloud.as_ref().morphs,
            Self::Triangles(mesh) => &mesh.morphs,
        }
    }

    /// Returns the joints and weights of points or vertices.
    pub fn skin(&self) -> Option<&Skin> {
        match self {
            Self::Points(cloud) => cloud.as_ref().skin.as_ref(),
            Self::Triangles(mesh) => mesh.skin.as_ref(),
        }
    }
}

impl<C> Default for Graph<C> {
    fn default() -> Self {
        Self {
            geometries: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            nodes: Vec::new(),
            animation: Animation::default(),
        }
    }
}

impl Graph {
    /// Frees the clouds and meshes that are never deformed, once the flat scene holds all that is needed.
    pub fn release_static(&mut self) {
        let is_static =
            |geometry: &&mut Geometry| geometry.morphs().is_empty() && geometry.skin().is_none();
        for geometry in self.geometries.iter_mut().filter(is_static) {
            match geometry {
                Geometry::Points(points) => points.clear(),
                Geometry::Triangles(mesh) => {
                    *mesh = Mesh { origin: mesh.origin, ..Mesh::default() };
                }
            }
        }
    }
}

impl<C> Graph<C> {
    /// Replaces each cloud by the result of `map`, in the order of the geometries.
    ///
    /// # Errors
    ///
    /// Fails with the first error of `map`.
    pub fn try_map_clouds<D, E>(
        self,
        mut map: impl FnMut(C) -> Result<D, E>,
    ) -> Result<Graph<D>, E> {
        let geometries = self.geometries.into_iter().map(|geometry| {
            Ok(match geometry {
                Geometry::Points(cloud) => Geometry::Points(map(cloud)?),
                Geometry::Triangles(mesh) => Geometry::Triangles(mesh),
            })
        });
        Ok(Graph {
            geometries: geometries.collect::<Result<_, E>>()?,
            materials: self.materials,
            textures: self.textures,
            nodes: self.nodes,
            animation: self.animation,
        })
    }
}

impl<C: AsRef<PointCloud>> Graph<C> {
    /// Makes a graph of one node with one geometry of one material.
    pub fn from_geometry(geometry: Geometry<C>, material: Material) -> Self {
        let primitives = vec![Primitive { geometry: 0, material: 0 }];
        Self {
            geometries: vec![geometry],
            materials: vec![material],
            nodes: vec![Node { primitives, ..Node::new("") }],
            ..Self::default()
        }
    }

    /// Appends all of `other`. Returns the index of its first node.
    pub fn append(&mut self, other: Self) -> usize {
        let (geometry, material) = (self.geometries.len(), self.materials.len());
        let (texture, node) = (self.textures.len(), self.nodes.len());
        self.geometries.extend(other.geometries);
        self.textures.extend(other.textures);
        self.materials.extend(other.materials.into_iter().map(|mut material| {
            material.textures.for_each_mut(|reference| reference.texture += texture);
            material
        }));
        self.nodes.extend(other.nodes.into_iter().map(|mut moved| {
            moved.parent = moved.parent.map(|parent| parent + node);
            for primitive in &mut moved.primitives {
                primitive.geometry += geometry;
                primitive.material += material;
            }
            moved.joints.iter_mut().for_each(|joint| joint.node += node);
            moved
        }));
        self.animation.append(other.animation, node);
        node
    }

    /// Appends a node. Returns its index.
    pub fn add_node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Instantiates a range of nodes once more under `parent`, with their animation; geometry is shared.
    ///
    /// The range must hold all descendants of its roots. Returns the index of the first new node.
    pub fn add_instance(&mut self, nodes: std::ops::Range<usize>, parent: usize) -> usize {
        let first = self.nodes.len();
        let moved =
            |node: usize| if nodes.contains(&node) { node - nodes.start + first } else { node };
        for i in nodes.clone() {
            let mut node = self.nodes[i].clone();
            node.parent = Some(match node.parent {
                Some(old) if nodes.contains(&old) => moved(old),
                _ => parent,
            });
            node.joints.iter_mut().for_each(|joint| joint.node = moved(joint.node));
            self.nodes.push(node);
        }
        let channels = &mut self.animation.channels;
        for i in 0..channels.len() {
            if nodes.contains(&channels[i].node) {
                let copy = Channel { node: moved(channels[i].node), ..channels[i].clone() };
                channels.push(copy);
            }
        }
        first
    }

    /// Returns the numbers of points and triangles, with each geometry counted once.
    pub fn n_points_and_triangles(&self) -> (usize, usize) {
        self.geometries.iter().fold((0, 0), |(n_points, n_triangles), geometry| match geometry {
            Geometry::Points(cloud) => (n_points + cloud.as_ref().len(), n_triangles),
            Geometry::Triangles(mesh) => (n_points, n_triangles + mesh.triangles.len()),
        })
    }

    /// Returns a sample of the points and vertices of all visible instances, in world coordinates.
    pub fn sample_points(&self) -> PointCloud {
        self.sample_points_of(&self.visible_nodes())
    }

    /// Returns a sample of the points and vertices of all instances for whose nodes `is_chosen` is true. Meshes of few
    /// vertices have points on their triangles, so that they do not count as outliers of clouds or of other meshes. Of
    /// several clouds, each is a part of its own, as a column of the sample tells.
    pub fn sample_points_of(&self, is_chosen: &[bool]) -> PointCloud {
        const MAX_POINTS: usize = 400_000;
        /// Number of points of each cloud that has so many, unless there are very many clouds.
        const MIN_POINTS_OF_CLOUD: usize = 1000;
        /// Number of points on all meshes as a fraction of those of all clouds, or of the vertices where there are none.
        const MESH_FRACTION: f64 = 0.25;
        let world = self.world_from_nodes();
        let nodes = self.nodes.iter().zip(&world).zip(is_chosen).filter(|(_, chosen)| **chosen);
        let instances: Vec<(&Geometry<C>, &DAffine3)> = nodes
            .flat_map(|((node, world), _)| node.primitives.iter().map(move |p| (p, world)))
            .map(|(primitive, world)| (&self.geometries[primitive.geometry], world))
            .collect();
        let n_points: usize =
            instances.iter().map(|(geometry, _)| geometry.positions().len()).sum();
        let step = n_points.div_ceil(MAX_POINTS).max(1);
        let clouds =
            instances.iter().filter(|(geometry, _)| matches!(geometry, Geometry::Points(_)));
        let sizes: Vec<usize> = clouds.map(|(geometry, _)| geometry.positions().len()).collect();
        let n_clouds = sizes.len();
        let n_meshes = instances.len() - n_clouds;
        let n_compared = if n_clouds == 0 { n_points } else { sizes.iter().sum() };
        let n_on_mesh = (MESH_FRACTION * (n_compared / step) as f64) as usize / n_meshes.max(1);
        let min_of_cloud = MIN_POINTS_OF_CLOUD.min(MAX_POINTS / n_clouds.max(1)).max(1);
        let (mut points, mut parts, mut n_parts) = (Vec::new(), Vec::new(), 0i32);
        for (geometry, world) in instances {
            let origin = geometry.origin();
            let point = |p: &Vec3| world.transform_point3(origin + p.as_dvec3());
            let positions = geometry.positions();
            match geometry {
                Geometry::Points(cloud) => {
                    let step = step.min((positions.len() / min_of_cloud).max(1));
                    points.extend(positions.iter().step_by(step).map(point));
                    // A cloud of several files has several parts.
                    let part_of = cloud.as_ref().scalar(PART);
                    let part = |i: usize| {
                        let of_cloud = part_of.map_or(0, |parts| parts.get(i) as i32);
                        n_parts.saturating_add(1).saturating_add(of_cloud)
                    };
                    let first = parts.len();
                    parts.extend((0..positions.len()).step_by(step).map(part));
                    n_parts = parts[first..].iter().copied().fold(n_parts, i32::max);
                }
                Geometry::Triangles(mesh) => {
                    points.extend(positions.iter().step_by(step).map(point));
                    if mesh.positions.len() < n_on_mesh {
                        points.extend(points_on_triangles(mesh, n_on_mesh).iter().map(point));
                    }
                    // All meshes are one part.
                    parts.resize(points.len(), 0);
                }
            }
        }
        let origin = PointCloud::choose_origin(&points);
        let positions = points.iter().map(|point| (*point - origin).as_vec3()).collect();
        let mut sample = PointCloud { origin, ..PointCloud::from_positions(positions) };
        if 1 < n_parts {
            sample.scalars.push(Scalar { name: PART.to_owned(), values: Values::I32(parts) });
        }
        sample
    }

    /// Returns the index of the first visible node with a camera, and that camera in world coordinates.
    /// Nodes with a degenerate or infinite transform are skipped.
    pub fn camera(&self) -> Option<(usize, Camera)> {
        let (world, is_visible) = (self.world_from_nodes(), self.visible_nodes());
        let mut nodes = self.nodes.iter().enumerate().filter(|(i, _)| is_visible[*i]);
        nodes.find_map(|(i, node)| {
            let transform = world[i];
            let forward = transform.transform_vector3(-DVec3::Z).try_normalize()?;
            let camera = Camera {
                position: transform.translation,
                focal_point: transform.translation + forward,
                view_up: transform.transform_vector3(DVec3::Y).try_normalize()?,
                projection: node.camera?,
            };
            transform.is_finite().then_some((i, camera))
        })
    }

    /// Returns for each node whether it and all its ancestors are visible.
    pub fn visible_nodes(&self) -> Vec<bool> {
        let mut is_visible: Vec<bool> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let is_parent_visible = node.parent.is_none_or(|parent| is_visible[parent]);
            is_visible.push(node.is_visible && is_parent_visible);
        }
        is_visible
    }

    /// Returns the transform of each geometry's first instance to world coordinates, or the identity if it
    /// has none.
    pub fn world_from_geometries(&self) -> Vec<DAffine3> {
        let mut transforms = vec![None; self.geometries.len()];
        for (node, world) in self.nodes.iter().zip(self.world_from_nodes()) {
            for primitive in &node.primitives {
                transforms[primitive.geometry].get_or_insert(world);
            }
        }
        transforms.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// Returns the transform of each node's coordinates to world coordinates.
    pub fn world_from_nodes(&self) -> Vec<DAffine3> {
        let mut world_from_nodes: Vec<DAffine3> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let world_from_parent = node.parent.map_or(DAffine3::IDENTITY, |i| world_from_nodes[i]);
            world_from_nodes.push(world_from_parent * node.transform.matrix());
        }
        world_from_nodes
    }
}

/// Returns about `n` points on the triangles of a mesh, the same number on each.
fn points_on_triangles(mesh: &Mesh, n: usize) -> Vec<Vec3> {
    /// Steps of an even sequence of points in the unit square (Roberts 2018).
    const STEPS: [f32; 2] = [0.754_877_7, 0.569_840_3];
    let per_triangle = n.div_ceil(mesh.triangles.len().max(1));
    let corner = |vertex: u32| mesh.positions.get(vertex as usize).copied();
    let corners =
        mesh.triangles.iter().filter_map(|[a, b, c]| Some([corner(*a)?, corner(*b)?, corner(*c)?]));
    let points = corners.flat_map(|[a, b, c]| {
        (0..per_triangle).map(move |i| {
            let [u, v] = STEPS.map(|step| (0.5 + step * i as f32).fract());
            let (u, v) = if u + v <= 1.0 { (u, v) } else { (1.0 - u, 1.0 - v) };
            a + u * (b - a) + v * (c - a)
        })
    });
    points.collect()
}

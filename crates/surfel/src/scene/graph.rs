//! The graph of a scene after glTF 2.0: geometry under nodes that stand, turn and move.

use super::animation::{Animation, Channel};
use super::camera::{Camera, Projection};
use super::light::Lamp;
use super::material::Material;
use super::mesh::Mesh;
use super::texture::Texture;
use crate::math::{DAffine3, DQuat, DVec3, Vec3};
use crate::points::{Morph, PointCloud, Skin};
use crate::surface::{Boundary, SurfaceKind};

/// What several files are put together to. Indices are into the columns here.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    pub geometries: Vec<Geometry>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// Parents stand before their children.
    pub nodes: Vec<Node>,
    pub animation: Animation,
}

#[derive(Clone, Debug)]
pub enum Geometry {
    Points(Points),
    Triangles(Mesh),
}

/// A cloud, how it is shaped, and how coloured.
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// With radii, and normals where the surface needs them.
    pub cloud: PointCloud,
    /// One a point, sRGB-encoded.
    pub colors: Vec<[u8; 3]>,
    pub surface: SurfaceKind,
    pub boundary: Boundary,
    /// Whether normals point out of what the points enclose, which tells glass its inside. Where they do
    /// not, a ray is inside after every other passage (Schaufler and Jensen 2000).
    pub has_outward_normals: bool,
}

/// A place in the world, or in that of another node.
#[derive(Clone, Debug)]
pub struct Node {
    pub name: String,
    /// Index of a node before this one.
    pub parent: Option<usize>,
    pub transform: Transform,
    /// What is seen here. Geometry that several nodes show is held once.
    pub parts: Vec<Part>,
    pub lamp: Option<Lamp>,
    /// Looks along -Z, with +Y up.
    pub camera: Option<Projection>,
    /// Whether this node and those below it are there.
    pub is_visible: bool,
    /// Of the morph targets of the parts.
    pub morph_weights: Vec<f32>,
    /// Nodes whose movement carries the vertices of skinned parts, each with its inverse bind matrix.
    pub joints: Vec<Joint>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    pub geometry: usize,
    pub material: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    pub node: usize,
    /// From the mesh's coordinates to the joint's when it was bound.
    pub joint_from_mesh: DAffine3,
}

/// From a node's coordinates to its parent's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
    Matrix(DAffine3),
}

impl Transform {
    pub const IDENTITY: Self =
        Self::Parts { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    pub const fn translated(translation: DVec3) -> Self {
        Self::Parts { translation, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }

    pub fn matrix(&self) -> DAffine3 {
        match *self {
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

impl Node {
    /// Shows nothing, where its parent is.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            parent: None,
            transform: Transform::IDENTITY,
            parts: Vec::new(),
            lamp: None,
            camera: None,
            is_visible: true,
            morph_weights: Vec::new(),
            joints: Vec::new(),
        }
    }
}

impl Geometry {
    /// Object coordinates of the zero of its positions.
    pub fn origin(&self) -> DVec3 {
        match self {
            Self::Points(points) => points.cloud.origin,
            Self::Triangles(mesh) => mesh.origin,
        }
    }

    /// Of points, or of vertices.
    pub fn positions(&self) -> &[Vec3] {
        match self {
            Self::Points(points) => &points.cloud.positions,
            Self::Triangles(mesh) => &mesh.positions,
        }
    }

    pub fn morphs(&self) -> &[Morph] {
        match self {
            Self::Points(points) => &points.cloud.morphs,
            Self::Triangles(mesh) => &mesh.morphs,
        }
    }

    pub fn skin(&self) -> Option<&Skin> {
        match self {
            Self::Points(points) => points.cloud.skin.as_ref(),
            Self::Triangles(mesh) => mesh.skin.as_ref(),
        }
    }
}

impl Graph {
    /// One thing of one material, where it is.
    pub fn of(geometry: Geometry, material: Material) -> Self {
        let parts = vec![Part { geometry: 0, material: 0 }];
        Self {
            geometries: vec![geometry],
            materials: vec![material],
            nodes: vec![Node { parts, ..Node::new("") }],
            ..Self::default()
        }
    }

    /// Takes `other` in beside what is here; returns the index of its first node.
    pub fn append(&mut self, other: Self) -> usize {
        let (geometry, material) = (self.geometries.len(), self.materials.len());
        let (texture, node) = (self.textures.len(), self.nodes.len());
        self.geometries.extend(other.geometries);
        self.textures.extend(other.textures);
        self.materials.extend(other.materials.into_iter().map(|mut material| {
            material.textures.each_mut(|reference| reference.texture += texture);
            material
        }));
        self.nodes.extend(other.nodes.into_iter().map(|mut moved| {
            moved.parent = moved.parent.map(|parent| parent + node);
            for part in &mut moved.parts {
                part.geometry += geometry;
                part.material += material;
            }
            moved.joints.iter_mut().for_each(|joint| joint.node += node);
            moved
        }));
        self.animation.append(other.animation, node);
        node
    }

    /// Empties the clouds and meshes that never bend, once their flat form holds all that is needed.
    pub fn forget_static(&mut self) {
        let is_static =
            |geometry: &&mut Geometry| geometry.morphs().is_empty() && geometry.skin().is_none();
        for geometry in self.geometries.iter_mut().filter(is_static) {
            match geometry {
                Geometry::Points(points) => {
                    let origin = points.cloud.origin;
                    points.cloud = PointCloud { origin, ..PointCloud::default() };
                    points.colors = Vec::new();
                }
                Geometry::Triangles(mesh) => {
                    *mesh = Mesh { origin: mesh.origin, ..Mesh::default() };
                }
            }
        }
    }

    /// Puts a new node at the end; returns its index.
    pub fn add(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Shows a range of nodes, which holds all below its roots, once more under `parent`; geometry is
    /// shared. Returns the index of the first copy.
    pub fn add_copy(&mut self, nodes: std::ops::Range<usize>, parent: usize) -> usize {
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

    /// Points and triangles, each geometry once.
    pub fn counts(&self) -> (usize, usize) {
        self.geometries.iter().fold((0, 0), |(n_points, n_triangles), geometry| match geometry {
            Geometry::Points(points) => (n_points + points.cloud.len(), n_triangles),
            Geometry::Triangles(mesh) => (n_points, n_triangles + mesh.triangles.len()),
        })
    }

    /// Points that show where everything visible is: some of the clouds' points and of the vertices.
    pub fn outline(&self) -> PointCloud {
        const MOST: usize = 400_000;
        let (world, is_visible) = (self.world_from_nodes(), self.visible_nodes());
        let nodes = self.nodes.iter().zip(&world).zip(&is_visible).filter(|(_, visible)| **visible);
        let parts: Vec<(&Geometry, &DAffine3)> = nodes
            .flat_map(|((node, world), _)| node.parts.iter().map(move |part| (part, world)))
            .map(|(part, world)| (&self.geometries[part.geometry], world))
            .collect();
        let n_places: usize = parts.iter().map(|(geometry, _)| geometry.positions().len()).sum();
        let step = n_places.div_ceil(MOST).max(1);
        let mut places = Vec::new();
        for (geometry, world) in parts {
            let origin = geometry.origin();
            let place = |p: &Vec3| world.transform_point3(origin + p.as_dvec3());
            places.extend(geometry.positions().iter().step_by(step).map(place));
        }
        let origin = PointCloud::choose_origin(&places);
        let positions = places.iter().map(|place| (*place - origin).as_vec3()).collect();
        PointCloud { origin, ..PointCloud::from_positions(positions) }
    }

    /// The first visible node with a camera, and that camera where it stands, if it is in one piece.
    pub fn camera(&self) -> Option<(usize, Camera)> {
        let (world, is_visible) = (self.world_from_nodes(), self.visible_nodes());
        let mut nodes = self.nodes.iter().enumerate().filter(|(i, _)| is_visible[*i]);
        nodes.find_map(|(i, node)| {
            let place = world[i];
            let forward = place.transform_vector3(-DVec3::Z).try_normalize()?;
            let camera = Camera {
                position: place.translation,
                focal_point: place.translation + forward,
                view_up: place.transform_vector3(DVec3::Y).try_normalize()?,
                projection: node.camera?,
            };
            place.is_finite().then_some((i, camera))
        })
    }

    /// Of each node, whether it and all above it are visible.
    pub fn visible_nodes(&self) -> Vec<bool> {
        let mut is_visible: Vec<bool> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let is_above = node.parent.is_none_or(|parent| is_visible[parent]);
            is_visible.push(node.is_visible && is_above);
        }
        is_visible
    }

    /// From each geometry's coordinates to the world's, where the first node that shows it stands.
    pub fn world_from_geometries(&self) -> Vec<DAffine3> {
        let mut places = vec![None; self.geometries.len()];
        for (node, world) in self.nodes.iter().zip(self.world_from_nodes()) {
            for part in &node.parts {
                places[part.geometry].get_or_insert(world);
            }
        }
        places.into_iter().map(Option::unwrap_or_default).collect()
    }

    /// From each node's coordinates to the world's.
    pub fn world_from_nodes(&self) -> Vec<DAffine3> {
        let mut world_from_nodes: Vec<DAffine3> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let world_from_parent = node.parent.map_or(DAffine3::IDENTITY, |i| world_from_nodes[i]);
            world_from_nodes.push(world_from_parent * node.transform.matrix());
        }
        world_from_nodes
    }
}

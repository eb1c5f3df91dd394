//! The trees of a scene with the records of their instances.

use crate::gaussian_arrays::gaussian_ranges;
use crate::mesh_blocks::{attributes, block_vectors};
use crate::numbers::{NO_LIMIT, NODE_VECTORS, TRIANGLE, align_number, attribute, surface_number};
use crate::records::Visit;
use crate::surface::Surface;
use crate::unsupported::trees;
use crate::upload::TreeRef;
use std::collections::BTreeMap;
use std::ops::Range;
use surfel_core::flat::{FlatCloud, FlatGeometry, FlatMesh, FlatScene, Instance};
use surfel_core::math::{Affine3A, Mat3, Vec3, Vec3A};
use surfel_core::scene::Material;
use surfel_core::surface::{EdgeTest, GatherLimit, SurfaceKind};

/// A tree with its instances.
#[derive(Clone, Debug)]
pub struct TreeInstances {
    /// The tree.
    pub tree: TreeRef,
    /// The surface that is traced.
    pub surface: Surface,
    /// True if hits are coloured by their support.
    pub has_support_colors: bool,
    /// Indices of the visits of instances that no light passes.
    pub opaque: Range<u32>,
    /// Indices of the visits of instances that light passes, which follow.
    pub transmissive: Range<u32>,
}

impl TreeInstances {
    /// Returns the indices of all visits.
    pub fn all(&self) -> Range<u32> {
        self.opaque.start..self.transmissive.end
    }
}

/// The trees of a scene that have instances.
#[derive(Debug, Default)]
pub struct TreeVisits {
    /// The trees.
    pub trees: Vec<TreeInstances>,
    /// Indices of the visits of instances of trained Gaussians.
    pub gaussians: Range<u32>,
    /// Records of the instances of all trees.
    pub visits: Vec<Visit>,
}

impl TreeVisits {
    /// Collects the trees of all instances.
    pub fn new(scene: &FlatScene) -> Self {
        // The instances that light passes come last.
        let mut by_tree = BTreeMap::<(TreeRef, Surface), [Vec<Visit>; 2]>::new();
        for (instance_idx, instance) in scene.instances.iter().enumerate() {
            let placement = placement(instance_idx as u32, instance);
            let geometry_idx = instance.geometry_idx as usize;
            let mut add = |tree_idx, surface, visit| {
                let tree = TreeRef::Geometry { geometry_idx, tree_idx };
                let visits = by_tree.entry((tree, surface)).or_default();
                visits[usize::from(instance.is_transmissive)].push(visit);
            };
            let cloud = match scene.geometry(instance) {
                FlatGeometry::Cloud(cloud) => cloud,
                FlatGeometry::Mesh(mesh) => {
                    let material = &scene.materials[instance.material_idx as usize];
                    add(0, Surface::Triangle, mesh_visit(placement, mesh, material));
                    continue;
                }
            };
            for (tree_idx, (kind, points)) in trees(cloud).into_iter().enumerate() {
                let Some(surface) = Surface::of_kind(kind, cloud) else {
                    continue;
                };
                if !points.nodes.is_empty() {
                    add(tree_idx, surface, visit(placement, cloud, kind));
                }
            }
        }
        let mut found = Self::default();
        for ((tree, surface), visits) in by_tree {
            found.add(scene, tree, surface, visits);
        }
        found.add_gaussians(scene);
        found
    }

    /// Adds the instances of trained Gaussians, which have one tree.
    fn add_gaussians(&mut self, scene: &FlatScene) {
        let ranges = gaussian_ranges(&scene.geometries);
        let first = self.visits.len() as u32;
        for (instance_idx, instance) in scene.instances.iter().enumerate() {
            let geometry_idx = instance.geometry_idx as usize;
            // They are in the order of the geometries.
            let range = ranges.binary_search_by_key(&geometry_idx, |range| range.geometry_idx);
            let (Ok(range), FlatGeometry::Cloud(cloud)) = (range, scene.geometry(instance)) else {
                continue;
            };
            let range = &ranges[range];
            self.visits.push(Visit {
                root_node: range.root_node,
                first_vector: range.first_vector,
                block_vectors: range.block_vectors,
                n_harmonics: cloud.gaussians.n_harmonics() as u32,
                ..visit(placement(instance_idx as u32, instance), cloud, cloud.surface)
            });
        }
        self.gaussians = first..self.visits.len() as u32;
    }

    fn add(&mut self, scene: &FlatScene, tree: TreeRef, surface: Surface, visits: [Vec<Visit>; 2]) {
        let [opaque, transmissive] = visits.map(|visits| {
            let first = self.visits.len() as u32;
            self.visits.extend(visits);
            first..self.visits.len() as u32
        });
        let has_support_colors = match tree {
            TreeRef::Geometry { geometry_idx, .. } => match &*scene.geometries[geometry_idx] {
                FlatGeometry::Cloud(cloud) => cloud.support_colors.is_some(),
                FlatGeometry::Mesh(_) => false,
            },
            TreeRef::Gaussians => false,
        };
        self.trees.push(TreeInstances { tree, surface, has_support_colors, opaque, transmissive });
    }
}

/// Returns the record of a tree of a geometry that is in its place.
pub fn lone_visit(geometry: &FlatGeometry, tree_idx: usize) -> Visit {
    let identity = Visit { is_identity: 1, max_scale: 1.0, ..bytemuck::Zeroable::zeroed() };
    match geometry {
        FlatGeometry::Mesh(mesh) => mesh_visit(identity, mesh, &Material::MATTE),
        FlatGeometry::Cloud(cloud) => visit(identity, cloud, trees(cloud)[tree_idx].0),
    }
}

fn visit(placement: Visit, cloud: &FlatCloud, kind: SurfaceKind) -> Visit {
    let is_surface = kind == cloud.surface;
    Visit {
        surface: surface_number(kind),
        align: align_number(cloud.options.align),
        gathers_to_nearest: (cloud.options.gather_limit == GatherLimit::Nearest).into(),
        min_discs: if kind == SurfaceKind::Cylinder { cloud.options.density } else { 1 },
        // The structure of the surface follows the nodes.
        first_vector: (cloud.points.nodes.len() * NODE_VECTORS) as u32,
        radius_factor: if is_surface { cloud.radius_factor() } else { 1.0 },
        // Added to any other distance, it stays a finite number.
        max_blend_distance: if is_surface {
            cloud.max_blend_distance.min(0.1 * NO_LIMIT)
        } else {
            0.0
        },
        edge_retest_factor: cloud.edge_retest_factor,
        has_edge_test: (cloud.edge_test == EdgeTest::AngularGap).into(),
        has_front_sides: cloud.has_front_sides.into(),
        blends_colors: cloud.blends_colors.into(),
        has_outward_normals: cloud.has_outward_normals.into(),
        ..placement
    }
}

fn mesh_visit(placement: Visit, mesh: &FlatMesh, material: &Material) -> Visit {
    let normal_map = material.textures.normal.as_ref();
    let is_second = normal_map.is_some_and(|(texture, _)| texture.uv_set == 1);
    let of_second_uvs = if is_second { attribute::TANGENTS_OF_SECOND_UVS } else { 0 };
    Visit {
        surface: TRIANGLE,
        block_vectors: block_vectors(mesh),
        attributes: attributes(mesh) | of_second_uvs,
        has_outward_normals: 1,
        ..placement
    }
}

fn placement(instance_idx: u32, instance: &Instance) -> Visit {
    let matrix = instance.world_from_object.matrix3;
    Visit {
        object_from_world: affine_columns(&instance.object_from_world),
        world_from_normal: matrix_columns(&instance.world_from_normal),
        world_from_object: matrix_columns(&Mat3::from(matrix)),
        instance: instance_idx,
        is_identity: instance.is_identity.into(),
        max_scale: instance.max_scale,
        is_mirrored: (matrix.determinant() < 0.0).into(),
        lower: instance.bounds.min.to_array(),
        upper: instance.bounds.max.to_array(),
        ..bytemuck::Zeroable::zeroed()
    }
}

fn affine_columns(transform: &Affine3A) -> [[f32; 4]; 4] {
    let Affine3A { matrix3, translation } = transform;
    let column = |axis: Vec3A| Vec3::from(axis).extend(0.0).to_array();
    [column(matrix3.x_axis), column(matrix3.y_axis), column(matrix3.z_axis), column(*translation)]
}

fn matrix_columns(matrix: &Mat3) -> [[f32; 4]; 3] {
    [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.extend(0.0).to_array())
}

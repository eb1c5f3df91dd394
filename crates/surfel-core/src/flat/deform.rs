//! Deformation of meshes and clouds: morph targets, then linear blend skinning by joints.

use crate::math::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use crate::points::{Morph, Skin};
use crate::scene::{Geometry, Graph, Joint, Mesh, Node};
use rayon::prelude::*;

/// Returns true if `node` deforms `geometry` by morph targets or joints.
pub fn is_deformed(geometry: &Geometry, node: &Node) -> bool {
    let is_morphed = !geometry.morphs().is_empty() && !node.morph_weights.is_empty();
    is_morphed || (geometry.skin().is_some() && !node.joints.is_empty())
}

/// The columns of a mesh or cloud that deformation changes. A column that the geometry lacks is empty.
pub struct Deformed {
    /// Positions in the geometry's coordinates.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents of meshes, with the sign of the bitangent in W.
    pub tangents: Vec<Vec4>,
    /// Radii of clouds.
    pub radii: Vec<f32>,
}

/// The morph weights and joint transforms of a node at an instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    morph_weights: Vec<f32>,
    /// Joint matrices, from the geometry's rest pose to the node's coordinates.
    node_from_mesh: Vec<DAffine3>,
}

/// A joint's transforms of positions and of normals.
type JointTransform = (DAffine3, DMat3);

impl Pose {
    /// Returns the pose of a node. `world` has the world transforms of all nodes.
    pub fn new(graph: &Graph, node_idx: usize, world: &[DAffine3]) -> Self {
        let node = &graph.nodes[node_idx];
        let node_from_world = world[node_idx].inverse();
        let joint_matrix =
            |joint: &Joint| node_from_world * world[joint.node] * joint.joint_from_mesh;
        Self {
            morph_weights: node.morph_weights.clone(),
            node_from_mesh: node.joints.iter().map(joint_matrix).collect(),
        }
    }

    /// Returns `geometry` deformed to this pose, in the node's coordinates.
    pub fn deform(&self, geometry: &Geometry) -> Deformed {
        let mut deformed = rest_pose(geometry);
        let morphs = geometry.morphs().iter().zip(&self.morph_weights);
        for (morph, &weight) in morphs.filter(|(_, weight)| **weight != 0.0) {
            deformed.add_morph(morph, weight);
        }
        deformed.normalize_tangents(geometry);
        deformed.clamp_radii(geometry);
        if let (Some(skin), false) = (geometry.skin(), self.node_from_mesh.is_empty()) {
            let origin = geometry.origin();
            let joints = self.node_from_mesh.iter().map(|node_from_mesh| {
                let about_origin = DAffine3::from_translation(-origin)
                    * *node_from_mesh
                    * DAffine3::from_translation(origin);
                (about_origin, about_origin.matrix3.inverse().transpose())
            });
            deformed.skin(skin, &joints.collect::<Vec<_>>());
        }
        deformed.normals.par_iter_mut().for_each(|normal| *normal = normal.normalize_or(Vec3::Z));
        deformed
    }
}

/// Copies the columns of a geometry that is not deformed.
fn rest_pose(geometry: &Geometry) -> Deformed {
    match geometry {
        Geometry::Points(points) => Deformed {
            positions: points.cloud().positions().to_vec(),
            normals: points.cloud().normals().to_vec(),
            tangents: Vec::new(),
            radii: points.cloud().radii().to_vec(),
        },
        Geometry::Triangles(Mesh { positions, normals, tangents, .. }) => Deformed {
            positions: positions.clone(),
            normals: normals.clone().unwrap_or_default(),
            tangents: tangents.clone().unwrap_or_default(),
            radii: Vec::new(),
        },
    }
}

impl Deformed {
    /// Adds the offsets of a morph target.
    fn add_morph(&mut self, morph: &Morph, weight: f32) {
        let positions = self.positions.par_iter_mut().zip(&morph.positions);
        positions.for_each(|(position, offset)| *position += weight * offset);
        if let Some(normals) = &morph.normals {
            let normals = self.normals.par_iter_mut().zip(normals);
            normals.for_each(|(normal, offset)| *normal += weight * offset);
        }
        if let Some(tangents) = &morph.tangents {
            let tangents = self.tangents.par_iter_mut().zip(tangents);
            tangents.for_each(|(tangent, offset)| *tangent += (weight * offset).extend(0.0));
        }
        if let Some(radii) = &morph.radii {
            let radii = self.radii.par_iter_mut().zip(radii);
            radii.for_each(|(radius, offset)| *radius += weight * offset);
        }
    }

    /// Makes morphed tangents unit again.
    fn normalize_tangents(&mut self, geometry: &Geometry) {
        let morphs = geometry.morphs();
        if morphs.iter().any(|morph| morph.tangents.is_some()) {
            self.tangents.par_iter_mut().for_each(|tangent| {
                let along = tangent.truncate().normalize_or_zero();
                *tangent = along.extend(tangent.w);
            });
        }
    }

    /// Keeps each radius at least at a tenth of its minimum over the rest pose and all targets. Morph weights
    /// below 0 or above 1 could make it vanish otherwise.
    fn clamp_radii(&mut self, geometry: &Geometry) {
        const MIN_FRACTION: f32 = 0.1;
        let morphs = geometry.morphs();
        if let Geometry::Points(points) = geometry {
            self.radii.par_iter_mut().zip(points.cloud().radii()).enumerate().for_each(
                |(i, (radius, at_rest))| {
                    let added = morphs.iter().filter_map(|morph| Some(morph.radii.as_ref()?[i]));
                    let min_radius = added.map(|added| at_rest + added).fold(*at_rest, f32::min);
                    *radius = radius.max(MIN_FRACTION * min_radius);
                },
            );
        }
    }

    /// Applies linear blend skinning. Radii are scaled by the largest stretch along an axis.
    fn skin(&mut self, skin: &Skin, transforms: &[JointTransform]) {
        let joints = |vertex: usize| {
            let joints = skin.joints[vertex].into_iter().zip(skin.weights[vertex]);
            joints.filter_map(|(joint, weight)| {
                let transform = transforms.get(usize::from(joint))?;
                (0.0 < weight).then_some((transform, f64::from(weight)))
            })
        };
        self.positions.par_iter_mut().enumerate().for_each(|(vertex, position)| {
            let rest = position.as_dvec3();
            let moved =
                joints(vertex).map(|((joint, _), weight)| weight * joint.transform_point3(rest));
            *position = moved.sum::<DVec3>().as_vec3();
        });
        self.tangents.par_iter_mut().enumerate().for_each(|(vertex, tangent)| {
            let along = tangent.truncate().as_dvec3();
            let rotated =
                joints(vertex).map(|((joint, _), weight)| weight * joint.transform_vector3(along));
            let along = rotated.sum::<DVec3>().normalize_or(along).as_vec3();
            *tangent = along.extend(tangent.w);
        });
        self.normals.par_iter_mut().enumerate().for_each(|(vertex, normal)| {
            let rest = normal.as_dvec3();
            let rotated = joints(vertex).map(|((_, rotate), weight)| weight * (*rotate * rest));
            *normal = rotated.sum::<DVec3>().as_vec3();
        });
        self.radii.par_iter_mut().enumerate().for_each(|(vertex, radius)| {
            let blend = |axis: fn(&DMat3) -> DVec3| {
                joints(vertex)
                    .map(|((joint, _), weight)| weight * axis(&joint.matrix3))
                    .sum::<DVec3>()
            };
            let axes = [blend(|m| m.x_axis), blend(|m| m.y_axis), blend(|m| m.z_axis)];
            let stretch = axes.into_iter().map(DVec3::length).fold(0.0, f64::max);
            *radius *= stretch as f32;
        });
    }
}

//! Meshes and clouds that bend: morph targets, then the joints that carry vertices and points.

use crate::math::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use crate::points::{Morph, Skin};
use crate::scene::{Geometry, Graph, Joint, Mesh, Node, Points};
use rayon::prelude::*;

/// Whether a node shows `geometry` other than it is.
pub fn is_deformed(geometry: &Geometry, node: &Node) -> bool {
    let is_morphed = !geometry.morphs().is_empty() && !node.morph_weights.is_empty();
    is_morphed || (geometry.skin().is_some() && !node.joints.is_empty())
}

/// The columns of a mesh or cloud that bend, those that it lacks empty.
pub struct Bent {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Of meshes.
    pub tangents: Vec<Vec4>,
    /// Of clouds.
    pub radii: Vec<f32>,
}

/// How a node bends what it shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    morph_weights: Vec<f32>,
    /// In the node's coordinates, what each joint does to places of what it was bound to.
    node_from_mesh: Vec<DAffine3>,
}

/// What a joint does to places, and to normals.
type Carry = (DAffine3, DMat3);

impl Pose {
    pub fn of(graph: &Graph, node_idx: usize, world: &[DAffine3]) -> Self {
        let node = &graph.nodes[node_idx];
        let node_from_world = world[node_idx].inverse();
        let carried = |joint: &Joint| node_from_world * world[joint.node] * joint.joint_from_mesh;
        Self {
            morph_weights: node.morph_weights.clone(),
            node_from_mesh: node.joints.iter().map(carried).collect(),
        }
    }

    /// `geometry` in this pose, in the node's coordinates.
    pub fn bend(&self, geometry: &Geometry) -> Bent {
        let mut bent = at_rest(geometry);
        let morphs = geometry.morphs().iter().zip(&self.morph_weights);
        for (morph, &weight) in morphs.filter(|(_, weight)| **weight != 0.0) {
            bent.add(morph, weight);
        }
        bent.keep_sizes(geometry);
        if let (Some(skin), false) = (geometry.skin(), self.node_from_mesh.is_empty()) {
            let origin = geometry.origin();
            let carry = self.node_from_mesh.iter().map(|node_from_mesh| {
                let about_origin = DAffine3::from_translation(-origin)
                    * *node_from_mesh
                    * DAffine3::from_translation(origin);
                (about_origin, about_origin.matrix3.inverse().transpose())
            });
            bent.carry(skin, &carry.collect::<Vec<_>>());
        }
        bent.normals.par_iter_mut().for_each(|normal| *normal = normal.normalize_or(Vec3::Z));
        bent
    }
}

fn at_rest(geometry: &Geometry) -> Bent {
    match geometry {
        Geometry::Points(Points { cloud, .. }) => Bent {
            positions: cloud.positions.clone(),
            normals: cloud.normals.clone().unwrap_or_default(),
            tangents: Vec::new(),
            radii: cloud.radii.clone().unwrap_or_default(),
        },
        Geometry::Triangles(Mesh { positions, normals, tangents, .. }) => Bent {
            positions: positions.clone(),
            normals: normals.clone().unwrap_or_default(),
            tangents: tangents.clone().unwrap_or_default(),
            radii: Vec::new(),
        },
    }
}

impl Bent {
    fn add(&mut self, morph: &Morph, weight: f32) {
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

    /// Makes tangents unit again, and lets no point vanish: weights beyond 0 and 1 may leave nothing of a
    /// radius, of which a tenth of the smallest that it has at rest and at any target is kept.
    fn keep_sizes(&mut self, geometry: &Geometry) {
        const LEAST: f32 = 0.1;
        let morphs = geometry.morphs();
        if morphs.iter().any(|morph| morph.tangents.is_some()) {
            self.tangents.par_iter_mut().for_each(|tangent| {
                let along = tangent.truncate().normalize_or_zero();
                *tangent = along.extend(tangent.w);
            });
        }
        if let Geometry::Points(Points { cloud, .. }) = geometry
            && let Some(at_rest) = &cloud.radii
        {
            self.radii.par_iter_mut().zip(at_rest).enumerate().for_each(
                |(i, (radius, at_rest))| {
                    let added = morphs.iter().filter_map(|morph| Some(morph.radii.as_ref()?[i]));
                    let smallest = added.map(|added| at_rest + added).fold(*at_rest, f32::min);
                    *radius = radius.max(LEAST * smallest);
                },
            );
        }
    }

    /// Linear blend skinning. Radii grow as lengths do along the axis that is stretched most.
    fn carry(&mut self, skin: &Skin, carry: &[Carry]) {
        let joints = |vertex: usize| {
            let joints = skin.joints[vertex].into_iter().zip(skin.weights[vertex]);
            joints.filter_map(|(joint, weight)| {
                let carry = carry.get(usize::from(joint))?;
                (0.0 < weight).then_some((carry, f64::from(weight)))
            })
        };
        self.positions.par_iter_mut().enumerate().for_each(|(vertex, position)| {
            let place = position.as_dvec3();
            let moved = joints(vertex).map(|((by, _), weight)| weight * by.transform_point3(place));
            *position = moved.sum::<DVec3>().as_vec3();
        });
        self.tangents.par_iter_mut().enumerate().for_each(|(vertex, tangent)| {
            let along = tangent.truncate().as_dvec3();
            let turned =
                joints(vertex).map(|((by, _), weight)| weight * by.transform_vector3(along));
            let along = turned.sum::<DVec3>().normalize_or(along).as_vec3();
            *tangent = along.extend(tangent.w);
        });
        self.normals.par_iter_mut().enumerate().for_each(|(vertex, normal)| {
            let unbent = normal.as_dvec3();
            let turned = joints(vertex).map(|((_, turn), weight)| weight * (*turn * unbent));
            *normal = turned.sum::<DVec3>().as_vec3();
        });
        self.radii.par_iter_mut().enumerate().for_each(|(vertex, radius)| {
            let blend = |axis: fn(&DMat3) -> DVec3| {
                joints(vertex).map(|((by, _), weight)| weight * axis(&by.matrix3)).sum::<DVec3>()
            };
            let axes = [blend(|m| m.x_axis), blend(|m| m.y_axis), blend(|m| m.z_axis)];
            let stretch = axes.into_iter().map(DVec3::length).fold(0.0, f64::max);
            *radius *= stretch as f32;
        });
    }
}

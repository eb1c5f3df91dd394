//! Meshes that bend: morph targets, then the joints that carry their vertices.

use crate::math::{DAffine3, DMat3, DVec3, Vec3, Vec4};
use crate::scene::{Graph, Joint, Mesh, Node, Skin};

/// Whether a node shows `mesh` other than it is.
pub fn is_deformed(mesh: &Mesh, node: &Node) -> bool {
    let is_morphed = !mesh.morphs.is_empty() && !node.morph_weights.is_empty();
    is_morphed || is_skinned(mesh, node)
}

fn is_skinned(mesh: &Mesh, node: &Node) -> bool {
    mesh.skin.is_some() && !node.joints.is_empty()
}

/// The columns of a mesh that bend, those that it lacks empty.
pub struct Bent {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec4>,
}

/// How a node bends meshes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    morph_weights: Vec<f32>,
    /// In the node's coordinates, what each joint does to places of the mesh it was bound to.
    node_from_mesh: Vec<DAffine3>,
}

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

    /// `mesh` in this pose, in the node's coordinates.
    pub fn bend(&self, mesh: &Mesh) -> Bent {
        let mut bent = Bent {
            positions: mesh.positions.clone(),
            normals: mesh.normals.clone().unwrap_or_default(),
            tangents: mesh.tangents.clone().unwrap_or_default(),
        };
        let morphs = mesh.morphs.iter().zip(&self.morph_weights);
        for (morph, &weight) in morphs.filter(|(_, weight)| **weight != 0.0) {
            for (position, offset) in bent.positions.iter_mut().zip(&morph.positions) {
                *position += weight * offset;
            }
            for (normal, offset) in bent.normals.iter_mut().zip(morph.normals.iter().flatten()) {
                *normal += weight * offset;
            }
        }
        if let (Some(skin), false) = (&mesh.skin, self.node_from_mesh.is_empty()) {
            let carry = self.node_from_mesh.iter().map(|node_from_mesh| {
                let about_origin = DAffine3::from_translation(-mesh.origin)
                    * *node_from_mesh
                    * DAffine3::from_translation(mesh.origin);
                (about_origin, about_origin.matrix3.inverse().transpose())
            });
            carry_by_joints(&mut bent, skin, &carry.collect::<Vec<_>>());
        }
        bent.normals.iter_mut().for_each(|normal| *normal = normal.normalize_or(Vec3::Z));
        bent
    }
}

/// Linear blend skinning; `carry` has what each joint does to places and to normals.
fn carry_by_joints(bent: &mut Bent, skin: &Skin, carry: &[(DAffine3, DMat3)]) {
    for vertex in 0..bent.positions.len() {
        let joints = skin.joints[vertex].into_iter().zip(skin.weights[vertex]);
        let joints = joints.filter_map(|(joint, weight)| {
            let carry = carry.get(usize::from(joint))?;
            (0.0 < weight).then_some((carry, f64::from(weight)))
        });
        let place = bent.positions[vertex].as_dvec3();
        let moved =
            joints.clone().map(|((place_by, _), weight)| weight * place_by.transform_point3(place));
        bent.positions[vertex] = moved.sum::<DVec3>().as_vec3();
        if let Some(tangent) = bent.tangents.get_mut(vertex) {
            let along = tangent.truncate().as_dvec3();
            let carried = joints.clone();
            let turned = carried.map(|((by, _), weight)| weight * by.transform_vector3(along));
            let along = turned.sum::<DVec3>().normalize_or(along).as_vec3();
            *tangent = along.extend(tangent.w);
        }
        if let Some(normal) = bent.normals.get_mut(vertex) {
            let unbent = normal.as_dvec3();
            let turned = joints.map(|((_, turn_by), weight)| weight * (*turn_by * unbent));
            *normal = turned.sum::<DVec3>().as_vec3();
        }
    }
}

//! Meshes that bend: morph targets, then the joints that carry their vertices.

use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::scene::{Graph, Mesh, Node, Skin};

/// Whether a node shows `mesh` other than it is.
pub fn is_deformed(mesh: &Mesh, node: &Node) -> bool {
    let is_morphed = !mesh.morphs.is_empty() && !node.morph_weights.is_empty();
    is_morphed || is_skinned(mesh, node)
}

fn is_skinned(mesh: &Mesh, node: &Node) -> bool {
    mesh.skin.is_some() && !node.joints.is_empty()
}

/// `mesh` as the node at `node_idx` bends it, in that node's coordinates.
pub fn deformed(mesh: &Mesh, graph: &Graph, node_idx: usize, world: &[DAffine3]) -> Mesh {
    let node = &graph.nodes[node_idx];
    let mut bent = Mesh { morphs: Vec::new(), skin: None, ..mesh.clone() };
    for (morph, &weight) in mesh.morphs.iter().zip(&node.morph_weights).filter(|(_, w)| **w != 0.0)
    {
        for (position, offset) in bent.positions.iter_mut().zip(&morph.positions) {
            *position += weight * offset;
        }
        if let (Some(normals), Some(offsets)) = (&mut bent.normals, &morph.normals) {
            for (normal, offset) in normals.iter_mut().zip(offsets) {
                *normal += weight * offset;
            }
        }
    }
    if let (Some(skin), true) = (&mesh.skin, is_skinned(mesh, node)) {
        let node_from_world = world[node_idx].inverse();
        let carry = node.joints.iter().map(|joint| {
            let node_from_mesh = node_from_world * world[joint.node] * joint.joint_from_mesh;
            let about_origin = DAffine3::from_translation(-mesh.origin)
                * node_from_mesh
                * DAffine3::from_translation(mesh.origin);
            (about_origin, about_origin.matrix3.inverse().transpose())
        });
        carry_by_joints(&mut bent, skin, &carry.collect::<Vec<_>>());
    }
    if let Some(normals) = &mut bent.normals {
        normals.iter_mut().for_each(|normal| *normal = normal.normalize_or(Vec3::Z));
    }
    bent
}

/// Linear blend skinning; `carry` has what each joint does to places and to normals.
fn carry_by_joints(bent: &mut Mesh, skin: &Skin, carry: &[(DAffine3, DMat3)]) {
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
        if let Some(normals) = &mut bent.normals {
            let normal = normals[vertex].as_dvec3();
            let turned = joints.map(|((_, turn_by), weight)| weight * (*turn_by * normal));
            normals[vertex] = turned.sum::<DVec3>().as_vec3();
        }
    }
}

//! The animation of a graph, evaluated at a time.

use super::animation::{Channel, Track};
use super::graph::{Graph, Transform};
use crate::math::{DQuat, DVec3};

impl<C> Graph<C> {
    /// Sets the animated properties of all nodes to their values at a time.
    pub fn evaluate_at(&mut self, time_secs: f64) {
        let Self { nodes, animation, .. } = self;
        for Channel { node, track } in &animation.channels {
            let node = &mut nodes[*node];
            match track {
                Track::MorphWeights(keys) => node.morph_weights = keys.at(time_secs),
                Track::Visible(keys) => node.is_visible = keys.at(time_secs),
                Track::Translation(keys) => *trs_mut(&mut node.transform).0 = keys.at(time_secs),
                Track::Rotation(keys) => *trs_mut(&mut node.transform).1 = keys.at(time_secs),
                Track::Scale(keys) => *trs_mut(&mut node.transform).2 = keys.at(time_secs),
            }
        }
    }
}

/// Returns the translation, rotation and scale of a transform; a matrix is decomposed first.
fn trs_mut(transform: &mut Transform) -> (&mut DVec3, &mut DQuat, &mut DVec3) {
    if let Transform::Matrix(matrix) = transform {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        *transform = Transform::Trs { translation, rotation, scale };
    }
    match transform {
        Transform::Trs { translation, rotation, scale } => (translation, rotation, scale),
        Transform::Matrix(_) => unreachable!("matrices are decomposed above"),
    }
}

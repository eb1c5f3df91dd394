//! Parts of a graph that depend on the scene's up, which is chosen once the files are read.

use surfel_core::math::{DQuat, DVec3, Vec3};
use surfel_core::scene::{Graph, Track, Transform};

/// Parts of a graph that were made as if up were +Z.
#[derive(Clone, Debug, Default)]
pub(in crate::resolve) struct UpParts {
    /// Indices of the channels that turn objects about the up axis.
    pub orbits: Vec<usize>,
    /// Indices of the nodes of lamps that shine from above.
    pub lamps: Vec<usize>,
}

impl UpParts {
    /// Turns the parts to where up is.
    pub fn turn(&self, graph: &mut Graph, up: Vec3) {
        if up == Vec3::Z {
            return;
        }
        let up_from_z = DQuat::from_rotation_arc(DVec3::Z, up.as_dvec3().normalize_or(DVec3::Z));
        for channel in &self.orbits {
            if let Track::Rotation(keys) = &mut graph.animation.channels[*channel].track {
                let turned = |turn: &DQuat| up_from_z * *turn * up_from_z.inverse();
                keys.values = keys.values.iter().map(turned).collect();
            }
        }
        for node in &self.lamps {
            if let Transform::Trs { rotation, .. } = &mut graph.nodes[*node].transform {
                *rotation = up_from_z * *rotation;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    //! Orbits and lamps where up is +Y or +Z.

    use crate::description::SceneDescription;
    use crate::memory_files::MemoryContent;
    use crate::resolve;
    use serde_json::json;
    use std::path::Path;
    use std::sync::Arc;
    use surfel_core::math::{DVec3, Vec3};
    use surfel_core::points::PointCloud;
    use surfel_core::progress::NoProgress;

    /// Returns where an object at +X is after a quarter of its orbit, and where a parallel lamp shines.
    fn orbit_and_lamp(up: Vec3) -> [DVec3; 2] {
        let corner = |i: u32| Vec3::new((i % 20) as f32, (i / 20) as f32, (i % 3) as f32);
        let cloud = PointCloud::from_positions((0..400).map(corner).collect());
        let table = json!({
            "object": [{ "file": "memory:moon", "name": "moon", "translate": [1, 0, 0] }],
            "animation": [{
                "object": "moon", "kind": "orbit", "seconds": 1, "turns": 0.25, "center": [0, 0, 0],
            }],
            "lamp": [{ "kind": "directional" }],
        });
        let mut description =
            SceneDescription::from_table(table.as_object().unwrap(), Path::new("")).unwrap();
        description.memory.insert("memory:moon", MemoryContent::Points(Arc::new(cloud), None));
        description.world.up = Some(up);
        let mut graph = resolve(&description, &NoProgress).unwrap().scene.graph;
        graph.evaluate_at(1.0);
        let lamp = graph.nodes.iter().find(|node| node.light.is_some()).unwrap();
        let shines_toward = lamp.transform.matrix().transform_vector3(-DVec3::Z);
        [graph.world_from_geometries()[0].translation, shines_toward]
    }

    #[test]
    fn orbits_and_parallel_lamps_follow_up() {
        let near = |a: DVec3, b: DVec3| a.distance(b) < 1e-6;
        let [position, shines_toward] = orbit_and_lamp(Vec3::Z);
        assert!(near(position, DVec3::Y) && near(shines_toward, -DVec3::Z), "{position}");
        let [position, shines_toward] = orbit_and_lamp(Vec3::Y);
        assert!(near(position, -DVec3::Z) && near(shines_toward, -DVec3::Y), "{position}");
    }
}

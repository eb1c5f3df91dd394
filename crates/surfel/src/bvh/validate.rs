//! Checks that a tree is one: run after each build in debug, and by tests.

use super::{Bvh, Child, MAX_DEPTH, NO_PRIMITIVE, Primitive};
use crate::math::Aabb;
use std::collections::HashMap;

impl Bvh {
    /// Panics unless every primitive is in exactly one block and inside all boxes above it.
    pub fn validate(&self, primitives: &[Primitive]) {
        let bounds: HashMap<u32, Aabb> = primitives.iter().map(|p| (p.index, p.bounds)).collect();
        let mut seen = HashMap::new();
        let mut open =
            vec![(0, Aabb { min: glam::Vec3::NEG_INFINITY, max: glam::Vec3::INFINITY }, 1)];
        while let Some((node_idx, above, depth)) = open.pop().filter(|_| !self.nodes.is_empty()) {
            assert!(depth <= MAX_DEPTH, "{depth} levels");
            let node = &self.nodes[node_idx];
            for lane in 0..node.children.len() {
                // Children are encoded on another grid than their parent: what counts is that both contain the primitives.
                match node.child(lane) {
                    None => {}
                    Some(Child::Node(child)) => {
                        open.push((child as usize, node.bounds(lane), depth + 1))
                    }
                    Some(Child::Block(block)) => {
                        for &index in
                            self.blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE)
                        {
                            assert!(
                                node.bounds(lane).contains(bounds[&index]),
                                "primitive {index} sticks out"
                            );
                            assert!(
                                above.contains(bounds[&index]),
                                "primitive {index} sticks out above"
                            );
                            *seen.entry(index).or_insert(0) += 1;
                        }
                    }
                }
            }
        }
        assert_eq!(seen.len(), primitives.len(), "primitives reached");
        assert!(seen.values().all(|&n| n == 1), "a primitive stands in two blocks");
    }
}

//! The nearest points to a few places, found by looking at all: cheaper than a tree for a hundred of them.

use super::{Neighbor, distance_squared};
use crate::math::Vec3;

/// The k nearest other points to one of `positions`, nearest first.
pub fn nearest_by_brute_force(positions: &[Vec3], point: usize, k: usize) -> Vec<Neighbor> {
    let mut nearest: Vec<Neighbor> = Vec::new();
    let mut bound = f32::INFINITY;
    let by_distance =
        |a: &Neighbor, b: &Neighbor| a.distance_squared.total_cmp(&b.distance_squared);
    for (other, position) in positions.iter().enumerate() {
        let squared = distance_squared(*position, positions[point]);
        if squared < bound && other != point {
            nearest.push(Neighbor { index: other as u32, distance_squared: squared });
            if nearest.len() == 2 * k {
                bound = nearest.select_nth_unstable_by(k - 1, by_distance).1.distance_squared;
                nearest.truncate(k);
            }
        }
    }
    nearest.sort_unstable_by(by_distance);
    nearest.truncate(k);
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::points::neighbors::Tree;
    use crate::progress::Silent;

    #[test]
    fn it_finds_what_the_tree_finds() {
        let mut random = Random::new(3, 0);
        let positions: Vec<Vec3> = (0..500)
            .map(|_| Vec3::new(random.next_f32(), random.next_f32(), random.next_f32()))
            .collect();
        let tree = Tree::new(&positions, &Silent).unwrap();
        for k in [1, 5, 499, 600] {
            let expected = tree.nearest(positions[9], k, Some(9));
            assert_eq!(nearest_by_brute_force(&positions, 9, k), expected);
        }
    }
}

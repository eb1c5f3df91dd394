//! Brute-force search, cheaper than a tree for about a hundred points.

use super::neighbor::{Neighbor, distance_squared};
use crate::math::Vec3;

/// Returns the k points nearest to the given one, nearest first.
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
    //! Comparison with the tree.

    use super::*;
    use crate::math::Random;
    use crate::points::neighbors::KdTree;
    use crate::progress::NoProgress;

    #[test]
    fn the_result_equals_that_of_the_tree() {
        let mut random = Random::new(3, 0);
        let positions: Vec<Vec3> = (0..500)
            .map(|_| Vec3::new(random.next_f32(), random.next_f32(), random.next_f32()))
            .collect();
        let tree = KdTree::new(&positions, &NoProgress).unwrap();
        for k in [1, 5, 499, 600] {
            let expected = tree.nearest(positions[9], k, Some(9));
            assert_eq!(nearest_by_brute_force(&positions, 9, k), expected);
        }
    }
}

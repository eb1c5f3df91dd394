//! Partition of primitives about a split, in place and by many threads.

use super::primitive::{BvhPrimitive, Extent};
use rayon::prelude::*;

/// Number of primitives that one thread moves at a time: they fill half of a second-level cache.
pub(super) const CHUNK: usize = 8192;

/// The result of splitting a range of primitives.
pub(super) struct Partition {
    /// Number of primitives on the left side.
    pub n_left: usize,
    /// Extents of the left and right side.
    pub extents: [Extent; 2],
}

impl Partition {
    /// Returns the split of primitives that are already partitioned at `n_left`.
    pub fn at(primitives: &[BvhPrimitive], n_left: usize) -> Self {
        let (left, right) = primitives.split_at(n_left);
        Self { n_left, extents: [extent_of(left), extent_of(right)] }
    }
}

/// Returns the extent of a range.
pub(super) fn extent_of(primitives: &[BvhPrimitive]) -> Extent {
    if primitives.len() <= CHUNK {
        return Extent::of(primitives);
    }
    primitives.par_chunks(CHUNK).map(Extent::of).reduce(|| Extent::EMPTY, Extent::union)
}

/// Moves the primitives of the left side to the front.
///
/// Each chunk is partitioned on its own, then primitives on the wrong side of the whole range are swapped.
pub(super) fn partition(
    primitives: &mut [BvhPrimitive],
    is_left: impl Fn(&BvhPrimitive) -> bool + Sync,
) -> Partition {
    let partition_one = |chunk: &mut [BvhPrimitive]| {
        let n_left = partition_chunk(chunk, &is_left);
        Partition::at(chunk, n_left)
    };
    if primitives.len() <= CHUNK {
        return partition_one(primitives);
    }
    let chunks: Vec<Partition> = primitives.par_chunks_mut(CHUNK).map(partition_one).collect();
    let n_left = chunks.iter().map(|sides| sides.n_left).sum();
    let side = |i: usize| chunks.iter().fold(Extent::EMPTY, |all, s| all.union(s.extents[i]));
    let extents = [side(0), side(1)];
    swap_misplaced(primitives, &chunks, n_left);
    Partition { n_left, extents }
}

/// Moves the primitives of the left side to the front and returns their number. It does not branch on the data,
/// because such branches would be mispredicted half of the time.
pub(super) fn partition_chunk(
    primitives: &mut [BvhPrimitive],
    is_left: impl Fn(&BvhPrimitive) -> bool,
) -> usize {
    let mut n_left = 0;
    for i in 0..primitives.len() {
        // Both are read before both are written, because `swap` goes through memory.
        let (primitive, first_right) = (primitives[i], primitives[n_left]);
        (primitives[i], primitives[n_left]) = (first_right, primitive);
        n_left += usize::from(is_left(&primitive));
    }
    n_left
}

/// Swaps the primitives that are on the wrong side of `n_left`.
fn swap_misplaced(primitives: &mut [BvhPrimitive], chunks: &[Partition], n_left: usize) {
    let (mut right_in_front, mut left_behind) = (Vec::new(), Vec::new());
    for (i, chunk) in primitives.chunks_mut(CHUNK).enumerate() {
        let split = n_left.saturating_sub(i * CHUNK).min(chunk.len());
        let n_left_here = chunks[i].n_left;
        if n_left_here < split {
            right_in_front.push(&mut chunk[n_left_here..split]);
        } else {
            left_behind.push(&mut chunk[split..n_left_here]);
        }
    }
    pair_slices(right_in_front, left_behind)
        .into_par_iter()
        .for_each(|(a, b)| a.swap_with_slice(b));
}

/// Splits two lists of slices with the same number of primitives into pairs of equal length.
fn pair_slices<'p>(
    a: Vec<&'p mut [BvhPrimitive]>,
    b: Vec<&'p mut [BvhPrimitive]>,
) -> Vec<(&'p mut [BvhPrimitive], &'p mut [BvhPrimitive])> {
    let (mut rest_a, mut rest_b): (&mut [BvhPrimitive], &mut [BvhPrimitive]) = (&mut [], &mut []);
    let (mut a, mut b) = (a.into_iter(), b.into_iter());
    let mut pairs = Vec::new();
    loop {
        while rest_a.is_empty() {
            let Some(next) = a.next() else { return pairs };
            rest_a = next;
        }
        while rest_b.is_empty() {
            let Some(next) = b.next() else { return pairs };
            rest_b = next;
        }
        let n = rest_a.len().min(rest_b.len());
        let (left, right) = (rest_a.split_at_mut(n), rest_b.split_at_mut(n));
        pairs.push((left.0, right.0));
        (rest_a, rest_b) = (left.1, right.1);
    }
}

#[cfg(test)]
mod tests {
    //! A partition moves every primitive to its side and loses none.

    use super::*;
    use crate::math::{Aabb, Random, Vec3};

    #[test]
    fn every_primitive_is_moved_to_its_side() {
        let mut random = Random::new(4, 0);
        for (n, split) in
            [(1, 0.5), (100, 0.5), (CHUNK * 5 + 77, 0.3), (CHUNK * 3, 0.0), (CHUNK * 4, 1.0)]
        {
            let mut primitives: Vec<BvhPrimitive> = (0..n)
                .map(|i| {
                    let point = Vec3::new(random.next_f32(), 0.0, 0.0);
                    BvhPrimitive::new(Aabb::of_points([point]), i as u32, 0.0)
                })
                .collect();
            let is_left = |p: &BvhPrimitive| p.bounds().min.x < split;
            let sides = partition(&mut primitives, is_left);
            assert!(primitives[..sides.n_left].iter().all(is_left));
            assert!(!primitives[sides.n_left..].iter().any(is_left));
            let mut indices: Vec<u32> = primitives.iter().map(BvhPrimitive::index).collect();
            indices.sort_unstable();
            assert!(indices.into_iter().eq(0..n as u32));
        }
    }
}

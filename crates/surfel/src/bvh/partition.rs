//! Moving primitives to their side of a split, in place and by many threads.

use super::primitive::{Extent, Primitive};
use rayon::prelude::*;

/// Primitives that one thread moves at a time: half of a second-level cache.
pub(super) const CHUNK: usize = 8192;

/// A range that was split.
pub(super) struct Sides {
    pub n_left: usize,
    pub extents: [Extent; 2],
}

impl Sides {
    /// Of primitives that already stand where they belong.
    pub fn at(primitives: &[Primitive], n_left: usize) -> Self {
        let (left, right) = primitives.split_at(n_left);
        Self { n_left, extents: [extent_of(left), extent_of(right)] }
    }
}

pub(super) fn extent_of(primitives: &[Primitive]) -> Extent {
    if primitives.len() <= CHUNK {
        return Extent::of(primitives);
    }
    primitives.par_chunks(CHUNK).map(Extent::of).reduce(|| Extent::EMPTY, Extent::union)
}

/// Moves the primitives that are left to the front.
///
/// Chunks are partitioned on their own, then what stands on the wrong side of the whole is swapped.
pub(super) fn partition(
    primitives: &mut [Primitive],
    is_left: impl Fn(&Primitive) -> bool + Sync,
) -> Sides {
    let one = |chunk: &mut [Primitive]| {
        let n_left = partition_chunk(chunk, &is_left);
        Sides::at(chunk, n_left)
    };
    if primitives.len() <= CHUNK {
        return one(primitives);
    }
    let chunks: Vec<Sides> = primitives.par_chunks_mut(CHUNK).map(one).collect();
    let n_left = chunks.iter().map(|sides| sides.n_left).sum();
    let side = |i: usize| chunks.iter().fold(Extent::EMPTY, |all, s| all.union(s.extents[i]));
    let extents = [side(0), side(1)];
    swap_strays(primitives, &chunks, n_left);
    Sides { n_left, extents }
}

/// Without branches on the data, which would be mispredicted half of the time.
pub(super) fn partition_chunk(
    primitives: &mut [Primitive],
    is_left: impl Fn(&Primitive) -> bool,
) -> usize {
    let mut n_left = 0;
    for i in 0..primitives.len() {
        // Both read before both written: `swap` goes by way of memory.
        let (primitive, first_right) = (primitives[i], primitives[n_left]);
        (primitives[i], primitives[n_left]) = (first_right, primitive);
        n_left += usize::from(is_left(&primitive));
    }
    n_left
}

fn swap_strays(primitives: &mut [Primitive], chunks: &[Sides], n_left: usize) {
    let (mut in_front, mut behind) = (Vec::new(), Vec::new());
    for (i, chunk) in primitives.chunks_mut(CHUNK).enumerate() {
        let border = n_left.saturating_sub(i * CHUNK).min(chunk.len());
        let found = chunks[i].n_left;
        if found < border {
            in_front.push(&mut chunk[found..border]);
        } else {
            behind.push(&mut chunk[border..found]);
        }
    }
    pairs(in_front, behind).into_par_iter().for_each(|(a, b)| a.swap_with_slice(b));
}

/// Cuts two lists of slices with the same number of primitives into pairs of equal length.
fn pairs<'p>(
    a: Vec<&'p mut [Primitive]>,
    b: Vec<&'p mut [Primitive]>,
) -> Vec<(&'p mut [Primitive], &'p mut [Primitive])> {
    let (mut rest_a, mut rest_b): (&mut [Primitive], &mut [Primitive]) = (&mut [], &mut []);
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
    use super::*;
    use crate::math::{Aabb, Random, Vec3};

    #[test]
    fn every_primitive_stands_on_its_side() {
        let mut random = Random::new(4, 0);
        for (n, share) in
            [(1, 0.5), (100, 0.5), (CHUNK * 5 + 77, 0.3), (CHUNK * 3, 0.0), (CHUNK * 4, 1.0)]
        {
            let mut primitives: Vec<Primitive> = (0..n)
                .map(|i| {
                    let point = Vec3::new(random.next_f32(), 0.0, 0.0);
                    Primitive::new(Aabb::of_points([point]), i as u32, 0.0)
                })
                .collect();
            let is_left = |p: &Primitive| p.bounds().min.x < share;
            let sides = partition(&mut primitives, is_left);
            assert!(primitives[..sides.n_left].iter().all(is_left));
            assert!(!primitives[sides.n_left..].iter().any(is_left));
            let mut indices: Vec<u32> = primitives.iter().map(Primitive::index).collect();
            indices.sort_unstable();
            assert!(indices.into_iter().eq(0..n as u32));
        }
    }
}

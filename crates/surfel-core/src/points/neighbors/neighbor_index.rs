//! Searches for the neighbourhoods of all points, in parallel.

use super::neighbor::Neighbor;
use crate::error::Result;
use crate::math::Vec3;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;

/// A search structure that finds the neighbourhoods of all its points in an order of its own.
pub(super) trait NeighborIndex: Sync {
    /// Returns the number of slots. Each has a point, in the order of the structure.
    fn n_slots(&self) -> usize;

    /// Returns the number of slots that a task should take.
    fn chunk_size(&self) -> usize;

    /// Calls `visit` with the index and the sorted neighbours of each point in `slots`.
    fn visit_slots(
        &self,
        slots: Range<usize>,
        progress: &dyn Progress,
        visit: impl FnMut(u32, &[Neighbor]),
    ) -> Result<()>;
}

/// Returns `visit(point, neighbours)` of every point, in the order of the points.
pub(super) fn map<T: Copy + Default + Send + Sync>(
    index: &impl NeighborIndex,
    positions: &[Vec3],
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
) -> Result<Vec<T>> {
    let mut values = vec![T::default(); positions.len()];
    let n_slots = index.n_slots();
    progress.begin("neighbours", n_slots as u64);
    // Blocks bound the memory of values that are not yet in the order of the points, and keep all threads busy.
    let block_size = block_size(index.chunk_size(), rayon::current_num_threads());
    for block in ranges(0..n_slots, block_size) {
        let chunks: Vec<Range<usize>> = ranges(block, index.chunk_size()).collect();
        let visited = chunks.into_par_iter().map(|slots| {
            progress.check()?;
            let n_slots = slots.len();
            let mut visited = Vec::with_capacity(n_slots);
            index.visit_slots(slots, progress, |point, neighbors| {
                visited.push((point, visit(point as usize, neighbors)));
            })?;
            visited.sort_unstable_by_key(|(point, _)| *point);
            progress.advance(n_slots as u64);
            Ok(visited)
        });
        scatter(&visited.collect::<Result<Vec<_>>>()?, &mut values);
    }
    for (point, _) in positions.iter().enumerate().filter(|(_, p)| !p.is_finite()) {
        values[point] = visit(point, &[]);
    }
    Ok(values)
}

/// Returns the number of slots whose values are put in order together: enough chunks for all threads.
fn block_size(chunk_size: usize, n_threads: usize) -> usize {
    (2 * n_threads * chunk_size).max(1 << 18)
}

/// Writes visited values, of which each list is in the order of the points, to `values`, of which each thread owns a part.
fn scatter<T: Copy + Send + Sync>(visited: &[Vec<(u32, T)>], values: &mut [T]) {
    let part_size = values.len().div_ceil(rayon::current_num_threads()).max(1);
    values.par_chunks_mut(part_size).enumerate().for_each(|(part, values)| {
        let (first, end) = (part * part_size, part * part_size + values.len());
        for visited in visited {
            let start = visited.partition_point(|(point, _)| (*point as usize) < first);
            for &(point, value) in &visited[start..] {
                if end <= point as usize {
                    break;
                }
                values[point as usize - first] = value;
            }
        }
    });
}

/// Splits a range into ranges of `size`, the last of which may be shorter.
fn ranges(whole: Range<usize>, size: usize) -> impl Iterator<Item = Range<usize>> {
    let end = whole.end;
    whole.step_by(size).map(move |first| first..end.min(first + size))
}

#[cfg(test)]
mod tests {
    //! Blocks.

    use super::*;

    #[test]
    fn large_chunks_leave_no_thread_idle() {
        assert_eq!(block_size(4096, 2), 1 << 18);
        let chunk_size = (100 << 20) / 64;
        assert!(16 * chunk_size <= block_size(chunk_size, 16));
    }
}

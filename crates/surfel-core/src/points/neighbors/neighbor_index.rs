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

/// Results of some points, in lists of which each is in the order of the points.
pub(crate) struct Visited<T>(Vec<Vec<(u32, T)>>);

impl<T: Sync> Visited<T> {
    /// Writes a part of each result to the place of its point in a column of all points, of which each thread owns a part.
    pub fn scatter<U: Send>(&self, column: &mut [U], part: impl Fn(&T) -> U + Sync) {
        let part_size = column.len().div_ceil(rayon::current_num_threads()).max(1);
        column.par_chunks_mut(part_size).enumerate().for_each(|(chunk, column)| {
            let (first, end) = (chunk * part_size, chunk * part_size + column.len());
            for visited in &self.0 {
                let start = visited.partition_point(|(point, _)| (*point as usize) < first);
                for (point, result) in &visited[start..] {
                    if end <= *point as usize {
                        break;
                    }
                    column[*point as usize - first] = part(result);
                }
            }
        });
    }
}

/// Returns `visit(point, neighbours)` of every point, in the order of the points.
pub(super) fn map<T: Copy + Default + Send + Sync>(
    index: &impl NeighborIndex,
    positions: &[Vec3],
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
) -> Result<Vec<T>> {
    let mut values = vec![T::default(); positions.len()];
    let store = |visited: Visited<T>| visited.scatter(&mut values, |value| *value);
    visit_in_blocks(index, positions, progress, visit, store)?;
    Ok(values)
}

/// Passes `visit(point, neighbours)` of every point to `store`, those of one block of slots after the other.
pub(super) fn visit_in_blocks<T: Send + Sync>(
    index: &impl NeighborIndex,
    positions: &[Vec3],
    progress: &dyn Progress,
    visit: impl Fn(usize, &[Neighbor]) -> T + Sync,
    mut store: impl FnMut(Visited<T>),
) -> Result<()> {
    let n_slots = index.n_slots();
    progress.begin("neighbours", n_slots as u64);
    // Blocks bound the memory of results that are not yet in the order of the points, and keep all threads busy.
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
        store(Visited(visited.collect::<Result<Vec<_>>>()?));
    }
    let not_finite = positions.iter().enumerate().filter(|(_, p)| !p.is_finite());
    let visited = not_finite.map(|(point, _)| (point as u32, visit(point, &[])));
    store(Visited(vec![visited.collect()]));
    Ok(())
}

/// Returns the number of slots whose values are put in order together: enough chunks for all threads.
fn block_size(chunk_size: usize, n_threads: usize) -> usize {
    (2 * n_threads * chunk_size).max(1 << 18)
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

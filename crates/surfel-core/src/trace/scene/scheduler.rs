//! The order in which rays visit instances: in each round, every active ray goes to the instance whose box it
//! enters next.

use crate::flat::FlatScene;
use crate::math::{Aabb, PACKET_WIDTH, Ray};
use crate::trace::scene::box_entries::{BoxEntries, box_entries};
use crate::trace::scene::instance_filter::InstanceFilter;
use crate::trace::scene::tlas::{TlasEntries, tlas_entries};
use crate::trace::simd::Simd;
use std::ops::Range;

/// Schedules the visits of rays to instances.
pub struct InstanceScheduler {
    visits: Visits,
    /// Instances, each with the rays that visit it next, in their order, so that they form packets.
    batches: Vec<(u32, RayRanges)>,
}

/// Rising indices of rays as ranges of neighbours: most rays go where their neighbours go, and ranges are
/// copied as a whole.
#[derive(Default)]
pub struct RayRanges(Vec<Range<usize>>);

impl RayRanges {
    fn push(&mut self, range: Range<usize>) {
        match self.0.last_mut() {
            Some(last) if last.end == range.start => last.end = range.end,
            _ => self.0.push(range),
        }
    }

    /// True if there are no rays.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Iterates over the ranges.
    pub fn iter(&self) -> impl Iterator<Item = Range<usize>> {
        self.0.iter().cloned()
    }

    /// Iterates over the ranges, each with its range of positions when all are put one after the other.
    pub fn with_positions(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let mut end = 0;
        self.0.iter().map(move |range| {
            let first = end;
            end += range.len();
            (range.clone(), first..end)
        })
    }
}

enum Visits {
    /// The visits to few instances, found without a tree.
    BruteForce {
        /// Entry distances: `entries[row * n_instances + i]`.
        entries: Vec<BoxEntries>,
        /// Rows of rays that are still active.
        active_rows: Vec<u32>,
    },
    /// The visits to many instances, found by their tree.
    Tlas {
        /// Entry distances and instances, sorted by distance for each ray, one ray after the other.
        entries: Vec<(f32, u32)>,
        /// Active rays, each with the range of `entries` that is left.
        active_rays: Vec<(u32, Range<u32>)>,
        /// Instances and rays of the next round. The memory is reused.
        visits: Vec<(u32, u32)>,
    },
}

/// Maximum number of instances whose boxes are tested one by one. With more, the tree over them is faster.
const MAX_BRUTE_FORCE: usize = 16;

impl InstanceScheduler {
    /// Schedules the visits of `rays` to the accepted instances.
    pub fn new(scene: &FlatScene, simd: Simd, filter: InstanceFilter, rays: &[Ray]) -> Self {
        let accepted = scene.instances.iter().enumerate();
        let accepted = accepted.filter(|(_, instance)| filter.accepts(instance));
        let instances: Vec<u32> =
            accepted.take(MAX_BRUTE_FORCE + 1).map(|(i, _)| i as u32).collect();
        if MAX_BRUTE_FORCE < instances.len() {
            return Self { visits: tlas_visits(scene, simd, filter, rays), batches: Vec::new() };
        }
        let boxes: Vec<Aabb> =
            instances.iter().map(|&i| scene.instances[i as usize].bounds).collect();
        let n_rows = rays.len().div_ceil(PACKET_WIDTH);
        let mut entries = vec![BoxEntries::NONE; n_rows * boxes.len()];
        box_entries(&boxes, simd, rays, &mut entries);
        let active_rows = (0..n_rows as u32).collect();
        let batches = instances.into_iter().map(|instance| (instance, RayRanges::default()));
        Self { visits: Visits::BruteForce { entries, active_rows }, batches: batches.collect() }
    }

    /// Returns the next visit of each ray that has one within its limit, by instance, or `None` if no ray
    /// has.
    pub fn next(&mut self, limits: &[f32]) -> Option<&[(u32, RayRanges)]> {
        let Self { visits, batches } = self;
        let n_batches = match visits {
            Visits::BruteForce { entries, active_rows } => {
                next_brute_force(entries, active_rows, batches, limits)
            }
            Visits::Tlas { entries, active_rays, visits } => {
                next_of_tlas(entries, active_rays, visits, limits);
                group_by_instance(visits, batches)
            }
        };
        (0 < n_batches).then_some(&batches[..n_batches])
    }
}

/// Adds the rays of each row to the batch of the instance that the row visits next, if they enter its box
/// within their limits, and returns the number of batches.
///
/// Sixteen rays choose at a time: one by one that took a twentieth of the search among points.
fn next_brute_force(
    entries: &mut [BoxEntries],
    active_rows: &mut Vec<u32>,
    batches: &mut [(u32, RayRanges)],
    limits: &[f32],
) -> usize {
    batches.iter_mut().for_each(|(_, ranges)| ranges.0.clear());
    let mut any_goes = false;
    active_rows.retain(|&row| {
        let entries = &mut entries[row as usize * batches.len()..][..batches.len()];
        let first = row as usize * PACKET_WIDTH;
        let limits = &limits[first..first + PACKET_WIDTH];
        while let Some(nearest) = nearest_box(entries) {
            entries[nearest].nearest = f32::INFINITY;
            if add_rays(&mut batches[nearest].1, first, &entries[nearest].of_rays, limits) {
                any_goes = true;
                return true;
            }
        }
        false
    });
    if any_goes { batches.len() } else { 0 }
}

/// Returns the index of the box that any ray of the row enters first.
fn nearest_box(entries: &[BoxEntries]) -> Option<usize> {
    let (mut nearest, mut entry) = (0, f32::INFINITY);
    for (i, other) in entries.iter().enumerate() {
        // Two selections replace one branch, which would be unpredictable.
        nearest = if other.nearest < entry { i } else { nearest };
        entry = entry.min(other.nearest);
    }
    (entry < f32::INFINITY).then_some(nearest)
}

/// Adds those rays of the row from `first` that enter a box within their limits, and returns whether any
/// does.
fn add_rays(
    ranges: &mut RayRanges,
    first: usize,
    entries: &[f32; PACKET_WIDTH],
    limits: &[f32],
) -> bool {
    let goes = |(entry, limit): (&f32, &f32)| (*entry < f32::INFINITY) & (entry <= limit);
    let n_going: u32 = entries.iter().zip(limits).map(|pair| u32::from(goes(pair))).sum();
    if n_going as usize == PACKET_WIDTH {
        ranges.push(first..first + PACKET_WIDTH);
    } else if 0 < n_going {
        let going = entries.iter().zip(limits).enumerate().filter(|(_, pair)| goes(*pair));
        going.for_each(|(lane, _)| ranges.push(first + lane..first + lane + 1));
    }
    0 < n_going
}

/// Finds all visits of each ray by the tree over the instances.
fn tlas_visits(scene: &FlatScene, simd: Simd, filter: InstanceFilter, rays: &[Ray]) -> Visits {
    let mut found = TlasEntries::default();
    tlas_entries(scene, simd, filter, rays, &mut found);
    Visits::Tlas { entries: found.entries, active_rays: found.rays, visits: Vec::new() }
}

/// Lists the next visit of each ray that has one within its limit.
fn next_of_tlas(
    entries: &[(f32, u32)],
    active_rays: &mut Vec<(u32, Range<u32>)>,
    visits: &mut Vec<(u32, u32)>,
    limits: &[f32],
) {
    visits.clear();
    active_rays.retain_mut(|(ray, left)| {
        let Some(next) = left.next() else { return false };
        let (entry, instance) = entries[next as usize];
        let goes = entry <= limits[*ray as usize];
        if goes {
            visits.push((instance, *ray));
        }
        goes
    });
}

/// Groups visits by instance to batches, whose memory is reused, and returns the number of batches.
fn group_by_instance(visits: &mut [(u32, u32)], batches: &mut Vec<(u32, RayRanges)>) -> usize {
    visits.sort_by_key(|(instance, _)| *instance);
    let mut n_batches = 0;
    for group in visits.chunk_by(|a, b| a.0 == b.0) {
        if n_batches == batches.len() {
            batches.push((0, RayRanges::default()));
        }
        let (instance, ranges) = &mut batches[n_batches];
        *instance = group[0].0;
        ranges.0.clear();
        group.iter().for_each(|(_, ray)| ranges.push(*ray as usize..*ray as usize + 1));
        n_batches += 1;
    }
    n_batches
}

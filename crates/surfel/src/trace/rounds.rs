//! Which rays go to which instance next: in each round, every ray that still looks on goes to the instance
//! whose box it enters next.

use super::boxes::Entries;
use super::node::{BoxRay, ray_entries};
use super::world::Which;
use super::{Simd, box_entries};
use crate::bvh::{Child, NO_PRIMITIVE, STACK_SIZE};
use crate::flat::{FlatScene, Instance};
use crate::math::{Aabb, LaneMask, PortableLanes, Ray, Vec3, WIDE};
use std::ops::Range;

/// Where the rays still have to go.
pub(super) struct Rounds {
    visits: Visits,
    /// Instances, each with the rays that visit it next, in their order: that is what makes packets.
    batches: Vec<(u32, Runs)>,
}

/// Indices of rays, rising, as ranges of neighbours: most rays go where those beside them go, and what
/// stands together is copied as a whole.
#[derive(Default)]
pub(super) struct Runs(Vec<Range<usize>>);

impl Runs {
    fn push(&mut self, run: Range<usize>) {
        match self.0.last_mut() {
            Some(last) if last.end == run.start => last.end = run.end,
            _ => self.0.push(run),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Range<usize>> {
        self.0.iter().cloned()
    }

    /// Each run, and where its rays are when all runs are put one after another.
    pub(super) fn placed(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        let mut end = 0;
        self.0.iter().map(move |run| {
            let first = end;
            end += run.len();
            (run.clone(), first..end)
        })
    }
}

enum Visits {
    /// Of few instances: where the sixteen rays of each row enter the box of each, row after row; and the rows
    /// still on their way.
    Few { entries: Vec<Entries>, open: Vec<u32> },
    /// Of many: all that each ray comes by, sorted by where it enters, one ray's after another's; and what
    /// is left of that of each ray still on its way. `jobs` is room for the next round.
    Many { entries: Vec<(f32, u32)>, left: Vec<(u32, Range<u32>)>, jobs: Vec<(u32, u32)> },
}

/// With more instances, the tree over them is asked: their boxes one by one would cost more.
const FEW: usize = 16;

impl Rounds {
    pub(super) fn new(scene: &FlatScene, simd: Simd, which: Which, rays: &[Ray]) -> Self {
        let counting = scene.instances.iter().enumerate();
        let counting = counting.filter(|(_, instance)| which.counts(instance));
        let instances: Vec<u32> = counting.take(FEW + 1).map(|(i, _)| i as u32).collect();
        if FEW < instances.len() {
            return Self { visits: visits_of_many(scene, which, rays), batches: Vec::new() };
        }
        let boxes: Vec<Aabb> =
            instances.iter().map(|&i| scene.instances[i as usize].bounds).collect();
        let n_rows = rays.len().div_ceil(WIDE);
        let mut entries = vec![Entries::NONE; n_rows * boxes.len()];
        box_entries(&boxes, simd, rays, &mut entries);
        Self {
            visits: Visits::Few { entries, open: (0..n_rows as u32).collect() },
            batches: instances.into_iter().map(|instance| (instance, Runs::default())).collect(),
        }
    }

    /// The next visit of each ray that has one within its limit; none if no ray has.
    pub(super) fn next(&mut self, limits: &[f32]) -> Option<&[(u32, Runs)]> {
        let Self { visits, batches } = self;
        let n_batches = match visits {
            Visits::Few { entries, open } => next_of_few(entries, open, batches, limits),
            Visits::Many { entries, left, jobs } => {
                next_of_many(entries, left, jobs, limits);
                group(jobs, batches)
            }
        };
        (0 < n_batches).then_some(&batches[..n_batches])
    }
}

/// Puts the rays of each row into the batch of the instance that the row visits next, all of them that
/// meet its box within their limits; how many batches there are then.
///
/// Sixteen rays choose at a time: one by one that cost a twentieth of the search among points.
fn next_of_few(
    entries: &mut [Entries],
    open: &mut Vec<u32>,
    batches: &mut [(u32, Runs)],
    limits: &[f32],
) -> usize {
    batches.iter_mut().for_each(|(_, runs)| runs.0.clear());
    let mut goes_any = false;
    open.retain(|&row| {
        let entries = &mut entries[row as usize * batches.len()..][..batches.len()];
        let first = row as usize * WIDE;
        let limits = &limits[first..first + WIDE];
        while let Some(nearest) = nearest(entries) {
            entries[nearest].nearest = f32::INFINITY;
            if send(&mut batches[nearest].1, first, &entries[nearest].of_rays, limits) {
                goes_any = true;
                return true;
            }
        }
        false
    });
    if goes_any { batches.len() } else { 0 }
}

/// The box that any ray of the row enters first.
fn nearest(entries: &[Entries]) -> Option<usize> {
    let (mut nearest, mut entry) = (0, f32::INFINITY);
    for (i, other) in entries.iter().enumerate() {
        // Two choices instead of one branch, which could not be foretold.
        nearest = if other.nearest < entry { i } else { nearest };
        entry = entry.min(other.nearest);
    }
    (entry < f32::INFINITY).then_some(nearest)
}

/// Adds the rays of the row that begins with `first` which enter a box within their limits, if any does.
fn send(runs: &mut Runs, first: usize, entries: &[f32; WIDE], limits: &[f32]) -> bool {
    let goes = |(entry, limit): (&f32, &f32)| (*entry < f32::INFINITY) & (entry <= limit);
    let n_going: u32 = entries.iter().zip(limits).map(|pair| u32::from(goes(pair))).sum();
    if n_going as usize == WIDE {
        runs.push(first..first + WIDE);
    } else if 0 < n_going {
        let going = entries.iter().zip(limits).enumerate().filter(|(_, pair)| goes(*pair));
        going.for_each(|(lane, _)| runs.push(first + lane..first + lane + 1));
    }
    0 < n_going
}

/// Lists the instances that rays visit next, each with the ray.
fn next_of_many(
    entries: &[(f32, u32)],
    left: &mut Vec<(u32, Range<u32>)>,
    jobs: &mut Vec<(u32, u32)>,
    limits: &[f32],
) {
    jobs.clear();
    left.retain_mut(|(ray, left)| {
        let Some(next) = left.next() else { return false };
        let (entry, instance) = entries[next as usize];
        let goes = entry <= limits[*ray as usize];
        if goes {
            jobs.push((instance, *ray));
        }
        goes
    });
}

/// Makes a batch of all jobs at the same instance, in room that is kept; how many batches there are then.
fn group(jobs: &mut [(u32, u32)], batches: &mut Vec<(u32, Runs)>) -> usize {
    jobs.sort_by_key(|(instance, _)| *instance);
    let mut n_batches = 0;
    for group in jobs.chunk_by(|a, b| a.0 == b.0) {
        if n_batches == batches.len() {
            batches.push((0, Runs::default()));
        }
        let (instance, runs) = &mut batches[n_batches];
        *instance = group[0].0;
        runs.0.clear();
        group.iter().for_each(|(_, ray)| runs.push(*ray as usize..*ray as usize + 1));
        n_batches += 1;
    }
    n_batches
}

fn visits_of_many(scene: &FlatScene, which: Which, rays: &[Ray]) -> Visits {
    let (mut entries, mut left) = (Vec::new(), Vec::with_capacity(rays.len()));
    for (ray_idx, ray) in rays.iter().enumerate() {
        let first = entries.len();
        visit_boxes(scene, which, ray, &mut entries);
        if first < entries.len() {
            entries[first..].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            left.push((ray_idx as u32, first as u32..entries.len() as u32));
        }
    }
    Visits::Many { entries, left, jobs: Vec::new() }
}

/// Adds the instances whose boxes the ray meets, and where it enters them.
fn visit_boxes(scene: &FlatScene, which: Which, ray: &Ray, visits: &mut Vec<(f32, u32)>) {
    let top = &scene.top;
    let Some(root) = top.nodes.first() else { return };
    let prepared = BoxRay::new(root, ray);
    let mut stack = [0; STACK_SIZE];
    let mut size = 1;
    while 0 < size {
        size -= 1;
        let node = &top.nodes[stack[size] as usize];
        let (lanes, _) = ray_entries::<PortableLanes>(node, &prepared, ray.t_max);
        let mut lanes = lanes.bits();
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            match node.child(lane) {
                Some(Child::Node(child)) => {
                    stack[size] = child;
                    size += 1;
                }
                Some(Child::Block(block)) => {
                    for &i in top.blocks[block as usize].iter().filter(|&&i| i != NO_PRIMITIVE) {
                        let instance = &scene.instances[i as usize];
                        if which.counts(instance) {
                            visits.extend(box_entry(instance, ray).map(|entry| (entry, i)));
                        }
                    }
                }
                None => {}
            }
        }
    }
}

/// Where the ray enters an instance's box, if it does within its range.
fn box_entry(instance: &Instance, ray: &Ray) -> Option<f32> {
    const LEAST: Vec3 = Vec3::splat(1e-18);
    // Kept finite, so that no product of an infinity and a zero, and no difference of infinities, gives NaN.
    let is_small = ray.direction.abs().cmplt(LEAST);
    let inverse = 1.0 / Vec3::select(is_small, LEAST, ray.direction);
    let low = (instance.bounds.min - ray.origin) * inverse;
    let high = (instance.bounds.max - ray.origin) * inverse;
    let near = low.min(high).max_element().max(ray.t_min);
    let far = low.max(high).min_element().min(ray.t_max);
    // More than the rounding above.
    let slack = 8.0 * f32::EPSILON * near.abs().max(far.abs());
    (near <= far + slack && near < f32::INFINITY).then_some(near - slack)
}

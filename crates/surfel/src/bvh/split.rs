//! Splitting a large range by the surface area heuristic over bins (Wald 2007).

use super::partition::{CHUNK, Sides, partition, partition_chunk};
use super::primitive::{Extent, Primitive, WideBox};
use crate::math::{LANES, Vec4};
use rayon::prelude::*;

/// Bins an axis.
const N_BINS: usize = 16;
/// Up to this many primitives a split is moved so that blocks and the nodes over them come out full.
const ROUNDED_MAX: usize = 4096;
/// Primitives of a node with eight full blocks.
pub(super) const FULL_NODE: usize = LANES * LANES;

/// Reorders `primitives`, more than a full node of them, about a good split.
pub(super) fn split(primitives: &mut [Primitive], extent: &Extent) -> Sides {
    let binning = Binning::new(&extent.centers);
    let Some(cut) = best_cut(&bins_of(primitives, binning)) else {
        return halve(primitives, extent);
    };
    let bin_of = binning.along(cut.axis);
    if primitives.len() <= ROUNDED_MAX {
        return split_rounded(primitives, bin_of, &cut);
    }
    partition(primitives, |primitive| bin_of(primitive) < cut.first_right)
}

/// Splits by count along the longest axis: ends for any input.
pub(super) fn halve(primitives: &mut [Primitive], extent: &Extent) -> Sides {
    let n = primitives.len();
    let unit = unit(n);
    let n_left = (n / 2).next_multiple_of(unit).min(n - 1);
    select(primitives, n_left, extent.centers.longest_axis());
    Sides::at(primitives, n_left)
}

/// Splits come at multiples of this.
fn unit(n: usize) -> usize {
    if FULL_NODE < n {
        FULL_NODE
    } else if LANES < n {
        LANES
    } else {
        1
    }
}

/// Puts the `n_left` lowest along `axis` in front.
fn select(primitives: &mut [Primitive], n_left: usize, axis: usize) {
    let key = |primitive: &Primitive| primitive.doubled_center()[axis];
    primitives.select_nth_unstable_by(n_left, |a, b| {
        key(a).total_cmp(&key(b)).then(a.index().cmp(&b.index()))
    });
}

/// Only the bin in which the moved split falls needs an order.
fn split_rounded(
    primitives: &mut [Primitive],
    bin_of: impl Fn(&Primitive) -> usize,
    cut: &Cut,
) -> Sides {
    let n = primitives.len();
    let n_left = ((cut.n_left + FULL_NODE / 2) / FULL_NODE * FULL_NODE)
        .clamp(FULL_NODE, (n - 1) / FULL_NODE * FULL_NODE);
    let bin = cut.bin_at(n_left);
    let n_below = partition_chunk(primitives, |p| bin_of(p) < bin);
    let rest = &mut primitives[n_below..];
    if n_below < n_left {
        let n_within = partition_chunk(rest, |p| bin_of(p) == bin);
        select(&mut rest[..n_within], n_left - n_below, cut.axis);
    }
    Sides::at(primitives, n_left)
}

/// From here to twice this neighbouring f32 are 1 apart, and their low bits are a whole number.
const UNIT_SPACING: f32 = 8_388_608.0;

/// Maps centres to equal intervals of each axis.
#[derive(Clone, Copy)]
struct Binning {
    min: Vec4,
    per_unit: Vec4,
}

impl Binning {
    fn new(centers: &WideBox) -> Self {
        let per_unit = (N_BINS - 1) as f32 / (centers.upper - centers.lower);
        let per_unit = per_unit.map(|x| if x.is_finite() { x } else { 0.0 });
        // The index in the fourth lane, as bits, would be a denormal number, which takes multiplication
        // some hundred cycles: a quarter of the time to build triangles.
        Self { min: centers.lower.with_w(1.0), per_unit: per_unit.with_w(0.0) }
    }

    /// Rounded to the nearest.
    #[inline(always)]
    fn bins(self, primitive: &Primitive) -> [usize; 3] {
        let bins = (primitive.doubled_center() - self.min) * self.per_unit + UNIT_SPACING;
        [bins.x, bins.y, bins.z].map(|bin| bin.to_bits() as usize % N_BINS)
    }

    /// The same for one axis.
    #[inline(always)]
    fn along(self, axis: usize) -> impl Fn(&Primitive) -> usize {
        let (min, per_unit) = (self.min[axis], self.per_unit[axis]);
        move |primitive| {
            let bin = (primitive.doubled_center_along(axis) - min) * per_unit + UNIT_SPACING;
            bin.to_bits() as usize % N_BINS
        }
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: WideBox,
    n: usize,
}

type Bins = [[Bin; N_BINS]; 3];
const NO_BINS: Bins = [[Bin { bounds: WideBox::EMPTY, n: 0 }; N_BINS]; 3];

/// Minima, maxima and counts do not depend on the order of reduction, so neither does the tree.
fn bins_of(primitives: &[Primitive], binning: Binning) -> Bins {
    if primitives.len() <= CHUNK {
        return bins_of_chunk(primitives, binning);
    }
    let chunks = primitives.par_chunks(CHUNK);
    chunks.map(|chunk| bins_of_chunk(chunk, binning)).reduce(|| NO_BINS, merge)
}

fn bins_of_chunk(primitives: &[Primitive], binning: Binning) -> Bins {
    let mut bins = NO_BINS;
    for primitive in primitives {
        for (axis, bin) in binning.bins(primitive).into_iter().enumerate() {
            let bin = &mut bins[axis][bin];
            bin.bounds = bin.bounds.union(primitive.wide());
            bin.n += 1;
        }
    }
    bins
}

fn merge(mut a: Bins, b: Bins) -> Bins {
    for (a, b) in a.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *a = Bin { bounds: a.bounds.union(b.bounds), n: a.n + b.n };
    }
    a
}

/// A split between two bins of an axis.
struct Cut {
    axis: usize,
    first_right: usize,
    n_left: usize,
    cost: f32,
    /// Primitives in each bin of the axis.
    counts: [usize; N_BINS],
}

impl Cut {
    /// The bin that holds the primitive at `rank` in the order of the bins.
    fn bin_at(&self, rank: usize) -> usize {
        let mut n = 0;
        let is_beyond = |count: &usize| {
            n += count;
            rank < n
        };
        self.counts.iter().position(is_beyond).unwrap_or(N_BINS - 1)
    }
}

fn best_cut(bins: &Bins) -> Option<Cut> {
    let cuts = (0..3).filter_map(|axis| best_cut_along(axis, &bins[axis]));
    cuts.reduce(|best, cut| if cut.cost < best.cost { cut } else { best })
}

/// The cheapest split by area times blocks.
fn best_cut_along(axis: usize, bins: &[Bin; N_BINS]) -> Option<Cut> {
    let blocks = |n: usize| n.div_ceil(LANES) as f32;
    let mut right_costs = [0.0; N_BINS];
    let (mut n, mut bounds) = (0, WideBox::EMPTY);
    for i in (1..N_BINS).rev() {
        n += bins[i].n;
        bounds = bounds.union(bins[i].bounds);
        right_costs[i] = if n == 0 { f32::INFINITY } else { bounds.half_area() * blocks(n) };
    }
    let (mut n, mut bounds) = (0, WideBox::EMPTY);
    let (mut cost, mut found) = (f32::INFINITY, None);
    for i in 1..N_BINS {
        n += bins[i - 1].n;
        bounds = bounds.union(bins[i - 1].bounds);
        let candidate = bounds.half_area() * blocks(n) + right_costs[i];
        if 0 < n && candidate < cost {
            (cost, found) = (candidate, Some((i, n)));
        }
    }
    let (first_right, n_left) = found?;
    Some(Cut { axis, first_right, n_left, cost, counts: bins.map(|bin| bin.n) })
}

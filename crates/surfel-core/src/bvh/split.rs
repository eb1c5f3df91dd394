//! Splits of large ranges by the surface area heuristic over bins (Wald 2007).

use super::partition::{CHUNK, Partition, partition, partition_chunk};
use super::primitive::{BvhPrimitive, Extent, SimdAabb};
use crate::math::{LANES, Vec4};
use rayon::prelude::*;

/// Number of bins per axis.
const N_BINS: usize = 16;
/// Maximum number of primitives at which a split is moved so that blocks and the nodes over them become full.
const MAX_ALIGNED: usize = 4096;
/// Number of primitives of a node with eight full blocks.
pub(super) const FULL_NODE: usize = LANES * LANES;

/// Splits more than `FULL_NODE` primitives by the surface area heuristic, and reorders them.
pub(super) fn split(primitives: &mut [BvhPrimitive], extent: &Extent) -> Partition {
    let binning = Binning::new(&extent.centers);
    let Some(cut) = best_split(&bins_of(primitives, binning)) else {
        return median_split(primitives, extent);
    };
    let bin_of = binning.along(cut.axis);
    if primitives.len() <= MAX_ALIGNED {
        return split_aligned(primitives, bin_of, &cut);
    }
    partition(primitives, |primitive| bin_of(primitive) < cut.first_right)
}

/// Splits at the median along the longest axis, which terminates for any input.
pub(super) fn median_split(primitives: &mut [BvhPrimitive], extent: &Extent) -> Partition {
    let n = primitives.len();
    let n_left = (n / 2).next_multiple_of(alignment(n)).min(n - 1);
    select_lowest(primitives, n_left, extent.centers.longest_axis());
    Partition::at(primitives, n_left)
}

/// Returns the number of which the left side of a median split of `n` primitives is a multiple.
fn alignment(n: usize) -> usize {
    if FULL_NODE < n {
        FULL_NODE
    } else if LANES < n {
        LANES
    } else {
        1
    }
}

/// Moves the `n_left` primitives with the lowest centres along `axis` to the front.
fn select_lowest(primitives: &mut [BvhPrimitive], n_left: usize, axis: usize) {
    let key = |primitive: &BvhPrimitive| primitive.doubled_center()[axis];
    primitives.select_nth_unstable_by(n_left, |a, b| {
        key(a).total_cmp(&key(b)).then(a.index().cmp(&b.index()))
    });
}

/// Splits at the multiple of `FULL_NODE` nearest to `cut`. Only primitives of the bin that contains the split have
/// to be ordered.
fn split_aligned(
    primitives: &mut [BvhPrimitive],
    bin_of: impl Fn(&BvhPrimitive) -> usize,
    cut: &BinSplit,
) -> Partition {
    let n = primitives.len();
    let n_left = ((cut.n_left + FULL_NODE / 2) / FULL_NODE * FULL_NODE)
        .clamp(FULL_NODE, (n - 1) / FULL_NODE * FULL_NODE);
    let bin = cut.bin_at(n_left);
    let n_below = partition_chunk(primitives, |p| bin_of(p) < bin);
    let rest = &mut primitives[n_below..];
    if n_below < n_left {
        let n_within = partition_chunk(rest, |p| bin_of(p) == bin);
        select_lowest(&mut rest[..n_within], n_left - n_below, cut.axis);
    }
    Partition::at(primitives, n_left)
}

/// Neighbouring f32 between this and twice this differ by 1, so that their low bits are an integer.
const UNIT_SPACING: f32 = 8_388_608.0;

/// Maps centres to bins, which are equal intervals of each axis.
#[derive(Clone, Copy)]
struct Binning {
    min: Vec4,
    per_unit: Vec4,
}

impl Binning {
    fn new(centers: &SimdAabb) -> Self {
        let per_unit = (N_BINS - 1) as f32 / (centers.upper - centers.lower);
        let per_unit = per_unit.map(|x| if x.is_finite() { x } else { 0.0 });
        // The fourth lane holds the index as bits, often a denormal number. Multiplying it would take about a
        // hundred cycles, which was a quarter of the time to build trees of triangles.
        Self { min: centers.lower.with_w(1.0), per_unit: per_unit.with_w(0.0) }
    }

    /// Returns the bin nearest to the primitive's centre along each axis.
    #[inline(always)]
    fn bins(self, primitive: &BvhPrimitive) -> [usize; 3] {
        let bins = (primitive.doubled_center() - self.min) * self.per_unit + UNIT_SPACING;
        [bins.x, bins.y, bins.z].map(|bin| bin.to_bits() as usize % N_BINS)
    }

    /// Returns the function that maps a primitive to its bin along `axis`.
    #[inline(always)]
    fn along(self, axis: usize) -> impl Fn(&BvhPrimitive) -> usize {
        let (min, per_unit) = (self.min[axis], self.per_unit[axis]);
        move |primitive| {
            let bin = (primitive.doubled_center_along(axis) - min) * per_unit + UNIT_SPACING;
            bin.to_bits() as usize % N_BINS
        }
    }
}

/// The primitives of a bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: SimdAabb,
    n: usize,
}

type Bins = [[Bin; N_BINS]; 3];
const NO_BINS: Bins = [[Bin { bounds: SimdAabb::EMPTY, n: 0 }; N_BINS]; 3];

/// Sorts primitives into bins. Minima, maxima and counts do not depend on the order of reduction, so neither does
/// the tree.
fn bins_of(primitives: &[BvhPrimitive], binning: Binning) -> Bins {
    if primitives.len() <= CHUNK {
        return bins_of_chunk(primitives, binning);
    }
    let chunks = primitives.par_chunks(CHUNK);
    chunks.map(|chunk| bins_of_chunk(chunk, binning)).reduce(|| NO_BINS, merge)
}

fn bins_of_chunk(primitives: &[BvhPrimitive], binning: Binning) -> Bins {
    let mut bins = NO_BINS;
    for primitive in primitives {
        for (axis, bin) in binning.bins(primitive).into_iter().enumerate() {
            let bin = &mut bins[axis][bin];
            bin.bounds = bin.bounds.union(primitive.simd_bounds());
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
struct BinSplit {
    axis: usize,
    /// Index of the first bin on the right side.
    first_right: usize,
    n_left: usize,
    cost: f32,
    /// Number of primitives in each bin of the axis.
    counts: [usize; N_BINS],
}

impl BinSplit {
    /// Returns the bin that contains the primitive at `rank` in the order of the bins.
    fn bin_at(&self, rank: usize) -> usize {
        let mut n = 0;
        let is_beyond = |count: &usize| {
            n += count;
            rank < n
        };
        self.counts.iter().position(is_beyond).unwrap_or(N_BINS - 1)
    }
}

/// Returns the split with the minimum cost along all axes, or none if all centres share a bin.
fn best_split(bins: &Bins) -> Option<BinSplit> {
    let cuts = (0..3).filter_map(|axis| best_split_along(axis, &bins[axis]));
    cuts.reduce(|best, cut| if cut.cost < best.cost { cut } else { best })
}

/// Returns the split with the minimum of area times blocks along `axis`, or none if all centres share a bin.
fn best_split_along(axis: usize, bins: &[Bin; N_BINS]) -> Option<BinSplit> {
    let blocks = |n: usize| n.div_ceil(LANES) as f32;
    let mut right_costs = [0.0; N_BINS];
    let (mut n, mut bounds) = (0, SimdAabb::EMPTY);
    for i in (1..N_BINS).rev() {
        n += bins[i].n;
        bounds = bounds.union(bins[i].bounds);
        right_costs[i] = if n == 0 { f32::INFINITY } else { bounds.half_area() * blocks(n) };
    }
    let (mut n, mut bounds) = (0, SimdAabb::EMPTY);
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
    Some(BinSplit { axis, first_right, n_left, cost, counts: bins.map(|bin| bin.n) })
}

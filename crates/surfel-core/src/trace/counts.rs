//! Counts of what searches evaluate, for measurements. Without the feature `counts` nothing is counted, at no cost.

#[cfg(feature = "counts")]
use std::sync::atomic::{AtomicU64, Ordering};

/// A kind of evaluation, counted for each ray: one for all rays of a packet counts sixteen times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counted {
    /// Tests of a ray with a disc, a ball or a triangle.
    Shapes,
    /// Points in sums over the points around a place: of fits and of the field of weighted planes.
    Terms,
    /// Leaves of a kd-tree, or nodes of an octree, that a ray passes.
    Cells,
    /// Cells of an octree in which the surface is sought.
    CellRoots,
    /// Points that the edge test projects onto a plane.
    EdgePoints,
}

impl Counted {
    /// Everything that is counted, with its name.
    pub const ALL: [(&'static str, Self); 5] = [
        ("shapes", Self::Shapes),
        ("terms", Self::Terms),
        ("cells", Self::Cells),
        ("cell roots", Self::CellRoots),
        ("edge points", Self::EdgePoints),
    ];
}

#[cfg(feature = "counts")]
static COUNTS: [AtomicU64; Counted::ALL.len()] = [const { AtomicU64::new(0) }; Counted::ALL.len()];

/// Adds to a count of the process.
#[inline(always)]
pub fn count(_what: Counted, _n: usize) {
    #[cfg(feature = "counts")]
    COUNTS[_what as usize].fetch_add(_n as u64, Ordering::Relaxed);
}

/// Returns the counts of the process since the last call, in the order of [`Counted::ALL`], and sets them to zero; none
/// without the feature `counts`.
pub fn take_counts() -> Option<[u64; Counted::ALL.len()]> {
    #[cfg(feature = "counts")]
    return Some(std::array::from_fn(|i| COUNTS[i].swap(0, Ordering::Relaxed)));
    #[cfg(not(feature = "counts"))]
    None
}

//! The passes of a search in a tree: whole, or first near one disc of each ray and then behind it.

use crate::shader::{Kernel, Surface};

/// The kernels of a search.
#[derive(Clone, Copy, Debug)]
pub struct SearchKernels {
    /// Finds a disc on each ray.
    disc: Kernel,
    /// Tests whether rays hit the surface near these discs.
    test: fn(Surface) -> Kernel,
    /// Searches all along rays.
    whole: fn(Surface) -> Kernel,
    /// True if any hit is enough.
    is_any: bool,
}

/// The search for the nearest hits.
pub const CLOSEST: SearchKernels = SearchKernels {
    disc: Kernel::FirstDisc,
    test: Kernel::TestClosest,
    whole: Kernel::Closest,
    is_any: false,
};

/// The search for any hits of rays toward lights.
pub const ANY: SearchKernels = SearchKernels {
    disc: Kernel::AnyDisc,
    test: Kernel::TestAny,
    whole: Kernel::Any,
    is_any: true,
};

/// A step of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchStep {
    /// A pass of a kernel over all rays, or with `is_rest` over those that are undecided.
    Search {
        /// The kernel.
        kernel: Kernel,
        /// True if the pass goes over undecided rays.
        is_rest: bool,
    },
    /// The queue of the undecided rays is taken.
    Take,
}

impl SearchKernels {
    /// Returns the steps of a search in a tree with this surface and number of instances. Most rays end near the first
    /// disc that is found. Kernels that find it or test it have far less state than those that go on behind it, so a
    /// device runs more of them at the same time.
    pub fn steps(&self, surface: Surface, n_instances: usize) -> Vec<SearchStep> {
        let of_all = |kernel| SearchStep::Search { kernel, is_rest: false };
        let whole = (self.whole)(surface);
        if n_instances != 1 || !surface.tests_first_disc(self.is_any) {
            return vec![of_all(whole)];
        }
        let rest = SearchStep::Search { kernel: whole, is_rest: true };
        vec![of_all(self.disc), of_all((self.test)(surface)), SearchStep::Take, rest]
    }
}

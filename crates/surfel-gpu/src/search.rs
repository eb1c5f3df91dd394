//! The passes of a search in a tree: whole, or first near single discs of each ray and then behind them.

use crate::shader::Kernel;
use crate::surface::Surface;

/// Number of rounds in which the nearest discs of rays are tested. Rays that are undecided then have many discs, which
/// their workgroups test together.
const N_CLOSEST_ROUNDS: u32 = 4;

/// The kernels of a search.
#[derive(Clone, Copy, Debug)]
pub struct SearchKernels {
    /// Finds the next disc on each ray.
    pub disc: Kernel,
    /// Tests whether rays hit the surface near these discs.
    test: fn(Surface) -> Kernel,
    /// Searches all along rays.
    whole: fn(Surface) -> Kernel,
    /// True if any hit is enough.
    is_any: bool,
}

/// The search for the nearest hits.
pub const CLOSEST: SearchKernels = SearchKernels {
    disc: Kernel::NextDisc,
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
    /// A pass of a kernel over all rays, or over those that are undecided after the round before.
    Search {
        /// The kernel.
        kernel: Kernel,
        /// Index of the round.
        round: u32,
    },
    /// The queue of the undecided rays is taken.
    Take,
}

impl SearchKernels {
    /// Returns the steps of a search in a tree with this surface and number of instances, none without any. Most rays end near the first
    /// disc that is found. Kernels that find a disc or test it have far less state than those that search all along a
    /// ray, so a device runs more of them at the same time.
    pub fn steps(&self, surface: Surface, n_instances: usize) -> Vec<SearchStep> {
        let whole = |round| SearchStep::Search { kernel: (self.whole)(surface), round };
        if n_instances == 0 {
            return Vec::new();
        }
        if n_instances != 1 || !surface.tests_first_disc(self.is_any) {
            return vec![whole(0)];
        }
        let n_rounds = if self.is_any { 1 } else { N_CLOSEST_ROUNDS };
        let test = (self.test)(surface);
        let mut steps = Vec::new();
        for round in 0..n_rounds {
            steps.extend([self.disc, test].map(|kernel| SearchStep::Search { kernel, round }));
            steps.push(SearchStep::Take);
        }
        steps.push(whole(n_rounds));
        steps
    }
}

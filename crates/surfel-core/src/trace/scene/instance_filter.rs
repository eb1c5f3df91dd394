//! The choice of instances that a query is about.

use crate::flat::Instance;

/// The instances that a query is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstanceFilter {
    /// All instances. Gaussians count as a surface where they let half of the light pass.
    All,
    /// Instances with a surface: all but Gaussians.
    Surfaces,
    /// Instances with a surface that no light goes through.
    Opaque,
    /// Instances with a surface that light may go through.
    Transmissive,
}

impl InstanceFilter {
    /// True if the query is about `instance`.
    pub(in crate::trace) fn accepts(self, instance: &Instance) -> bool {
        match self {
            Self::All => true,
            Self::Surfaces => !instance.is_gaussian,
            Self::Opaque => !instance.is_transmissive && !instance.is_gaussian,
            Self::Transmissive => instance.is_transmissive,
        }
    }
}

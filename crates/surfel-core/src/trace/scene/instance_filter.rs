//! The choice of instances that a query is about.

use crate::flat::Instance;

/// The instances that a query is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstanceFilter {
    /// All instances.
    All,
    /// Instances that no light goes through.
    Opaque,
    /// Instances that light may go through.
    Transmissive,
}

impl InstanceFilter {
    /// True if the query is about `instance`.
    pub(in crate::trace) fn accepts(self, instance: &Instance) -> bool {
        match self {
            Self::All => true,
            Self::Opaque => !instance.is_transmissive,
            Self::Transmissive => instance.is_transmissive,
        }
    }
}

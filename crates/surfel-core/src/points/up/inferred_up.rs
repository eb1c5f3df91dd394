//! The inferred up axis with its reason.

use crate::math::Vec3;

/// The inferred up axis.
#[derive(Clone, Debug, PartialEq)]
pub struct InferredUp {
    /// Unit vector along the axis.
    pub up: Vec3,
    /// The reason for the choice, in one line.
    pub reason: String,
}

//! What searches along single rays look at.

use crate::flat::FlatPoints;
use crate::math::{Lanes, Ray};
use std::ops::ControlFlow;

/// Looks at the blocks that a ray comes by.
pub trait RayVisitor {
    /// Whether near blocks are better seen first.
    const IS_ORDERED: bool;

    fn ray(&self) -> &Ray;

    /// Boxes entered beyond this distance are left out.
    fn limit(&self) -> f32;

    fn visit<L: Lanes>(&mut self, points: &FlatPoints, block_idx: u32) -> ControlFlow<()>;
}

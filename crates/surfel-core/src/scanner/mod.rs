//! A virtual laser scanner and a demo scene of signed distance fields, which give clouds of any size whose true
//! surface is known.

mod column;
mod foliage;
mod masonry;
mod noise;
pub mod ruin;
mod scan;
#[cfg(test)]
mod shapes;
mod sdf;
mod station;
mod stone;
mod terrain;
mod weathered;

pub use scan::Scanner;
pub use sdf::{DAabb, DRay, Sdf, SdfHit, SdfScene};
pub use station::Station;

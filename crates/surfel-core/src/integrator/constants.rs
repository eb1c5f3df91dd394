//! Constants of the integrators, for other implementations of them.

pub use super::direct::{PUNCTUAL_LIGHT_POSITION, SKY_DIRECTION, SKY_DISTANCE, SUN_DIRECTION};
pub use super::shading::MIN_FACING_COS;

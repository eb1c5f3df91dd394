//! The objects that scenes are made of.

pub mod assembly;
pub mod body;
pub mod column;
pub mod foliage;
pub mod furniture;
pub mod house;
pub mod masonry;
#[cfg(test)]
pub mod primitives;
pub mod room_shell;
pub mod stone;
pub mod street_ground;
pub mod terrain;
pub mod tree;
pub mod weathered;
pub mod wire;

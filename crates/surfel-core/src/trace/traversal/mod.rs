//! Traversals of a tree: by packets of coherent rays, by interleaved incoherent rays, and by a box.
//!
//! A file uses only those above it.

pub mod prefetch;
pub mod region;
pub mod interleaved;
pub mod frustum;
pub mod children;
pub mod packet;
pub mod sparse;
pub mod stack;
pub mod packet_traversal;
pub mod group;
pub mod batch;

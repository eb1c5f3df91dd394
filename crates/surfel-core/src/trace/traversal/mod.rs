//! Traversals of a tree: by packets of coherent rays, by interleaved incoherent rays, and by a box. A
//! kd-tree and an octree have traversals of their own.
//!
//! A file uses only those above it.

pub mod prefetch;
pub mod region;
pub mod kd_walk;
pub mod octree_walk;
pub mod interleaved;
pub mod frustum;
pub mod children;
pub mod packet;
pub mod sparse;
pub mod stack;
pub mod packet_traversal;
pub mod group;
pub mod batch;

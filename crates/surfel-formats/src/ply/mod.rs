//! PLY: polygon files, of which the vertices are read as points.

mod header;
mod walk;
mod read;
mod write;

pub(crate) use read::{inspect, read};
pub(crate) use write::write;

pub(crate) const MAGIC: &[u8] = b"ply";

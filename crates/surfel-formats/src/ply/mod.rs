//! PLY: polygon files, read as points by their vertices alone or as meshes.

mod header;
mod walk;
mod lines;
mod faces;
mod read;
mod mesh;
mod write;

pub(crate) use mesh::{has_faces, read_mesh};
pub(crate) use read::{inspect, read};
pub(crate) use write::write;

pub(crate) const MAGIC: &[u8] = b"ply";

//! PLY: polygon files, read as points (their vertices) or as meshes.

mod station_comment;
mod header;
mod skip;
mod element_lines;
mod trained_splats;
mod faces;
mod read;
mod mesh;
mod write;

pub(crate) use mesh::{has_faces, read_mesh};
pub(crate) use read::{inspect, read};
pub(crate) use trained_splats::SPLAT_ADVICE;
pub(crate) use write::write;

//! LAS and LAZ: survey scans, plain and compressed.

mod header;
mod crs;
mod fields;
mod extra;
mod laz;
mod plan;
mod read;
mod write;

pub(crate) use read::{inspect, read};
pub(crate) use write::write;

pub(crate) const MAGIC: &[u8] = b"LASF";

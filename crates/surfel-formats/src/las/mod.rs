//! LAS and LAZ: survey scans, plain and compressed.

mod header;
mod crs;
mod fields;
mod extra;
mod gps;
mod median;
mod point14;
mod laz;
mod find_chunks;
mod write_plan;
mod read;
mod write;

pub(crate) use read::{inspect, read};
pub(crate) use write::write;

//! LAS and LAZ: survey scans, plain and compressed.

mod header;
mod crs;
mod color_bits;
mod fields;
mod point_format;
mod profile;
mod extra;
mod gps;
mod median;
mod point14;
mod laz;
mod find_chunks;
mod write_plan;
mod write_header;
mod read;
mod write;

pub(crate) use profile::common_profile;
pub(crate) use read::{inspect, read};
pub(crate) use write::write;

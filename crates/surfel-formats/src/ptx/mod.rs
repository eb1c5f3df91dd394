//! PTX: the scans of terrestrial laser scanners as grids of text, each with the pose of its scanner.

mod scans;
mod read;

pub(crate) use read::{inspect, read};
pub(crate) use scans::is_ptx;

//! PCD: the point clouds of PCL and of robots, versions 0.5 to 0.7, in all three encodings.

mod header;
mod lzf;
mod compressed;
mod read;

pub(crate) use header::is_pcd;
pub(crate) use read::{inspect, read};

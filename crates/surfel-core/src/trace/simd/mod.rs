//! SIMD levels: their lanes, the dispatch of kernels to them, packets of rays in lanes, and box tests in
//! lanes.

pub mod level;
#[cfg(target_arch = "x86_64")]
pub mod avx2;
#[cfg(target_arch = "x86_64")]
pub mod avx512;
pub mod dispatch;
pub mod packet_rays;
pub mod node_boxes;

pub(in crate::trace) use dispatch::dispatch_simd;
pub use level::Simd;

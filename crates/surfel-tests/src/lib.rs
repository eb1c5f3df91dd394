//! Scenes, clouds and ground truth that the tests and benchmarks of all crates share.

pub mod bench_args;
pub mod skipped;
pub mod shared_data;
pub mod cancel_after;
pub mod clouds;
pub mod scenes;
pub mod field_bvh;
pub mod backends;
pub mod ground_truth;
pub mod shapes;
pub mod sampling;
pub mod deviation;
pub mod picture_difference;
pub mod true_scene;
pub mod scan_quality;

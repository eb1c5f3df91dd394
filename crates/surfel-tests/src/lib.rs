//! Scenes with known answers, shared by the tests and the benchmarks of all crates.

pub mod clouds;
pub mod scenes;
pub mod ground_truth;
pub mod deviation;

//! Scenes with known answers, shared by the tests and the benchmarks.

pub mod clouds;
pub mod scenes;
pub mod mesh;
pub mod quality;

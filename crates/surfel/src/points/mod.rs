//! Point clouds as columns, and the preparation that tracing needs.

mod cloud;

pub use cloud::{PointCloud, Scalar, Values};

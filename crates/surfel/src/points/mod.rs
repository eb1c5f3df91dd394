//! Point clouds as columns, and the preparation that tracing needs.

mod clean;
mod cloud;
pub mod neighbors;
mod normals;

pub use clean::{CleanReport, clean};
pub use cloud::{PointCloud, Scalar, Values};
pub use normals::{NormalReport, PlaneFit, fill_missing, fit_plane};

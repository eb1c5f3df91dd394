//! Point clouds as columns, and the preparation that tracing needs.

mod bend;
mod clean;
mod cloud;
mod merge;
pub mod neighbors;
mod normals;
mod orient;
mod prepare;
mod radius;
mod select;
mod up;

pub use bend::{Morph, Skin};
pub use clean::{CleanReport, clean};
pub use cloud::{PointCloud, Scalar, Values, is_somewhere};
pub use merge::merge;
pub use normals::{NormalReport, PlaneFit, fill_missing, fit_plane};
pub use orient::{Orientation, orient};
pub use prepare::{Preparation, Report, SURFACE_VARIATION, prepare};
pub use radius::{Radius, RadiusReport, Sample, estimate_radii, median_distance, spacing};
pub use select::{Select, select};
pub use up::{UpGuess, guess_up};

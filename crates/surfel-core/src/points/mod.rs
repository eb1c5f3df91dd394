//! Point clouds as columns, and the preparation that tracing needs.

mod deformation;
mod clean;
mod cloud;
mod merge;
pub mod neighbors;
mod normals;
mod orient;
mod prepared_cloud;
mod radius;
mod subsample;
mod outliers;
mod structure;
mod noise;
mod denoise;
mod edge_planes;
mod scan_lines;
mod find_structures;
mod prepare;
mod up;

pub use clean::{CleanReport, clean};
pub use cloud::{PointCloud, Scalar, Values, is_valid_position};
pub use deformation::{Morph, Skin};
pub use denoise::{Denoise, DenoiseReport, denoise};
pub use find_structures::{all_scattered, find_structures};
pub use merge::merge;
pub use normals::{NormalReport, PlaneFit, fill_missing, fit_plane};
pub use orient::{Orientation, orient};
pub use outliers::{OutlierRemoval, remove_outliers};
pub use prepare::{Preparation, PreparationReport, SURFACE_VARIATION, prepare};
pub use prepared_cloud::PreparedCloud;
pub(crate) use prepared_cloud::check_length;
pub use radius::{DistanceSample, Radius, RadiusReport, estimate_radii, median_distance, spacing};
pub use structure::{PointShape, STRUCTURE, Structure, StructureChoice, StructureReport};
pub use subsample::{Subsample, subsample};
pub(crate) use up::MAX_CAMERA_SLOPE;
pub use up::{InferredUp, UpConvention, infer_up};

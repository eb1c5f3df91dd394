//! Point clouds as columns, and the preparation that tracing needs.
//!
//! `prepare` runs the preparation from its first step to its last, with the settings of `preparation`: `select_points`
//! drops points, `estimate` has the steps that share one search for neighbours, `morph_offsets` repeats them for morph
//! targets, and `add_columns` writes the results. A folder for each subject:
//!
//! - `cloud`: the columns of points, conditions on them, merging;
//! - `neighbors`: the points around each point;
//! - `scan`: the rays of scanners, as far as columns tell them;
//! - `cleaning`: points that are dropped;
//! - `normals` and `radii`: the discs that points become;
//! - `structure`: which points form a surface, a line or neither;
//! - `denoising`: points moved onto their surface or line;
//! - `gaps`: discs that are narrowed where a scanner saw through them, and widened between parts of one surface.
//!
//! A file or folder uses only those above it.

mod cloud;
mod up;
pub mod neighbors;
mod scan;
mod radii;
mod cleaning;
mod normals;
mod structure;
mod denoising;
mod gaps;
mod preparation;
mod select_points;
mod estimate;
mod morph_offsets;
mod add_columns;
mod prepared_cloud;
mod prepare;
#[cfg(test)]
mod test_clouds;

pub use cleaning::clean::{CleanReport, NOISE_CLASSES, clean};
pub use cleaning::clean_options::{CleanOptions, Duplicates, NoisePoints};
pub use cleaning::outliers::{OutlierRemoval, remove_outliers};
pub use cleaning::subsample::{Subsample, subsample};
pub use cloud::color_bits::{COLOR_8_TO_16, have_8_bits, to_8_bits};
pub use cloud::deformation::{Morph, Skin};
pub use cloud::density::points_per_area;
pub(crate) use cloud::filter::Polygon;
pub use cloud::filter::{PointFilter, rings_cross, visit_column};
pub use cloud::flags::{FLAGS, WITHHELD, is_flag};
pub use cloud::gaussians::{
    GAUSSIAN_COLUMNS, Gaussian, GaussianColumns, HARMONIC_0, MAX_HARMONICS, MAX_REST_COLUMNS,
    MIN_DISC_OPACITY, n_harmonics, rest_column,
};
pub use cloud::kept_points::KeptPoints;
pub use cloud::known_column::{KnownColumn, is_label, name_of_pdal, plain_name};
pub use cloud::merge::merge;
pub(crate) use cloud::point_cloud::check_count;
pub use cloud::point_cloud::{PointCloud, Scalar, Values, is_valid_position};
pub use cloud::scan_station::{COLUMN_INDEX, ROW_INDEX, STATION, ScanStation};
pub use denoising::denoise::{Denoise, DenoiseReport, Denoised, denoise};
pub use denoising::line_axes::LineReport;
pub use normals::orient::{Orientation, orient};
pub use normals::planes::{NormalReport, PlaneFit, fit_plane};
pub use preparation::{Preparation, SURFACE_VARIATION};
pub use prepare::{PreparationReport, prepare};
pub use prepared_cloud::PreparedCloud;
pub(crate) use prepared_cloud::check_length;
pub use radii::overlap::mean_overlap;
pub use radii::radius::{DEFAULT_RADIUS_SAMPLES, Radius, RadiusReport, spacing};
pub use scan::grid_rays::locate_stations;
pub use scan::mixed_pixels::MixedPixels;
pub use scan::scan_angle::{POINT_SOURCE, SCAN_ANGLE};
pub use select_points::select_points;
pub use structure::point_shape::{
    PointShape, STRUCTURE, Structure, StructureChoice, StructureReport,
};
pub use structure::solids::CAPSULE_ASPECT;
pub(crate) use up::CameraAxes;
pub use up::{InferredUp, UpConvention, infer_up};

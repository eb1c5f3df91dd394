//! Point clouds as columns, and the preparation that tracing needs.

mod deformation;
mod clean;
mod scan_station;
mod cloud;
mod color_bits;
mod gaussians;
mod filter;
mod flags;
mod merge;
pub mod neighbors;
mod normals;
mod jets;
mod up;
mod scan_angle;
mod orient;
mod prepared_cloud;
mod radius;
mod normal_lengths;
mod subsample;
mod outliers;
mod structure;
mod vegetation;
mod wall_faces;
mod depth_steps;
mod noise;
mod denoise;
mod above_land;
mod edge_planes;
mod typical;
mod solids;
mod stray_points;
mod wide_discs;
mod octants;
mod plan_cells;
mod see_through;
mod sparse_walls;
mod below_roofs;
mod junctions;
mod scan_lines;
mod scan_rings;
mod ring_surfaces;
mod structure_votes;
mod find_structures;
mod scan_grid;
mod grid_rays;
mod mixed_pixels;
mod seen_scan;
mod free_space;
mod gaps;
mod density;
mod preparation;
mod curvature;
mod estimate;
mod line_axes;
mod prepare;
#[cfg(test)]
mod test_clouds;

pub use clean::{CleanReport, Duplicates, clean};
pub use cloud::{PointCloud, Scalar, Values, is_valid_position};
pub use color_bits::{COLOR_8_TO_16, have_8_bits, to_8_bits};
pub use deformation::{Morph, Skin};
pub use denoise::{Denoise, DenoiseReport, denoise};
pub use density::points_per_area;
pub(crate) use filter::Polygon;
pub use filter::{PointFilter, visit_column};
pub use flags::{FLAGS, WITHHELD, is_flag};
pub use gaussians::{
    GAUSSIAN_COLUMNS, Gaussian, GaussianColumns, HARMONIC_0, MAX_HARMONICS, MAX_REST_COLUMNS,
    MIN_DISC_OPACITY, n_harmonics, rest_column,
};
pub use line_axes::LineReport;
pub use merge::merge;
pub use mixed_pixels::MixedPixels;
pub use normals::{NormalReport, PlaneFit, fill_missing, fit_plane};
pub use orient::{Orientation, orient};
pub use outliers::{OutlierRemoval, remove_outliers};
pub use preparation::{Preparation, SURFACE_VARIATION};
pub use prepare::{PreparationReport, prepare, select_points};
pub use prepared_cloud::PreparedCloud;
pub(crate) use prepared_cloud::check_length;
pub use radius::{
    DEFAULT_RADIUS_SAMPLES, DistanceSample, Radius, RadiusReport, estimate_radii, median_distance,
    spacing,
};
pub use scan_angle::{POINT_SOURCE, SCAN_ANGLE};
pub use scan_station::{COLUMN_INDEX, ROW_INDEX, STATION, ScanStation};
pub use solids::CAPSULE_ASPECT;
pub use structure::{PointShape, STRUCTURE, Structure, StructureChoice, StructureReport};
pub use subsample::{Subsample, subsample};
pub(crate) use up::MAX_CAMERA_SLOPE;
pub use up::{InferredUp, UpConvention, infer_up};

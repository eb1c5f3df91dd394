//! Options of reading and writing clouds, and the information that comes with a cloud.

use std::path::PathBuf;

use surfel_core::math::DVec3;
use surfel_core::points::{PointCloud, PointFilter};

use crate::table::{ColumnChoice, TextColumn};

/// Options of reading a file.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Columns to keep in memory.
    pub columns: ColumnChoice,
    /// The columns of a text file, in order; inferred from the file if absent.
    pub text_columns: Option<Vec<TextColumn>>,
    /// Condition that points must meet to be kept; all are kept if absent.
    pub filter: Option<PointFilter>,
    /// World coordinates of the zero of the positions; chosen from the data if absent.
    pub origin: Option<DVec3>,
    /// Reads what is whole of a damaged LAS, LAZ, PLY, E57, PCD, PTX, text or ESRI grid file, and of the points of an OBJ
    /// file.
    pub salvage: bool,
    /// Name of the animation to take from glTF files that have any; the first if absent.
    pub animation: Option<String>,
}

/// A cloud with information about the file that it was read from.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// Points of the file.
    pub cloud: PointCloud,
    /// Information about the file.
    pub info: FileInfo,
}

/// The information that a file states about itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileInfo {
    /// Format in the words of its users, as in "LAZ 1.4, point format 6".
    pub format: String,
    /// Number of points, if it is known without reading all of them.
    pub n_points: Option<u64>,
    /// Number of triangles of a mesh. Before the mesh is read it is the number of its faces, which may have more
    /// than three corners.
    pub n_triangles: Option<u64>,
    /// Least and greatest coordinates of the points, if the header states them.
    pub bounds: Option<[DVec3; 2]>,
    /// Smallest step between coordinates on each axis, if the format states one.
    pub resolution: Option<DVec3>,
    /// Coordinate system, as WKT, as "EPSG:" and a code, or in the words of the file.
    pub coordinate_system: Option<String>,
    /// True if the format prescribes metres, whatever the coordinate system: E57, PTX and glTF.
    pub is_in_metres: bool,
    /// Properties of a LAS file that a file made from its points keeps.
    pub las: Option<LasProfile>,
    /// Names of the columns in the file.
    pub columns: Vec<String>,
    /// Degree of the spherical harmonics that colour trained splats, 0 to 3; `None` for all other files.
    pub harmonics_degree: Option<u32>,
    /// Pictures that the file holds beside its points.
    pub images: Vec<EmbeddedImage>,
    /// Paths of further files that it names and that were looked for while it was read, found or not: buffers,
    /// materials, textures.
    pub external_files: Vec<PathBuf>,
}

/// A picture inside a file of points, as the file describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct EmbeddedImage {
    /// Name of the picture.
    pub name: String,
    /// Camera model of the picture.
    pub camera: ImageCamera,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of bytes of the encoded picture.
    pub n_bytes: u64,
    /// World position of the camera, if the file states its pose.
    pub position: Option<DVec3>,
    /// Name of the scan that the picture was taken with, if the file states one.
    pub scan: Option<String>,
}

/// The camera model of a picture inside a file of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageCamera {
    /// Perspective picture.
    Pinhole,
    /// Panorama with equal angles along both axes.
    Spherical,
    /// Panorama on a cylinder.
    Cylindrical,
    /// Picture that shows the site and has no projection.
    VisualReference,
}

impl ImageCamera {
    /// Returns the name of the model.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::Spherical => "spherical",
            Self::Cylindrical => "cylindrical",
            Self::VisualReference => "visual reference",
        }
    }
}

/// Properties of an output file that a cloud does not hold itself.
#[derive(Clone, Debug, Default)]
pub struct SaveOptions {
    /// Step between coordinates in LAS and LAZ; chosen from the cloud's size if absent.
    pub resolution: Option<DVec3>,
    /// Coordinate system as WKT, or "EPSG:" and a code; LAS and LAZ keep it.
    pub coordinate_system: Option<String>,
    /// Properties of the LAS file that the cloud was read from; LAS and LAZ keep them where they hold the cloud.
    pub las: Option<LasProfile>,
}

impl SaveOptions {
    /// Options that keep what the file of the cloud states about itself.
    pub fn from_source(info: &FileInfo) -> Self {
        Self {
            resolution: info.resolution,
            coordinate_system: info.coordinate_system.clone(),
            las: info.las.clone(),
        }
    }
}

/// The properties of a LAS file that a file made from its points keeps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LasProfile {
    /// Minor version of LAS 1.
    pub minor_version: u8,
    /// Point data record format.
    pub point_format: u8,
    /// Global encoding: type of the GPS times, form of the coordinate system.
    pub global_encoding: u16,
    /// World coordinates of the integer coordinates 0.
    pub offset: DVec3,
    /// Records of the coordinate system: their ids and data.
    pub projection: Vec<(u16, Vec<u8>)>,
    /// Data of the record that describes the extra bytes.
    pub extra_bytes: Vec<u8>,
}

//! Reads point clouds, meshes, scenes and environment maps; writes clouds, pictures and movies.
//!
//! [`load`] reads a file of any of the [`FORMATS`] to a [`surfel_core::points::PointCloud`], and [`save`] writes one.
//! [`load_graph`] keeps triangles, materials and animation too, as a [`surfel_core::scene::Graph`]. [`save_image`]
//! writes a rendered picture, a [`Movie`] many of them. [`load_environment_map`] reads light for a scene.
//!
//! ```
//! use surfel_core::progress::NoProgress;
//! use surfel_formats::{LoadOptions, SaveOptions, load, load_bytes, save};
//!
//! # fn main() -> Result<(), surfel_formats::Error> {
//! let text = b"x,y,z,intensity\n500000.25,4900000.5,12.0,7\n500001.25,4900001.5,13.0,8\n";
//! let loaded = load_bytes("site.csv", text, &LoadOptions::default(), &NoProgress)?;
//! assert_eq!(loaded.cloud.intensity, Some(vec![7.0, 8.0]));
//!
//! let path = std::env::temp_dir().join(format!("site-{}.laz", std::process::id()));
//! save(&path, &loaded.cloud, &SaveOptions::default(), &NoProgress)?;
//! let again = load(&path, &LoadOptions::default(), &NoProgress)?;
//! assert_eq!(again.info.format, "LAZ 1.4, point format 6");
//! assert_eq!(again.cloud.world_position(1), loaded.cloud.world_position(1));
//! # std::fs::remove_file(&path).unwrap();
//! # Ok(())
//! # }
//! ```

mod error;
mod number_text;
mod file;
mod salvage;
mod table;
mod options;
mod stations;
mod mesh;
mod ply;
mod pcd;
mod ptx;
mod e57;
mod las;
mod text;
mod esri_grid;
mod obj;
mod stl;
mod off;
mod bin;
mod gltf;
mod merge;
mod format;
mod filtered;
mod load;
mod graph;
mod save;
mod temp_file;
mod image_file;
mod movie;
mod environment;

pub use environment::{HdrImage, load_environment_map, load_environment_map_bytes};
pub use error::{Error, Location, Result};
pub use file::{check_output_path, load_text, save_text};
pub use format::{FORMATS, Format, detect_file};
pub use gltf::{load_gltf, load_gltf_bytes};
pub use graph::{is_scene, load_graph, load_graph_bytes};
pub use image_file::{
    Alpha, BitDepth, EpsgCodes, Georeference, HeightMap, ImageOptions, check_height_map,
    check_image_output, check_image_size, encode_png, save_height_map, save_image,
};
pub use load::{inspect, inspect_bytes, load, load_all, load_bytes};
pub use merge::{common_file_info, merge_loaded};
pub use movie::{Movie, MovieOptions, check_movie};
pub use options::{
    EmbeddedImage, FileInfo, ImageCamera, LasProfile, LoadOptions, Loaded, SaveOptions,
};
pub use save::{check_cloud_output, save, writable_extensions};
pub use table::{Column, ColumnChoice, TextColumn};
pub use temp_file::TempFile;

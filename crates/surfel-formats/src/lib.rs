//! Files: point clouds, meshes and scenes in, pictures of light in; clouds, pictures and movies out.
//!
//! A file becomes a [`surfel::points::PointCloud`] by [`load`], whatever its format; [`save`] goes
//! the other way. [`load_graph`] keeps triangles, materials and movement too, as a
//! [`surfel::scene::Graph`]. [`save_image`] writes what was rendered, and a [`Movie`] many such
//! pictures. Light for a scene comes from [`load_environment_picture`].
//!
//! ```
//! use surfel::progress::Silent;
//! use surfel_formats::{LoadOptions, SaveOptions, load, load_bytes, save};
//!
//! # fn main() -> Result<(), surfel_formats::Error> {
//! let text = b"x,y,z,intensity\n500000.25,4900000.5,12.0,7\n500001.25,4900001.5,13.0,8\n";
//! let loaded = load_bytes("site.csv", text, &LoadOptions::default(), &Silent)?;
//! assert_eq!(loaded.cloud.intensity, Some(vec![7.0, 8.0]));
//!
//! let path = std::env::temp_dir().join(format!("site-{}.laz", std::process::id()));
//! save(&path, &loaded.cloud, &SaveOptions::default(), &Silent)?;
//! let again = load(&path, &LoadOptions::default(), &Silent)?;
//! assert_eq!(again.source.format, "LAZ 1.4, point format 6");
//! assert_eq!(again.cloud.world_position(1), loaded.cloud.world_position(1));
//! # std::fs::remove_file(&path).unwrap();
//! # Ok(())
//! # }
//! ```

mod error;
mod number;
mod input;
mod atomic;
mod role;
mod range;
mod options;
mod block;
mod record;
mod records;
mod lines;
mod pieces;
mod weld;
mod mend;
mod mesh;
mod encode;
mod ply;
mod las;
mod text;
mod beside;
mod texture;
mod obj;
mod stl;
mod bin;
mod extent;
mod load;
mod graph;
mod save;
mod picture;
mod movie;
mod environment;
mod gltf;

pub use atomic::save_text;
pub use environment::{LinearPicture, load_environment_picture, load_environment_picture_bytes};
pub use error::{Error, Place, Result};
pub use gltf::{load_gltf, load_gltf_bytes};
pub use graph::{is_cloud, is_scene, load_graph, load_graph_bytes};
pub use input::load_text;
pub use load::{common_source, inspect, load, load_all, load_bytes, merge_loaded};
pub use movie::{Container, Movie, MovieFormat, MovieOptions, check_movie};
pub use options::{Column, ColumnChoice, LoadOptions, Loaded, Source, TextColumn};
pub use picture::{Alpha, BitDepth, ImageOptions, png_bytes, save_image};
pub use save::{SaveOptions, check_output, check_place, save};

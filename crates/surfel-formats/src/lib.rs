//! Files: point clouds in and out, pictures out.

mod error;
mod input;
mod atomic;
mod role;
mod options;
mod block;
mod record;
mod records;
mod lines;
mod encode;
mod ply;
mod las;
mod text;
mod obj;
mod load;
mod save;
mod picture;

pub use error::{Error, Place, Result};
pub use load::{inspect, load, load_all, load_bytes};
pub use options::{Column, ColumnChoice, LoadOptions, Loaded, Source, TextColumn};
pub use picture::{Alpha, BitDepth, ImageOptions, save_image};
pub use save::{SaveOptions, check_output, save};

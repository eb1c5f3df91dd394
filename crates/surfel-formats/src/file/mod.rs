//! Files themselves: the bytes of inputs, the files that inputs name, and outputs written whole or not at all.

mod input;
mod external_files;
mod atomic_write;
mod output_path;

pub use atomic_write::save_text;
pub use input::load_text;
pub use output_path::check_output_path;

pub(crate) use atomic_write::{write_error, write_file, write_temp};
pub(crate) use external_files::{MissingFiles, ResourceResolver, file_key};
pub(crate) use input::Input;
pub(crate) use output_path::{extension, unsupported_extension};

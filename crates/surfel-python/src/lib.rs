//! The Python package `surfel`: a thin layer over the crate `surfel`.
//!
//! Keywords are the keys of scene files; values, defaults and messages are those of every other door.

mod errors;
mod value;
mod paths;
mod work;
mod buffer;
mod image;
mod height_map;
mod array;
mod cloud;
mod rays;
mod object;
mod threads;
mod open_scene;
mod scene;
mod movie;
mod preparation;
mod viewer;
mod program;

use pyo3::prelude::*;

/// The compiled part of the package `surfel`.
// Classes are frozen, and what changes in them stands behind locks: a Python without the lock of the interpreter needs none.
#[pymodule(gil_used = false)]
#[pyo3(name = "_native")]
mod native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::cloud::{PyCloud, PyMesh};
    #[pymodule_export]
    use crate::height_map::PyHeightMap;
    #[pymodule_export]
    use crate::image::PyImage;
    #[pymodule_export]
    use crate::movie::{PyMovie, animate};
    #[pymodule_export]
    use crate::preparation::{prepare, read_cloud};
    #[pymodule_export]
    use crate::program::run_program;
    #[pymodule_export]
    use crate::scene::{_unread, PyScene, load};
    #[pymodule_export]
    use crate::value::_plain;
    #[pymodule_export]
    use crate::viewer::{PyViewer, view};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        surfel_cli::silence_decoder_panics();
        crate::viewer::stop_at_exit(module.py())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

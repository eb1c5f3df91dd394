//! Elevations of plans as arrays, and the files that they are saved to.

use crate::buffer::shared_array;
use crate::work;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use surfel_formats::{EpsgCodes, Georeference, HeightMap, save_height_map};

/// Elevations of a plan. Row 0 is the top; the array is read-only and shared with the map.
#[pyclass(frozen, module = "surfel", name = "HeightMap")]
pub struct PyHeightMap(pub Arc<HeightMap>);

#[pymethods]
impl PyHeightMap {
    /// Elevation at the centre of each pixel in world coordinates, NaN where nothing is: float32, (height, width).
    #[getter]
    fn elevations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let HeightMap { width, height, elevations, .. } = &*self.0;
        shared_array(py, &self.0, elevations, vec![*height as usize, *width as usize])
    }

    /// Numbers a, b, c, d, e, f, as `rasterio.Affine(*transform)` takes them: a position at x pixels from the left edge and y
    /// from the top has the world coordinates (a x + b y + c, d x + e y + f).
    #[getter]
    fn transform(&self) -> [f64; 6] {
        let Georeference { corner: [c, f], right: [a, d], down: [b, e], .. } = self.0.georeference;
        [a, b, c, d, e, f]
    }

    /// The coordinate system as `EPSG:25832`, or with one of heights as `EPSG:25832+7837`; None if it has no code.
    #[getter]
    fn crs(&self) -> Option<String> {
        self.0.georeference.epsg.map(epsg_name)
    }

    /// Writes the elevations as a GeoTIFF (.tif), in which -9999 stands for NaN. The file is replaced once it is complete.
    ///
    /// Raises `InvalidFile` for other extensions and `InaccessibleFile` if the file cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let map = &self.0;
        work::run(py, None, |_| Ok(save_height_map(&path, map)?))
    }

    fn __repr__(&self) -> String {
        format!("<surfel.HeightMap {}x{}>", self.0.width, self.0.height)
    }
}

/// Returns the name of a coordinate system: `EPSG:25832`, or with one of heights `EPSG:25832+7837`.
pub fn epsg_name(codes: EpsgCodes) -> String {
    let vertical = codes.vertical.map_or(String::new(), |code| format!("+{code}"));
    format!("EPSG:{}{vertical}", codes.horizontal)
}

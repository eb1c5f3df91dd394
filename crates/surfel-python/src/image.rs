//! Pictures: their layers as arrays, and the files that they are saved to.

use crate::buffer::{Element, as_numpy, shared_array};
use crate::errors::{to_exception, unpicklable};
use crate::work;
use pyo3::exceptions::PyAttributeError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use surfel::{Choice, RenderedImage};
use surfel_core::image::{Aovs, Image, encode_srgba8};
use surfel_core::math::{DVec3, Vec3};

/// A rendered picture. Row 0 is the top; arrays are read-only and shared with the picture.
#[pyclass(frozen, module = "surfel", name = "Image")]
pub struct PyImage {
    shared: Arc<Shared>,
}

/// A picture with the columns that are computed when they are asked for.
pub struct Shared {
    image: RenderedImage,
    origin: DVec3,
    ids: PixelIds,
    choices: Vec<String>,
    positions: OnceLock<Vec<f64>>,
    srgb: OnceLock<Vec<u8>>,
}

/// The object and the point that each pixel shows; empty without layers.
#[derive(Default)]
pub struct PixelIds {
    /// Number of the added object that each pixel shows.
    pub geometries: Vec<u32>,
    /// Index that each pixel's point had when it was read.
    pub points: Vec<u32>,
}

impl PyImage {
    /// A picture whose positions count from `origin`; `choices` are those that were made from the data.
    pub fn new(image: RenderedImage, origin: DVec3, ids: PixelIds, choices: &[Choice]) -> Self {
        let choices = choices.iter().map(ToString::to_string).collect();
        let (positions, srgb) = (OnceLock::new(), OnceLock::new());
        Self { shared: Arc::new(Shared { image, origin, ids, choices, positions, srgb }) }
    }

    fn shape_of(&self, n_channels: Option<usize>) -> Vec<usize> {
        let Image { width, height, .. } = *self.shared.image;
        [height as usize, width as usize].into_iter().chain(n_channels).collect()
    }

    fn layer<'py, E: Element>(
        &self,
        py: Python<'py>,
        n_channels: Option<usize>,
        layer: impl FnOnce(&Aovs) -> &[E],
    ) -> PyResult<Bound<'py, PyAny>> {
        shared_array(py, &self.shared, layer(self.aovs()?), self.shape_of(n_channels))
    }

    fn aovs(&self) -> PyResult<&Aovs> {
        let aovs = self.shared.image.aovs.as_ref();
        aovs.ok_or_else(|| PyAttributeError::new_err("rendered with layers=False"))
    }
}

#[pymethods]
impl PyImage {
    /// Height, width and number of channels of `color`, which numpy takes the picture for.
    #[getter]
    fn shape(&self) -> (u32, u32, u32) {
        (self.height(), self.width(), 4)
    }

    /// The array `color`, for numpy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_numpy(self.color(py)?, dtype, copy)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(unpicklable("Image"))
    }

    /// Width in pixels.
    #[getter]
    fn width(&self) -> u32 {
        self.shared.image.width
    }

    /// Height in pixels.
    #[getter]
    fn height(&self) -> u32 {
        self.shared.image.height
    }

    /// Linear Rec. 709 colour, premultiplied by alpha, and alpha: float32, (height, width, 4).
    #[getter]
    fn color<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers = self.shared.image.color.as_flattened();
        shared_array(py, &self.shared, numbers, self.shape_of(Some(4)))
    }

    /// Colour for display as in a PNG, not premultiplied, and alpha: uint8, (height, width, 4).
    #[getter]
    fn srgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let Shared { image, srgb, .. } = &*self.shared;
        let numbers = work::detached(py, || srgb.get_or_init(|| encoded(image)))?;
        shared_array(py, &self.shared, numbers, self.shape_of(Some(4)))
    }

    /// Fraction of each pixel's samples that hit a surface: float32, (height, width).
    #[getter]
    fn coverage<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        shared_array(py, &self.shared, &self.shared.image.coverage, self.shape_of(None))
    }

    /// Depth along the view axis in the scene's unit, from the camera of a panorama the distance; `inf` where nothing was
    /// hit: float32, (height, width).
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, None, |aovs| &aovs.depth)
    }

    /// Unit normals that face the camera, 0 where nothing was hit: float32, (height, width, 3).
    #[getter]
    fn normal<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, Some(3), |aovs| bytemuck::cast_slice::<Vec3, f32>(&aovs.normal))
    }

    /// World coordinates of what each pixel shows, NaN where nothing was hit: float64, (height, width, 3).
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let aovs = self.aovs()?;
        let Shared { positions, origin, .. } = &*self.shared;
        let world = || positions.get_or_init(|| world_positions(aovs, *origin));
        let numbers = work::detached(py, world)?;
        shared_array(py, &self.shared, numbers, self.shape_of(Some(3)))
    }

    /// The point that is nearest to what each pixel shows, by its index in the file or array that the scene has it from; of
    /// meshes the triangle; 0xFFFFFFFF where nothing was hit: uint32, (height, width).
    #[getter]
    fn point_ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.aovs()?;
        shared_array(py, &self.shared, &self.shared.ids.points, self.shape_of(None))
    }

    /// The number of what each pixel shows, as `Scene.add` returned it and `Scene.cast_rays` has it; 0xFFFFFFFF where nothing
    /// was hit: uint32, (height, width).
    #[getter]
    fn geometry_ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.aovs()?;
        shared_array(py, &self.shared, &self.shared.ids.geometries, self.shape_of(None))
    }

    /// The instance that each pixel shows, in the numbering of .exr files, in which each part of an object is one and hidden
    /// objects are none; 0xFFFFFFFF where nothing was hit: uint32, (height, width).
    #[getter]
    fn instance_ids<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, None, |aovs| &aovs.instance_id)
    }

    /// Linear colour of the surface without light, 0 where nothing was hit: float32, (height, width, 3).
    #[getter]
    fn albedo<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, Some(3), |aovs| bytemuck::cast_slice::<Vec3, f32>(&aovs.albedo))
    }

    /// Number of points within one radius of what each pixel shows: uint32, (height, width).
    #[getter]
    fn support_count<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, None, |aovs| &aovs.support_count)
    }

    /// Distance from what each pixel shows to the nearest point, in radii of that point: float32, (height, width).
    #[getter]
    fn support_distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.layer(py, None, |aovs| &aovs.support_distance)
    }

    /// Choices that were made from the data, each with the keys that override it.
    #[getter]
    fn choices(&self) -> Vec<String> {
        self.shared.choices.clone()
    }

    /// Writes the picture: .png, .jpg, .webp, .tif, or .exr with all layers. The file is replaced once it is complete.
    ///
    /// Raises `InvalidFile` for other extensions and `InaccessibleFile` if the file cannot be written.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let shared = &self.shared;
        work::run(py, None, |_| shared.image.save(path))
    }

    /// Bytes of the picture as a PNG, which notebooks show.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = work::detached(py, || self.shared.image.png_bytes())?;
        Ok(PyBytes::new(py, &bytes.map_err(|error| to_exception(py, &error))?))
    }

    fn __repr__(&self) -> String {
        format!("<surfel.Image {}x{}>", self.width(), self.height())
    }
}

fn world_positions(aovs: &Aovs, origin: DVec3) -> Vec<f64> {
    let pixels = aovs.position.iter().zip(&aovs.depth);
    let position = |(position, depth): (&Vec3, &f32)| match depth.is_finite() {
        true => (origin + position.as_dvec3()).to_array(),
        false => [f64::NAN; 3],
    };
    pixels.flat_map(position).collect()
}

fn encoded(image: &Image) -> Vec<u8> {
    image.color.iter().flat_map(|pixel| encode_srgba8(*pixel)).collect()
}

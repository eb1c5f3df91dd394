//! Clouds and meshes of arrays.

use crate::array::{checked, column, positions, scaled_positions, singles, vectors};
use crate::buffer::{Element, as_numpy, owned_array, shared_array};
use crate::errors::{invalid_array, invalid_setting, refuse_others, to_exception, unpicklable};
use crate::height_map::epsg_name;
use crate::value::to_value;
use crate::work;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use surfel::SceneDescription;
use surfel::crs::CoordinateSystem;
use surfel::memory_files::MemoryContent;
use surfel_core::image::{decode_srgb, encode_srgb};
use surfel_core::math::{DVec3, Vec3, Vec4};
use surfel_core::points::{PointCloud, Scalar, Values};
use surfel_core::scene::Mesh;
use surfel_core::words::counted;
use surfel_formats::SaveOptions;

/// A point cloud: positions and the columns beside them, of arrays, or of a cloud of laspy, Open3D, PyVista, trimesh, pandas
/// or xarray. It does not change; threads may share it.
///
/// `points`: (N, 3), any numbers; rows that are not finite, or masked, count as not measured. `normals`: (N, 3), any length.
/// `radii`: (N,) or a number, in the unit of the positions. `colors`: (N, 3) or (N, 4), sRGB as uint8, uint16 or from 0
/// to 1. `intensity`: (N,). `classification`: (N,), 0 to 255. `scalars`: names with columns (N,). `crs`: the coordinate
/// system, as `EPSG:25832`, 25832, WKT, or one of pyproj.
///
/// Positions are copied once, to float32 about `origin`, which keeps the resolution of georeferenced coordinates.
/// Later changes of the arrays change nothing here. Raises `InvalidArray`, and `InvalidSetting` for an unknown `crs`.
#[pyclass(frozen, module = "surfel", name = "Cloud")]
pub struct PyCloud {
    /// The columns.
    pub cloud: Arc<PointCloud>,
    /// Properties of the file that it came from, which a saved one keeps.
    pub options: SaveOptions,
}

impl PyCloud {
    /// A cloud that is saved with these options.
    pub fn new(cloud: PointCloud, options: SaveOptions) -> Self {
        Self { cloud: Arc::new(cloud), options }
    }

    /// Returns the cloud as content of a scene.
    pub fn content(&self) -> MemoryContent {
        MemoryContent::Points(self.cloud.clone(), self.options.coordinate_system.clone())
    }

    fn optional<'py, E: Element>(
        &self,
        py: Python<'py>,
        n_channels: Option<usize>,
        column: impl Fn(&PointCloud) -> Option<&[E]>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let shape = [self.cloud.len()].into_iter().chain(n_channels).collect();
        let numbers = column(&self.cloud);
        numbers.map(|numbers| shared_array(py, &self.cloud, numbers, shape)).transpose()
    }
}

#[pymethods]
impl PyCloud {
    #[new]
    #[pyo3(
        signature = (
            points, *, normals = None, radii = None, colors = None, intensity = None, classification = None,
            scalars = None, crs = None, **others
        ),
        text_signature = "(points, *, normals=None, radii=None, colors=None, intensity=None, classification=None, \
                          scalars=None, crs=None)"
    )]
    #[allow(clippy::too_many_arguments, reason = "they are keywords")]
    fn from_arrays(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        normals: Option<&Bound<'_, PyAny>>,
        radii: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        intensity: Option<&Bound<'_, PyAny>>,
        classification: Option<&Bound<'_, PyAny>>,
        scalars: Option<&Bound<'_, PyAny>>,
        crs: Option<&Bound<'_, PyAny>>,
        others: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        const KEYWORDS: [&str; 7] =
            ["normals", "radii", "colors", "intensity", "classification", "scalars", "crs"];
        refuse_others("Cloud", others, &KEYWORDS)?;
        let found = py.import("surfel._convert")?.call_method1("cloud_columns", (points,))?;
        let columns = match found.is_none() {
            true => PyDict::new(py),
            false => found.cast_into::<PyDict>()?,
        };
        if !columns.contains("points")? {
            columns.set_item("points", points)?;
        }
        let keywords = [
            ("normals", normals),
            ("radii", radii),
            ("colors", colors),
            ("intensity", intensity),
            ("classification", classification),
        ];
        for (name, values) in keywords {
            values.map_or(Ok(()), |values| columns.set_item(name, values))?;
        }
        let all = PyDict::new(py);
        for named in [columns.get_item("scalars")?.as_ref(), scalars].into_iter().flatten() {
            let named = checked(py, "named_columns", (named,))?;
            all.update(named.cast()?)?;
        }
        let coordinate_system = match crs {
            Some(crs) => Some(coordinate_system(crs)?),
            None => columns.get_item("crs")?.map(|crs| crs.extract()).transpose()?,
        };
        let mut cloud = cloud_of(py, &columns, &all)?;
        let mut options = SaveOptions::default();
        if let Ok(source) = points.cast::<Self>() {
            cloud.stations.clone_from(&source.get().cloud.stations);
            options = source.get().options.clone();
        }
        Ok(Self::new(cloud, SaveOptions { coordinate_system, ..options }))
    }

    fn __len__(&self) -> usize {
        self.cloud.len()
    }

    /// The array `points`, for numpy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if copy == Some(false) {
            let message = "the points of a cloud are copied; `local_points` and `origin` are not";
            return Err(PyValueError::new_err(message));
        }
        as_numpy(self.points(py)?, dtype, None)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(unpicklable("Cloud"))
    }

    /// World coordinates of the points: float64, (N, 3), a copy.
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        world_positions(py, &self.cloud.positions, self.cloud.origin)
    }

    /// World coordinates of the zero of `local_points`.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.cloud.origin.to_array()
    }

    /// Positions relative to `origin`, as they are held: float32, (N, 3).
    #[getter]
    fn local_points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let numbers = bytemuck::cast_slice::<Vec3, f32>(&self.cloud.positions);
        shared_array(py, &self.cloud, numbers, vec![self.cloud.len(), 3])
    }

    /// The coordinate system as `EPSG:25832`, or with one of heights as `EPSG:25832+7837`; as WKT if it has no code, and
    /// `None` if it is not known.
    #[getter]
    fn crs(&self) -> Option<String> {
        let text = self.options.coordinate_system.as_ref()?;
        let codes = CoordinateSystem::parse(text).and_then(|system| system.epsg());
        Some(codes.map_or_else(|| text.clone(), epsg_name))
    }

    /// Normals: float32, (N, 3), or `None`. Those of a file have its lengths, those of `prepare` unit length.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.optional(py, Some(3), |cloud| {
            cloud.normals.as_deref().map(bytemuck::cast_slice::<Vec3, f32>)
        })
    }

    /// Radii in the unit of the positions: float32, (N,), or `None`.
    #[getter]
    fn radii<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.optional(py, None, |cloud| cloud.radii.as_deref())
    }

    /// sRGB colours: uint16, (N, 3), or `None`.
    #[getter]
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.optional(py, Some(3), |cloud| cloud.colors.as_deref().map(<[_]>::as_flattened))
    }

    /// Intensities: float32, (N,), or `None`.
    #[getter]
    fn intensity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.optional(py, None, |cloud| cloud.intensity.as_deref())
    }

    /// ASPRS classes: uint8, (N,), or `None`.
    #[getter]
    fn classification<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.optional(py, None, |cloud| cloud.classification.as_deref())
    }

    /// All other columns by their names, each (N,).
    #[getter]
    fn scalars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for scalar in &self.cloud.scalars {
            let (owner, shape) = (&self.cloud, vec![self.cloud.len()]);
            let values = match &scalar.values {
                Values::U8(values) => shared_array(py, owner, values, shape),
                Values::U16(values) => shared_array(py, owner, values, shape),
                Values::I32(values) => shared_array(py, owner, values, shape),
                Values::F32(values) => shared_array(py, owner, values, shape),
                Values::F64(values) => shared_array(py, owner, values, shape),
            };
            all.set_item(&scalar.name, values?)?;
        }
        Ok(all)
    }

    /// The places of the scanners of its scans, which the column `station` counts from 0: dictionaries of `name`, `position`
    /// (three world coordinates, or `None`), `rotation` (the quaternion x, y, z, w from the scanner's axes to those of the
    /// world), and `rows` and `columns` of the scan's grid, or `None`.
    #[getter]
    fn stations<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let stations = self.cloud.stations.iter().map(|station| {
            let described = PyDict::new(py);
            described.set_item("name", &station.name)?;
            described.set_item("position", station.position.map(|position| position.to_array()))?;
            described.set_item("rotation", station.rotation.to_array())?;
            described.set_item("rows", station.grid.map(|[rows, _]| rows))?;
            described.set_item("columns", station.grid.map(|[_, columns]| columns))?;
            Ok(described)
        });
        stations.collect()
    }

    /// Writes the cloud with all its columns, in the format of the extension. The file is replaced once it is complete.
    ///
    /// Raises `InvalidFile` for other extensions and `InaccessibleFile` if the file cannot be written.
    #[pyo3(signature = (path, *, progress = None))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        surfel_formats::check_cloud_output(&path)
            .map_err(|error| to_exception(py, &error.into()))?;
        work::run(py, progress, |progress| {
            Ok(surfel_formats::save(&path, &self.cloud, &self.options, progress)?)
        })
    }

    fn __repr__(&self) -> String {
        format!("<surfel.Cloud of {}>", counted(self.cloud.len(), "point"))
    }
}

/// Returns positions relative to `origin` in world coordinates: float64, (N, 3), a copy.
fn world_positions<'py>(
    py: Python<'py>,
    positions: &[Vec3],
    origin: DVec3,
) -> PyResult<Bound<'py, PyAny>> {
    let world = |position: &Vec3| (origin + position.as_dvec3()).to_array();
    let rows = work::detached(py, || positions.iter().map(world).collect::<Vec<[f64; 3]>>())?;
    owned_array(py, bytemuck::cast_vec::<[f64; 3], f64>(rows), vec![positions.len(), 3])
}

/// Returns a cloud, which is made of an array or of a cloud of another package.
pub fn to_cloud<'py>(source: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyCloud>> {
    match source.cast::<PyCloud>() {
        Ok(cloud) => Ok(cloud.clone()),
        Err(_) => Ok(source.py().get_type::<PyCloud>().call1((source,))?.cast_into()?),
    }
}

/// Reads a coordinate system as the key `crs` does.
fn coordinate_system(crs: &Bound<'_, PyAny>) -> PyResult<String> {
    let py = crs.py();
    let text = py.import("surfel._convert")?.call_method1("crs_text", (crs,))?;
    let mut read = SceneDescription::default();
    read.set("crs", &to_value("crs", &text)?, Path::new(""))
        .map_err(|error| invalid_setting(py, error))?;
    Ok(read.world.crs.unwrap_or_default())
}

fn cloud_of(
    py: Python<'_>,
    columns: &Bound<'_, PyDict>,
    scalars: &Bound<'_, PyDict>,
) -> PyResult<PointCloud> {
    let points = columns.get_item("points")?.unwrap_or_else(|| py.None().into_bound(py));
    let (origin, positions) = match columns.get_item("scales")? {
        Some(scales) => {
            let offsets = columns.get_item("offsets")?;
            let offsets = offsets.map_or(Ok([0.0; 3]), |offsets| offsets.extract())?;
            let columns = points.extract::<[Bound<'_, PyAny>; 3]>()?;
            let scales: [f64; 3] = scales.extract()?;
            scaled_positions(&columns, DVec3::from(scales), DVec3::from(offsets))?
        }
        None => positions(&checked(py, "numbers", ("points", points, (None::<u8>, 3)))?)?,
    };
    let n_points = positions.len();
    if n_points == 0 {
        return Err(invalid_array(py, "points: found none, expected at least one"));
    }
    let column_of = |name: &str| columns.get_item(name);
    let mut cloud = PointCloud { origin, ..PointCloud::from_positions(positions) };
    if let Some(normals) = column_of("normals")? {
        cloud.normals =
            Some(vectors(&checked(py, "numbers", ("normals", normals, (n_points, 3)))?)?);
    }
    if let Some(radii) = column_of("radii")? {
        // An array of one number is no radius of all points, although it converts to one.
        let shape = radii.getattr_opt("shape")?;
        let is_one = shape.is_none_or(|shape| shape.len().is_ok_and(|n_axes| n_axes == 0));
        cloud.radii = Some(match radii.extract::<f32>() {
            Ok(radius) if is_one => vec![radius; n_points],
            _ => singles(&checked(py, "numbers", ("radii", radii, (n_points,)))?)?,
        });
    }
    if let Some(colors) = column_of("colors")? {
        cloud.colors = Some(rgb(&checked(py, "colors", (colors, n_points))?)?);
    }
    if let Some(intensity) = column_of("intensity")? {
        let intensity = checked(py, "numbers", ("intensity", intensity, (n_points,)))?;
        cloud.intensity = Some(singles(&intensity)?);
    }
    if let Some(classes) = column_of("classification")? {
        cloud.classification = Some(column(&checked(py, "classes", (classes, n_points))?)?);
    }
    for (name, values) in scalars {
        let name: String = name.extract()?;
        let values = values_of(&checked(py, "scalars", (&name, values, n_points))?)?;
        cloud.scalars.push(Scalar { name, values });
    }
    Ok(cloud)
}

fn rgb(array: &Bound<'_, PyAny>) -> PyResult<Vec<[u16; 3]>> {
    let numbers = column::<u16>(array)?;
    Ok(numbers.as_chunks::<3>().0.to_vec())
}

fn values_of(array: &Bound<'_, PyAny>) -> PyResult<Values> {
    let name: String = array.getattr("dtype")?.getattr("name")?.extract()?;
    Ok(match &name[..] {
        "uint8" => Values::U8(column(array)?),
        "uint16" => Values::U16(column(array)?),
        "int32" => Values::I32(column(array)?),
        "float32" => Values::F32(column(array)?),
        _ => Values::F64(column(array)?),
    })
}

/// Triangles over shared vertices, of arrays, or of a mesh of Open3D, PyVista or trimesh. It does not change; threads may
/// share it.
///
/// `vertices`: (N, 3), any numbers. `triangles`: (M, 3), indices of vertices, counter-clockwise seen from the front.
/// `normals`: (N, 3); without them triangles are flat. `colors`: (N, 3) or (N, 4), sRGB as uint8, uint16 or from 0 to 1.
///
/// Raises `InvalidArray`.
#[pyclass(frozen, module = "surfel", name = "Mesh")]
pub struct PyMesh {
    /// The columns.
    pub mesh: Arc<Mesh>,
}

#[pymethods]
impl PyMesh {
    #[new]
    #[pyo3(
        signature = (vertices, triangles = None, *, normals = None, colors = None, **others),
        text_signature = "(vertices, triangles=None, *, normals=None, colors=None)"
    )]
    fn from_arrays(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        others: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        refuse_others("Mesh", others, &["triangles", "normals", "colors"])?;
        let columns = match triangles {
            Some(_) => PyDict::new(py),
            None => mesh_columns(py, vertices)?.ok_or_else(|| {
                invalid_array(py, "triangles: found none, expected (M, 3) indices of vertices")
            })?,
        };
        let given = [
            ("vertices", triangles.map(|_| vertices)),
            ("triangles", triangles),
            ("normals", normals),
            ("colors", colors),
        ];
        for (name, values) in given {
            values.map_or(Ok(()), |values| columns.set_item(name, values))?;
        }
        Ok(Self { mesh: Arc::new(mesh_of(py, &columns)?) })
    }

    /// World coordinates of the vertices: float64, (N, 3), a copy.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        world_positions(py, &self.mesh.positions, self.mesh.origin)
    }

    /// Indices of each triangle's vertices, counter-clockwise seen from the front: uint32, (M, 3).
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let triangles = &self.mesh.triangles;
        shared_array(py, &self.mesh, triangles.as_flattened(), vec![triangles.len(), 3])
    }

    /// Unit normals of the vertices: float32, (N, 3), or `None`.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let normals = self.mesh.normals.as_deref();
        let shared = |normals: &[Vec3]| {
            let numbers = bytemuck::cast_slice::<Vec3, f32>(normals);
            shared_array(py, &self.mesh, numbers, vec![normals.len(), 3])
        };
        normals.map(shared).transpose()
    }

    /// sRGB colours of the vertices: uint16, (N, 3), a copy, or `None`.
    #[getter]
    fn colors<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(colors) = &self.mesh.colors else { return Ok(None) };
        let encoded = |channel: f32| (65535.0 * encode_srgb(channel)).round() as u16;
        let rgb = |color: &Vec4| color.truncate().to_array().map(encoded);
        let rows = work::detached(py, || colors.iter().flat_map(rgb).collect::<Vec<u16>>())?;
        owned_array(py, rows, vec![colors.len(), 3]).map(Some)
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(unpicklable("Mesh"))
    }

    fn __repr__(&self) -> String {
        format!("<surfel.Mesh of {}>", counted(self.mesh.triangles.len(), "triangle"))
    }
}

/// Returns vertices and triangles of a mesh of another package; none if it is no mesh.
pub fn mesh_columns<'py>(
    py: Python<'py>,
    source: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let found = py.import("surfel._convert")?.call_method1("mesh_columns", (source,))?;
    Ok(if found.is_none() { None } else { Some(found.cast_into::<PyDict>()?) })
}

fn mesh_of(py: Python<'_>, columns: &Bound<'_, PyDict>) -> PyResult<Mesh> {
    let column_of = |name: &str| columns.get_item(name);
    let vertices = column_of("vertices")?.unwrap_or_else(|| py.None().into_bound(py));
    let (origin, positions) =
        positions(&checked(py, "numbers", ("vertices", vertices, (None::<u8>, 3)))?)?;
    let n_vertices = positions.len();
    if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
        let message = format!("vertices: found one that is not finite, at index {vertex}");
        return Err(invalid_array(py, &message));
    }
    let triangles = column_of("triangles")?.unwrap_or_else(|| PyTuple::empty(py).into_any());
    let triangles = checked(py, "indices", ("triangles", triangles, 3, n_vertices))?;
    let triangles = column::<u32>(&triangles)?.as_chunks::<3>().0.to_vec();
    if triangles.is_empty() {
        return Err(invalid_array(py, "triangles: found none, expected at least one"));
    }
    let mut mesh = Mesh { origin, positions, triangles, ..Mesh::default() };
    if let Some(normals) = column_of("normals")? {
        let normals = checked(py, "numbers", ("normals", normals, (n_vertices, 3)))?;
        let unit = |normal: &Vec3| normal.normalize_or(Vec3::Z);
        mesh.normals = Some(vectors(&normals)?.iter().map(unit).collect());
    }
    if let Some(colors) = column_of("colors")? {
        let linear = |channel: u16| decode_srgb(f32::from(channel) / 65535.0);
        let color = |rgb: [u16; 3]| {
            let [r, g, b] = rgb.map(linear);
            Vec4::new(r, g, b, 1.0)
        };
        let colors = rgb(&checked(py, "colors", (colors, n_vertices))?)?;
        mesh.colors = Some(colors.into_iter().map(color).collect());
    }
    Ok(mesh)
}

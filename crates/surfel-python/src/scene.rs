//! Scenes: what is shown, and the queries about it.

use crate::array::{checked, column};
use crate::buffer::owned_array;
use crate::errors::{invalid_setting, to_exception, unpicklable};
use crate::height_map::PyHeightMap;
use crate::image::{PixelIds, PyImage};
use crate::object::NewObject;
use crate::open_scene::{ChosenView, OpenScene, SceneSlot, is_read_alike, opened};
use crate::paths::file_names;
use crate::rays::{RayArray, ViewRays, ray_hits};
use crate::value::{to_python, with_keys};
use crate::work;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::Value;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use surfel::description::{Invalid, is_scene_file};
use surfel::live_scene::LiveScene;
use surfel::live_view::LiveView;
use surfel::overlay::faults;
use surfel::ray_query::WHOLE_RAY;
use surfel::{Error, RenderedImage, SceneDescription};
use surfel_core::image::{Image, NO_ID};
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::Background;
use surfel_core::scene::color::{Legend, LegendClass};
use surfel_core::words::counted;

/// A scene of files, clouds and meshes, which shows nothing yet. Threads may share it.
///
/// Keywords are keys of scene files: a dot is an underscore, or a dict. What they leave open is chosen from the data.
///
/// Raises `InvalidSetting` for unknown keys and wrong values.
#[pyclass(frozen, module = "surfel", name = "Scene")]
pub struct PyScene {
    state: Mutex<State>,
}

struct State {
    description: SceneDescription,
    /// The scene as it was read; none until it is needed, and after something was added.
    opened: SceneSlot,
}

impl PyScene {
    fn new(description: SceneDescription) -> Self {
        Self { state: Mutex::new(State { description, opened: SceneSlot::default() }) }
    }

    /// Returns the description, without what is chosen from the data.
    pub fn description(&self) -> SceneDescription {
        self.state().0
    }

    /// Returns the description and the slot of what was read of it.
    fn state(&self) -> (SceneDescription, SceneSlot) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        (state.description.clone(), state.opened.clone())
    }

    /// Runs `work` about the scene under a description.
    fn with_view<T: Send>(
        &self,
        py: Python<'_>,
        keys: Option<&Bound<'_, PyDict>>,
        progress: Option<&Bound<'_, PyAny>>,
        work: impl FnOnce(&LiveScene, &ChosenView, &dyn Progress) -> surfel::Result<T> + Send,
    ) -> PyResult<T> {
        let (scene, view) = self.open_view(py, keys, progress)?;
        work::run(py, progress, |progress| {
            scene.install(progress, |scene| work(scene, &view, progress))
        })
    }

    /// Returns the scene and its view under a description; both are made unless they are there.
    fn open_view(
        &self,
        py: Python<'_>,
        keys: Option<&Bound<'_, PyDict>>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Arc<OpenScene>, Arc<ChosenView>)> {
        let (startup, slot) = self.state();
        let description = with_keys(py, &startup, keys)?;
        check_is_not_empty(py, &description)?;
        work::run(py, progress, |progress| {
            let scene = match is_read_alike(&startup, &description) {
                true => opened(&slot, &startup, progress)?,
                false => Arc::new(OpenScene::open(&description, progress)?),
            };
            let view = scene.view(description, progress)?;
            Ok((scene, view))
        })
    }

    /// Runs a query about rays, of which the part `t_range` counts.
    fn query_rays<T: Send>(
        &self,
        rays: &RayArray<'_>,
        t_range: (f32, f32),
        progress: Option<&Bound<'_, PyAny>>,
        query: impl FnOnce(&ViewRays<'_>, &dyn Progress) -> surfel::Result<T> + Send,
    ) -> PyResult<T> {
        let py = rays.py();
        let (scene, chosen) = self.open_view(py, None, progress)?;
        let view = &chosen.view;
        rays.with_rows(|rows| {
            work::run(py, progress, |progress| {
                scene.install(progress, |scene| {
                    query(&ViewRays::new(rows, t_range, view, scene.simd())?, progress)
                })
            })
        })
    }
}

#[pymethods]
impl PyScene {
    #[new]
    #[pyo3(signature = (**keys))]
    fn empty(py: Python<'_>, keys: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Ok(Self::new(with_keys(py, &SceneDescription::default(), keys)?))
    }

    /// Adds `geometry`, a `Cloud`, a `Mesh`, a file, or a cloud or mesh of another package, and returns its number, which the
    /// `geometry_ids` of rays have.
    ///
    /// `name`: for `parent` of others and for messages. `material`: a name as `mirror`, or a dict. `transform`: a 4x4 matrix to
    /// the world's coordinates, or to those of the parent. Other keywords are keys of objects in scene files, as
    /// `translate`, `rotate`, `scale`, `color`, `surface`, `visible`.
    ///
    /// The next picture reads and prepares the whole scene again, also the files of `surfel.load`: add everything to a
    /// `Scene()` before the first one.
    ///
    /// Raises `InvalidSetting`, `InvalidArray`, `MissingFile`.
    #[pyo3(signature = (geometry, *, name = None, material = None, transform = None, **keys))]
    fn add(
        &self,
        py: Python<'_>,
        geometry: &Bound<'_, PyAny>,
        name: Option<&Bound<'_, PyAny>>,
        material: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<usize> {
        let object = NewObject::new(geometry, name, material, transform, keys)?;
        object.clone().inspect(py, &self.description())?;
        loop {
            // No lock is held while the interpreter may run another thread, which could wait for it.
            let before = self.description();
            let description = object.clone().added_to(py, &before)?;
            let number = description.objects.len() - 1 + usize::from(has_files(&description));
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if state.description == before {
                *state = State { description, opened: SceneSlot::default() };
                return Ok(number);
            }
        }
    }

    /// Finds the nearest surface on each ray.
    ///
    /// `rays`: (..., 6), x, y, z of the origin in world coordinates and of the direction, which has any length but 0. A ray
    /// with NaN hits nothing. Returns a dict of arrays: `t_hit` (...), float32, in multiples of the direction's length, `inf`
    /// where nothing was hit; `geometry_ids` (...), uint32, the number of what was added; `primitive_ids` (...), uint32, of
    /// the triangle or of the nearest point; `primitive_normals` (..., 3), float32, unit, facing the origin of the ray;
    /// `point_ids` (...), uint32, the nearest point by its index in its file or array. Ids are 0xFFFFFFFF where there is none.
    ///
    /// Raises `InvalidArray` for other shapes.
    #[pyo3(signature = (rays, *, progress = None))]
    fn cast_rays<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let rays = RayArray::new(rays)?;
        let hits =
            self.query_rays(&rays, WHOLE_RAY, progress, |query, progress| query.hits(progress))?;
        ray_hits(py, &rays.shape, hits)
    }

    /// Returns for each ray whether any surface lies on it: bool, (...).
    ///
    /// `rays` as for `cast_rays`; `tnear` and `tfar` are the part that counts, in multiples of the direction's length:
    /// `tfar=1` ends where the direction does, which is a line of sight between two points.
    #[pyo3(signature = (rays, tnear = 0.0, tfar = f32::INFINITY, *, progress = None))]
    fn test_occlusions<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        tnear: f32,
        tfar: f32,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rays = RayArray::new(rays)?;
        let occluded = self.query_rays(&rays, (tnear, tfar), progress, |query, progress| {
            query.occlusions(progress)
        })?;
        owned_array(py, occluded, rays.shape)
    }

    /// Counts the surfaces on each ray: int32, (...).
    ///
    /// `rays` as for `cast_rays`. Surfaces of points that are nearer to each other than a point's radius count as one.
    #[pyo3(signature = (rays, *, progress = None))]
    fn count_intersections<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        progress: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rays = RayArray::new(rays)?;
        let counts =
            self.query_rays(&rays, WHOLE_RAY, progress, |query, progress| query.counts(progress))?;
        owned_array(py, counts, rays.shape)
    }

    /// Corners of a box around everything that is shown, in world coordinates: float64, (2, 3), least and greatest.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bounds = self.with_view(py, None, None, |_, chosen, _| Ok(chosen.view.bounds()))?;
        owned_array(py, bounds.as_flattened().to_vec(), vec![2, 3])
    }

    /// Renders a picture. Keywords are keys of scene files; they count for this picture alone.
    ///
    /// `layers=False` leaves out all layers but the colour. `progress` is called as `progress(stage, done, total)`.
    ///
    /// Raises `InvalidSetting` for unknown keys and wrong values, `InvalidScene` for settings that do not fit the data.
    #[pyo3(signature = (*, layers = true, progress = None, **keys))]
    fn render(
        &self,
        py: Python<'_>,
        layers: bool,
        progress: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyImage> {
        refuse_outputs(py, keys)?;
        self.with_view(py, keys, progress, |scene, ChosenView { view, choices, .. }, progress| {
            let up = view.description.world.up.unwrap_or(Vec3::Z);
            let faults = faults(&view.description.picture, &view.flat.camera, up);
            if let Some(fault) = faults.into_iter().next() {
                return Err(fault.into());
            }
            let (image, _) = scene.picture(view, layers, progress)?;
            let ids = pixel_ids(view, &image);
            Ok(PyImage::new(image, view.flat.origin, ids, choices))
        })
    }

    /// Finds the elevations that a plan shows. Keywords are keys of scene files; they count for this map alone, as
    /// `gsd=0.5`: one elevation every half metre.
    ///
    /// Raises `InvalidSetting` unless the camera looks straight down without perspective, and as `render`.
    #[pyo3(signature = (*, progress = None, **keys))]
    fn height_map(
        &self,
        py: Python<'_>,
        progress: Option<&Bound<'_, PyAny>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyHeightMap> {
        refuse_outputs(py, keys)?;
        let map = self.with_view(py, keys, progress, |scene, chosen, progress| {
            chosen.view.height_map(scene.simd(), progress)
        })?;
        Ok(PyHeightMap(Arc::new(map)))
    }

    /// Renders a region of a picture, columns and rows from the first to before the second: linear colour without overlay,
    /// float32, (rows, columns, 4).
    #[pyo3(signature = (columns, rows, **keys))]
    fn _render_region<'py>(
        &self,
        py: Python<'py>,
        columns: (u32, u32),
        rows: (u32, u32),
        keys: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let image = self.with_view(py, keys, None, |scene, chosen, progress| {
            scene.region(&chosen.view, (columns, rows), progress)
        })?;
        let shape = vec![image.height as usize, image.width as usize, 4];
        owned_array(py, bytemuck::cast_vec::<[f32; 4], f32>(image.color), shape)
    }

    /// Makes a picture of the colours of all its pixels, float32, (height, width, 4). Pixels that are NaN show the
    /// background. A legend of classes lists `classes`; those of the scene if they are left out.
    #[pyo3(signature = (color, classes = None, **keys))]
    fn _picture_of(
        &self,
        py: Python<'_>,
        color: &Bound<'_, PyAny>,
        classes: Option<Vec<u8>>,
        keys: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyImage> {
        let color = column::<f32>(&checked(py, "numbers", ("color", color, [None::<u8>; 3]))?)?;
        self.with_view(py, keys, None, |_, ChosenView { view, choices, .. }, _| {
            let mut image = Image::new(view.settings.width, view.settings.height);
            let pixels = color.as_chunks::<4>().0;
            let expected = image.color.len();
            if pixels.len() != expected {
                let found = pixels.len();
                return Err(Error::Unfit(format!("found {found} pixels, expected {expected}")));
            }
            image.color.copy_from_slice(pixels);
            show_background(&mut image, view.flat.background);
            let legend = match (&view.trees.legend, classes) {
                (Legend::Classes(_), Some(classes)) => {
                    Legend::Classes(classes.iter().map(|i| LegendClass::new(*i, 0)).collect())
                }
                (legend, _) => legend.clone(),
            };
            let image = view.finished_with(image, legend);
            Ok(PyImage::new(image, view.flat.origin, PixelIds::default(), choices))
        })
    }

    /// Returns the classes that a legend of the scene lists, a byte each, in ascending order.
    fn _classes(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        self.with_view(py, None, None, |_, chosen, _| {
            Ok(match &chosen.view.trees.legend {
                Legend::Classes(classes) => classes.iter().map(|row| row.class).collect(),
                _ => Vec::new(),
            })
        })
    }

    /// Returns all keys of the scene as a scene file has them, with those that are chosen from the data.
    #[pyo3(signature = (**keys))]
    fn describe<'py>(
        &self,
        py: Python<'py>,
        keys: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let table =
            self.with_view(py, keys, None, |_, chosen, _| Ok(chosen.view.description.to_table()))?;
        to_python(py, &Value::Object(table))
    }

    /// Returns the least and the greatest value of the colour map; none if the colours are no map.
    fn _color_range(&self, py: Python<'_>) -> PyResult<Option<(f64, f64)>> {
        self.with_view(py, None, None, |_, chosen, _| {
            Ok(match chosen.view.trees.legend {
                Legend::Map { low, high, .. } => Some((low, high)),
                _ => None,
            })
        })
    }

    /// Returns about how many bytes the scene takes once it is prepared. Reads its files.
    fn _memory_estimate(&self, py: Python<'_>) -> PyResult<u64> {
        let (description, slot) = self.state();
        check_is_not_empty(py, &description)?;
        work::run(py, None, |progress| {
            Ok(opened(&slot, &description, progress)?.scene.memory_estimate())
        })
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(unpicklable("Scene"))
    }

    fn __repr__(&self) -> String {
        let (description, _) = self.state();
        let files = counted(description.files.len(), "file");
        format!("<surfel.Scene of {files} and {}>", counted(description.objects.len(), "object"))
    }
}

/// Checks that there is something to show.
pub fn check_is_not_empty(py: Python<'_>, description: &SceneDescription) -> PyResult<()> {
    description.check_is_not_empty().map_err(|_| {
        let message =
            "the scene has no objects: add a Cloud, a Mesh or a file with scene.add, or load files";
        invalid_setting(py, Invalid::new(message))
    })
}

/// Refuses the keys of files that the program writes.
fn refuse_outputs(py: Python<'_>, keys: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    let outputs = [
        (
            "output",
            "a file that the program writes; a picture of Python is saved by `image.save(path)`",
        ),
        (
            "height_map",
            "a file that the program writes; `scene.height_map(gsd=1).save(path)` does so",
        ),
    ];
    for (key, advice) in outputs {
        if keys.is_some_and(|keys| keys.contains(key).unwrap_or(false)) {
            return Err(invalid_setting(py, Invalid::at(key, advice)));
        }
    }
    Ok(())
}

/// Sets pixels that are NaN to the background.
fn show_background(image: &mut Image, background: Background) {
    let Image { width, height, color, .. } = image;
    for (row, y) in color.chunks_mut(*width as usize).zip(0..) {
        let behind = background.color_at((y as f32 + 0.5) / *height as f32);
        row.iter_mut().filter(|pixel| pixel[0].is_nan()).for_each(|pixel| *pixel = behind);
    }
}

/// Returns what each pixel leads back to.
fn pixel_ids(view: &LiveView, image: &RenderedImage) -> PixelIds {
    let Some(aovs) = &image.aovs else { return PixelIds::default() };
    let (contents, sources) = (view.contents(), view.sources());
    let content = |instance: &u32| contents.get(*instance as usize).copied().unwrap_or(NO_ID);
    let source = |(instance, id): (&u32, &u32)| {
        let source = || sources.get(*instance as usize)?.get(*id as usize).copied();
        source().unwrap_or(*id)
    };
    PixelIds {
        geometries: aovs.instance_id.iter().map(content).collect(),
        points: aovs.instance_id.iter().zip(&aovs.point_id).map(source).collect(),
    }
}

fn scene_of_text(py: Python<'_>, text: &str) -> PyResult<SceneDescription> {
    let table = serde_json::from_str(text).map_err(|error| Invalid::new(error.to_string()));
    let description = table.and_then(|table| SceneDescription::from_table(&table, Path::new("")));
    description.map_err(|error| invalid_setting(py, error))
}

/// Opens a file, or several: point clouds, meshes, glTF scenes, scene files (.toml, .json).
///
/// Keywords are keys of scene files: a dot is an underscore, or a dict: `camera_position=(1, 2, 3)` or
/// `camera={"position": (1, 2, 3)}`. What they leave open is chosen from the data.
///
/// Raises `MissingFile`, `InvalidFile`, also for URLs, `InvalidSetting`.
#[pyfunction]
#[pyo3(signature = (*paths, progress = None, **keys))]
pub fn load(
    py: Python<'_>,
    paths: &Bound<'_, PyTuple>,
    progress: Option<&Bound<'_, PyAny>>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyScene> {
    let scene = _unread(py, paths, None, keys)?;
    let (description, slot) = scene.state();
    check_is_not_empty(py, &description)?;
    work::run(py, progress, |progress| opened(&slot, &description, progress).map(drop))?;
    Ok(scene)
}

/// Makes the scene that `load` opens, whose files are read when they are needed. `_scene` is the text of a scene file
/// that counts besides, as JSON.
#[pyfunction]
#[pyo3(signature = (*paths, _scene = None, **keys))]
pub fn _unread(
    py: Python<'_>,
    paths: &Bound<'_, PyTuple>,
    _scene: Option<&str>,
    keys: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyScene> {
    let mut description = scene_of_text(py, _scene.unwrap_or("{}"))?;
    for path in file_names("surfel.load", paths)? {
        if is_scene_file(&path) {
            let read = work::detached(py, || SceneDescription::read(&path))?;
            let read = read.map_err(|error| to_exception(py, &error))?;
            description.overlay(read);
        } else {
            description.files.push(path);
        }
    }
    Ok(PyScene::new(with_keys(py, &description, keys)?))
}

/// True if files come before the objects: not if settings by name make an object of each.
fn has_files(description: &SceneDescription) -> bool {
    let mut applied = description.clone();
    // Settings may name what is added later.
    let _ = applied.apply_object_settings();
    !applied.files.is_empty()
}

//! Rays as arrays, and what they hit.

use crate::array::{checked, column};
use crate::buffer::owned_array;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use surfel::live_scene::LiveView;
use surfel::ray_query::{RayHits, WorldRays};
use surfel_core::image::NO_ID;

/// Rays of an array (..., 6).
pub struct RayArray {
    /// The numbers, six a ray.
    pub numbers: RayNumbers,
    /// Shape of what is said of each ray.
    pub shape: Vec<usize>,
}

/// Six numbers for each ray, copied: whoever changes the array changes nothing.
pub enum RayNumbers {
    /// From an array of float32.
    Single(Vec<f32>),
    /// From any other array.
    Double(Vec<f64>),
}

impl RayArray {
    /// Looks at an array and copies it.
    pub fn new(rays: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (array, shape): (Bound<'_, PyAny>, Vec<usize>) =
            checked(rays.py(), "rays", (rays,))?.extract()?;
        let numbers = match array.cast::<PyArrayDyn<f32>>() {
            Ok(_) => RayNumbers::Single(column(&array)?),
            Err(_) => RayNumbers::Double(column(&array)?),
        };
        Ok(Self { numbers, shape })
    }
}

impl RayNumbers {
    /// Returns the rays relative to the origin of a view's scene.
    pub fn in_scene(&self, view: &LiveView, t_range: (f32, f32)) -> WorldRays {
        match self {
            Self::Single(numbers) => {
                let rays = numbers.as_chunks::<6>().0.par_iter();
                WorldRays::new(rays.map(|ray| ray.map(f64::from)), t_range, &view.flat)
            }
            Self::Double(numbers) => {
                WorldRays::new(numbers.as_chunks::<6>().0.par_iter().copied(), t_range, &view.flat)
            }
        }
    }
}

/// Returns hits as a dict of arrays; `contents` has the number of what each instance shows.
pub fn ray_hits<'py>(
    py: Python<'py>,
    hits: RayHits,
    contents: &[u32],
    shape: &[usize],
) -> PyResult<Bound<'py, PyDict>> {
    let content = |instance: u32| contents.get(instance as usize).copied().unwrap_or(NO_ID);
    let geometries: Vec<u32> = hits.instances.into_par_iter().map(content).collect();
    let vectors = shape.iter().copied().chain([3]).collect();
    let normals = bytemuck::cast_vec::<[f32; 3], f32>(hits.normals);
    let all = PyDict::new(py);
    all.set_item("t_hit", owned_array(py, hits.t_hit, shape.to_vec())?)?;
    all.set_item("geometry_ids", owned_array(py, geometries, shape.to_vec())?)?;
    all.set_item("primitive_ids", owned_array(py, hits.primitives, shape.to_vec())?)?;
    all.set_item("primitive_normals", owned_array(py, normals, vectors)?)?;
    all.set_item("point_ids", owned_array(py, hits.points, shape.to_vec())?)?;
    Ok(all)
}

//! Rays as arrays, and what they hit.

use crate::array::{checked, with_slice};
use crate::buffer::owned_array;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use surfel::live_view::LiveView;
use surfel::ray_query::{RayHits, WorldRays};
use surfel_core::image::NO_ID;
use surfel_core::math::morton_decode;

/// Rays of an array (..., 6).
pub struct RayArray<'py> {
    /// Rows of six numbers, one after the other.
    array: Bound<'py, PyAny>,
    /// Shape of what is said of each ray.
    pub shape: Vec<usize>,
    /// Order in which rays of a picture are traced; none for any others.
    order: Option<Vec<u32>>,
}

/// Pixels along the side of a tile of a picture.
const TILE: u32 = 32;

impl<'py> RayArray<'py> {
    /// Looks at an array.
    pub fn new(rays: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (array, shape): (Bound<'_, PyAny>, Vec<usize>) =
            checked(rays.py(), "rays", (rays,))?.extract()?;
        let order = match shape[..] {
            [height, width] => tile_order(height, width),
            _ => None,
        };
        Ok(Self { array, shape, order })
    }

    /// Returns the rays relative to the origin of a view's scene, in the order in which they are traced. They are copied
    /// while the interpreter waits: whoever changes the array later changes nothing.
    pub fn in_scene(&self, view: &LiveView, t_range: (f32, f32)) -> PyResult<WorldRays> {
        if self.array.cast::<PyArrayDyn<f32>>().is_ok() {
            return with_slice::<f32, _>(&self.array, |numbers| {
                let rays = numbers.as_chunks::<6>().0;
                self.ordered(rays, |ray| ray.map(f64::from), view, t_range)
            });
        }
        with_slice::<f64, _>(&self.array, |numbers| {
            self.ordered(numbers.as_chunks::<6>().0, |ray| *ray, view, t_range)
        })
    }

    fn ordered<T: Sync>(
        &self,
        rays: &[[T; 6]],
        ray: impl Fn(&[T; 6]) -> [f64; 6] + Sync + Send,
        view: &LiveView,
        t_range: (f32, f32),
    ) -> WorldRays {
        match self.order.as_deref() {
            Some(order) => {
                let rays = order.par_iter().map(|i| ray(&rays[*i as usize]));
                WorldRays::new(rays, t_range, &view.flat)
            }
            None => WorldRays::new(rays.par_iter().map(ray), t_range, &view.flat),
        }
    }

    /// Returns the interpreter.
    pub fn py(&self) -> Python<'py> {
        self.array.py()
    }

    /// Puts answers into the order of the array.
    pub fn restored<T: Copy + Default>(&self, answers: Vec<T>) -> Vec<T> {
        let Some(order) = &self.order else { return answers };
        let mut restored = vec![T::default(); answers.len()];
        for (i, answer) in order.iter().zip(answers) {
            restored[*i as usize] = answer;
        }
        restored
    }
}

/// Returns the pixels of a picture tile by tile, along a Morton curve inside each: rays of neighbouring pixels, traced
/// together, visit the same nodes. Returns none for pictures without two dimensions.
fn tile_order(height: usize, width: usize) -> Option<Vec<u32>> {
    let (height, width) = (u32::try_from(height).ok()?, u32::try_from(width).ok()?);
    if height < 2 || width < 2 || height.checked_mul(width).is_none() {
        return None;
    }
    let corners = |size: u32| (0..size).step_by(TILE as usize);
    let tiles = corners(height).flat_map(|y| corners(width).map(move |x| (x, y)));
    let pixels = tiles.flat_map(|(x, y)| {
        (0..TILE * TILE).map(morton_decode).map(move |(column, row)| (x + column, y + row))
    });
    let inside = pixels.filter(|(x, y)| *x < width && *y < height);
    let mut order = Vec::with_capacity(height as usize * width as usize);
    order.extend(inside.map(|(x, y)| y * width + x));
    Some(order)
}

/// Returns hits as a dict of arrays; `contents` has the number of what each instance shows.
pub fn ray_hits<'py>(
    py: Python<'py>,
    rays: &RayArray<'_>,
    hits: RayHits,
    contents: &[u32],
) -> PyResult<Bound<'py, PyDict>> {
    let shape = &rays.shape;
    let content = |instance: u32| contents.get(instance as usize).copied().unwrap_or(NO_ID);
    let geometries: Vec<u32> = hits.instances.into_par_iter().map(content).collect();
    let vectors = shape.iter().copied().chain([3]).collect();
    let normals = bytemuck::cast_vec::<[f32; 3], f32>(rays.restored(hits.normals));
    let all = PyDict::new(py);
    all.set_item("t_hit", owned_array(py, rays.restored(hits.t_hit), shape.clone())?)?;
    all.set_item("geometry_ids", owned_array(py, rays.restored(geometries), shape.clone())?)?;
    all.set_item("primitive_ids", owned_array(py, rays.restored(hits.primitives), shape.clone())?)?;
    all.set_item("primitive_normals", owned_array(py, normals, vectors)?)?;
    all.set_item("point_ids", owned_array(py, rays.restored(hits.points), shape.clone())?)?;
    Ok(all)
}

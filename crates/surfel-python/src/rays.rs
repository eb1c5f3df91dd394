//! Rays as arrays, and what they hit.

use crate::array::{checked, with_slice};
use crate::buffer::owned_array;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use surfel::live_view::LiveView;
use surfel::ray_query::{RayCaster, RayHits, WorldRays};
use surfel_core::image::NO_ID;
use surfel_core::math::morton_decode;
use surfel_core::progress::Progress;
use surfel_core::trace::Simd;

/// Rays of an array (..., 6).
pub struct RayArray<'py> {
    /// Rows of six numbers, one after the other.
    array: Bound<'py, PyAny>,
    /// Shape of what is said of each ray.
    pub shape: Vec<usize>,
    /// Order in which rays of a picture are traced; none for any others.
    order: Option<TileOrder>,
}

/// The numbers of rays, which are read without the interpreter.
pub struct RayRows<'a> {
    numbers: RayNumbers<'a>,
    order: Option<&'a TileOrder>,
}

enum RayNumbers<'a> {
    Single(&'a [f32]),
    Double(&'a [f64]),
}

/// Pixels along the side of a tile of a picture.
const TILE: u32 = 32;

impl<'py> RayArray<'py> {
    /// Looks at an array.
    pub fn new(rays: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (array, shape): (Bound<'_, PyAny>, Vec<usize>) =
            checked(rays.py(), "rays", (rays,))?.extract()?;
        let order = match shape[..] {
            [height, width] => TileOrder::new(height, width),
            _ => None,
        };
        Ok(Self { array, shape, order })
    }

    /// Calls `read` with the numbers of the rays.
    pub fn with_rows<R>(&self, read: impl FnOnce(RayRows<'_>) -> PyResult<R>) -> PyResult<R> {
        let order = self.order.as_ref();
        if self.array.cast::<PyArrayDyn<f32>>().is_ok() {
            return with_slice(&self.array, |numbers| {
                read(RayRows { numbers: RayNumbers::Single(numbers), order })
            })?;
        }
        with_slice(&self.array, |numbers| {
            read(RayRows { numbers: RayNumbers::Double(numbers), order })
        })?
    }

    /// Returns the interpreter.
    pub fn py(&self) -> Python<'py> {
        self.array.py()
    }
}

impl RayRows<'_> {
    /// Returns the rays relative to the origin of a view's scene, in the order in which they are traced.
    fn in_scene(&self, view: &LiveView, t_range: (f32, f32)) -> WorldRays {
        match self.numbers {
            RayNumbers::Single(numbers) => {
                self.ordered(numbers.as_chunks().0, |ray| ray.map(f64::from), view, t_range)
            }
            RayNumbers::Double(numbers) => {
                self.ordered(numbers.as_chunks().0, |ray| *ray, view, t_range)
            }
        }
    }

    fn ordered<T: Sync>(
        &self,
        rays: &[[T; 6]],
        ray: impl Fn(&[T; 6]) -> [f64; 6] + Sync + Send,
        view: &LiveView,
        t_range: (f32, f32),
    ) -> WorldRays {
        match self.order {
            Some(order) => {
                let pixels = (0..rays.len()).into_par_iter().map(|i| ray(&rays[order.pixel(i)]));
                WorldRays::new(pixels, t_range, &view.flat)
            }
            None => WorldRays::new(rays.par_iter().map(ray), t_range, &view.flat),
        }
    }

    /// Puts answers into the order of the array.
    fn restored<T: Copy + Send>(&self, mut answers: Vec<T>) -> Vec<T> {
        let Some(order) = self.order else { return answers };
        // In place, row by row of tiles, so that no second copy of the columns is held.
        answers.par_chunks_mut(order.row.len()).for_each_init(Vec::new, |ordered, row| {
            ordered.clear();
            ordered.extend_from_slice(row);
            for (pixel, answer) in order.of_row(row.len()).iter().zip(ordered.iter()) {
                row[*pixel as usize] = *answer;
            }
        });
        answers
    }
}

/// The nearest surfaces on rays, as Python has them. Ids are `NO_ID` where there is none.
pub struct HitColumns {
    /// Distance in multiples of the length of the direction; infinite without a hit.
    t_hit: Vec<f32>,
    /// Number of what was added.
    geometry_ids: Vec<u32>,
    /// Index of the triangle, or of the nearest point.
    primitive_ids: Vec<u32>,
    /// Index of the nearest point.
    point_ids: Vec<u32>,
    /// Unit normal that faces the ray's origin.
    normals: Vec<[f32; 3]>,
}

/// Rays that are cast at a view. Each answer is in the order of the array.
pub struct ViewRays<'a> {
    view: &'a LiveView,
    caster: RayCaster<'a>,
    /// The rays in the order in which they are traced.
    rays: WorldRays,
    rows: RayRows<'a>,
}

impl<'a> ViewRays<'a> {
    /// Rays at a view, of which the part `t_range` counts.
    ///
    /// # Errors
    ///
    /// Fails for views of round points, which have no surface.
    pub fn new(
        rows: RayRows<'a>,
        t_range: (f32, f32),
        view: &'a LiveView,
        simd: Simd,
    ) -> surfel::Result<Self> {
        let caster = view.ray_caster(simd)?;
        Ok(Self { view, caster, rays: rows.in_scene(view, t_range), rows })
    }

    /// Finds the nearest surfaces.
    pub fn hits(&self, progress: &dyn Progress) -> surfel::Result<HitColumns> {
        let RayHits { t_hit, instances, triangles, points, normals } =
            self.caster.hits(&self.rays, progress)?;
        let contents = self.view.contents();
        let content = |instance: u32| contents.get(instance as usize).copied().unwrap_or(NO_ID);
        let (mut geometry_ids, mut primitive_ids) = (instances, triangles);
        geometry_ids.par_iter_mut().for_each(|id| *id = content(*id));
        // The number of no triangle is greater than that of any point.
        primitive_ids.par_iter_mut().zip(&points).for_each(|(id, point)| *id = (*id).min(*point));
        Ok(HitColumns {
            t_hit: self.rows.restored(t_hit),
            geometry_ids: self.rows.restored(geometry_ids),
            primitive_ids: self.rows.restored(primitive_ids),
            point_ids: self.rows.restored(points),
            normals: self.rows.restored(normals),
        })
    }

    /// Finds out whether any surface lies on each ray.
    pub fn occlusions(&self, progress: &dyn Progress) -> surfel::Result<Vec<bool>> {
        Ok(self.rows.restored(self.caster.occlusions(&self.rays, progress)?))
    }

    /// Counts the surfaces on each ray.
    pub fn counts(&self, progress: &dyn Progress) -> surfel::Result<Vec<i32>> {
        let counts = self.rows.restored(self.caster.counts(&self.rays, progress)?);
        Ok(counts.into_iter().map(|n| n as i32).collect())
    }
}

/// The pixels of a picture tile by tile, along a Morton curve inside each: rays of neighbouring pixels, traced together,
/// visit the same nodes. Each row of tiles is a part of the picture by itself.
struct TileOrder {
    /// Pixels of a row of tiles, by their index in it.
    row: Vec<u32>,
    /// Pixels of the last row, which may have fewer.
    last: Vec<u32>,
    /// Number of pixels of all rows but the last.
    n_before_last: usize,
}

impl TileOrder {
    /// Returns the order of a picture; none for arrays without two dimensions.
    fn new(height: usize, width: usize) -> Option<Self> {
        let (height, width) = (u32::try_from(height).ok()?, u32::try_from(width).ok()?);
        if height < 2 || width < 2 || height.checked_mul(width).is_none() {
            return None;
        }
        let last_height = (height - 1) % TILE + 1;
        let n_before_last = (height - last_height) as usize * width as usize;
        let [row, last] = [TILE.min(height), last_height].map(|height| tile_row(height, width));
        Some(Self { row, last, n_before_last })
    }

    /// Returns the pixel of the `i`-th ray.
    fn pixel(&self, i: usize) -> usize {
        if self.n_before_last <= i {
            return self.n_before_last + self.last[i - self.n_before_last] as usize;
        }
        // Pictures have fewer pixels than 32 bits count, whose remainders are faster than those of 64 bits.
        let within = i as u32 % self.row.len() as u32;
        i - within as usize + self.row[within as usize] as usize
    }

    /// Returns the order of a row of so many pixels.
    fn of_row(&self, n_pixels: usize) -> &[u32] {
        if n_pixels == self.row.len() { &self.row } else { &self.last }
    }
}

/// Returns the pixels of a row of tiles of this height.
fn tile_row(height: u32, width: u32) -> Vec<u32> {
    let tiles = (0..width).step_by(TILE as usize);
    let pixels = tiles.flat_map(|x| {
        (0..TILE * TILE).map(morton_decode).map(move |(column, row)| (x + column, row))
    });
    let inside = pixels.filter(|(x, y)| *x < width && *y < height);
    inside.map(|(x, y)| y * width + x).collect()
}

/// Returns hits as a dict of arrays of this shape.
pub fn ray_hits<'py>(
    py: Python<'py>,
    shape: &[usize],
    hits: HitColumns,
) -> PyResult<Bound<'py, PyDict>> {
    let vectors = shape.iter().copied().chain([3]).collect();
    let normals = bytemuck::cast_vec::<[f32; 3], f32>(hits.normals);
    let all = PyDict::new(py);
    all.set_item("t_hit", owned_array(py, hits.t_hit, shape.to_vec())?)?;
    all.set_item("geometry_ids", owned_array(py, hits.geometry_ids, shape.to_vec())?)?;
    all.set_item("primitive_ids", owned_array(py, hits.primitive_ids, shape.to_vec())?)?;
    all.set_item("primitive_normals", owned_array(py, normals, vectors)?)?;
    all.set_item("point_ids", owned_array(py, hits.point_ids, shape.to_vec())?)?;
    Ok(all)
}

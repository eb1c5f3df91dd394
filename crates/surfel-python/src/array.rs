//! Arrays of numpy as columns of Rust.

use crate::errors::invalid_array;
use crate::work;
use numpy::{Element, PyArrayDyn, PyArrayMethods};
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use rayon::prelude::*;
use surfel_core::math::{DVec3, Vec3};
use surfel_core::points::PointCloud;

/// Number of points that a thread converts at a time.
const CHUNK: usize = 1 << 16;

/// Number of points that decide where the origin lies.
const ORIGIN_SAMPLE: usize = 4096;

/// Calls a function of the module that looks at what users hand over.
pub fn checked<'py>(
    py: Python<'py>,
    function: &str,
    arguments: impl PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("surfel._arrays")?.call_method1(function, arguments)
}

/// Copies an array whose rows lie one after the other.
pub fn column<T: Element + Copy + Send>(array: &Bound<'_, PyAny>) -> PyResult<Vec<T>> {
    converted(array, <[T]>::to_vec)
}

/// Calls `read` with the numbers of an array whose rows lie one after the other.
pub fn with_slice<T: Element, R>(
    array: &Bound<'_, PyAny>,
    read: impl FnOnce(&[T]) -> R,
) -> PyResult<R> {
    let array = array.cast::<PyArrayDyn<T>>()?.readonly();
    let numbers =
        array.as_slice().map_err(|error| invalid_array(array.py(), &error.to_string()))?;
    Ok(read(numbers))
}

/// Calls `convert` with the numbers of an array whose rows lie one after the other, without the interpreter.
fn converted<T: Element, R: Send>(
    array: &Bound<'_, PyAny>,
    convert: impl FnOnce(&[T]) -> R + Send,
) -> PyResult<R> {
    with_slice(array, |numbers| work::detached(array.py(), || convert(numbers)))?
}

/// Returns true for an array of float32.
fn is_single(array: &Bound<'_, PyAny>) -> bool {
    array.cast::<PyArrayDyn<f32>>().is_ok()
}

/// Reads an array of three numbers a row as vectors.
pub fn vectors(array: &Bound<'_, PyAny>) -> PyResult<Vec<Vec3>> {
    if is_single(array) {
        return converted::<f32, _>(array, |numbers| bytemuck::cast_slice(numbers).to_vec());
    }
    converted::<f64, _>(array, |numbers| relative(numbers, DVec3::ZERO))
}

/// Reads an array of numbers as float32.
pub fn singles(array: &Bound<'_, PyAny>) -> PyResult<Vec<f32>> {
    if is_single(array) {
        return column(array);
    }
    converted::<f64, _>(array, |numbers| numbers.iter().map(|x| *x as f32).collect())
}

/// Reads world positions, and chooses the origin that the result counts from.
pub fn positions(array: &Bound<'_, PyAny>) -> PyResult<(DVec3, Vec<Vec3>)> {
    if is_single(array) {
        return converted::<f32, _>(array, with_origin);
    }
    converted::<f64, _>(array, with_origin)
}

fn with_origin<T: Copy + Into<f64> + Sync>(numbers: &[T]) -> (DVec3, Vec<Vec3>) {
    let (rows, _) = numbers.as_chunks::<3>();
    let step = rows.len().div_ceil(ORIGIN_SAMPLE).max(1);
    let sample: Vec<DVec3> = rows.iter().step_by(step).map(vector).collect();
    let origin = PointCloud::choose_origin(&sample);
    (origin, relative(numbers, origin))
}

fn relative<T: Copy + Into<f64> + Sync>(numbers: &[T], origin: DVec3) -> Vec<Vec3> {
    let (rows, _) = numbers.as_chunks::<3>();
    let local = |row: &[T; 3]| (vector(row) - origin).as_vec3();
    rows.par_iter().with_min_len(CHUNK).map(local).collect()
}

fn vector<T: Copy + Into<f64>>(row: &[T; 3]) -> DVec3 {
    DVec3::from_array(row.map(Into::into))
}

/// Reads integer coordinates of three columns, as LAS files hold them: `scale * integer + offset`.
pub fn scaled_positions(
    columns: &[Bound<'_, PyAny>; 3],
    scales: DVec3,
    offsets: DVec3,
) -> PyResult<(DVec3, Vec<Vec3>)> {
    let [x, y, z] = columns;
    let columns: [Vec<i32>; 3] = [column(x)?, column(y)?, column(z)?];
    let world = |i: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(columns[axis][i]));
        scales * DVec3::new(x, y, z) + offsets
    };
    work::detached(x.py(), || {
        let n_points = columns.iter().map(Vec::len).min().unwrap_or_default();
        let step = n_points.div_ceil(ORIGIN_SAMPLE).max(1);
        let sample: Vec<DVec3> = (0..n_points).step_by(step).map(world).collect();
        let origin = PointCloud::choose_origin(&sample);
        let all = (0..n_points).into_par_iter().with_min_len(CHUNK);
        (origin, all.map(|i| (world(i) - origin).as_vec3()).collect())
    })
}

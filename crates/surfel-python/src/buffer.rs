//! Columns that Rust holds as arrays of numpy, none of which is copied: those that are shared are read-only.

use bytemuck::Pod;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::any::Any;
use std::sync::Arc;

/// Memory that arrays share; they keep it alive.
#[pyclass(frozen, module = "surfel._native", name = "Buffer")]
pub struct Buffer {
    /// Owner of the memory.
    _owner: Arc<dyn Any + Send + Sync>,
    address: usize,
    shape: Vec<usize>,
    type_name: &'static str,
}

#[pymethods]
impl Buffer {
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        interface.set_item("typestr", self.type_name)?;
        let is_read_only = true;
        interface.set_item("data", (self.address, is_read_only))?;
        Ok(interface)
    }
}

/// A number that arrays hold.
pub trait Element: Pod {
    /// Name of the type in the array interface, with its byte order.
    const TYPE_NAME: &'static str;
}

macro_rules! element {
    ($($number:ty: $little:literal, $big:literal;)*) => {
        $( impl Element for $number {
            const TYPE_NAME: &'static str =
                if cfg!(target_endian = "little") { $little } else { $big };
        } )*
    };
}

element! {
    u8: "|u1", "|u1";
    u16: "<u2", ">u2";
    u32: "<u4", ">u4";
    i32: "<i4", ">i4";
    f32: "<f4", ">f4";
    f64: "<f8", ">f8";
}

/// Shows numbers in memory that `owner` holds, and never changes, as an array.
pub fn shared_array<'py, E: Element, O: Any + Send + Sync>(
    py: Python<'py>,
    owner: &Arc<O>,
    numbers: &[E],
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    assert_eq!(
        numbers.len(),
        shape.iter().product::<usize>(),
        "a column has the shape of its array"
    );
    // The address of nothing is that of no memory; numpy refuses it.
    let address = numbers.as_ptr() as usize;
    let owner: Arc<dyn Any + Send + Sync> = owner.clone();
    let buffer = Buffer { _owner: owner, address, shape, type_name: E::TYPE_NAME };
    py.import("numpy")?.call_method1("asarray", (Bound::new(py, buffer)?,))
}

/// Returns an array as the protocol `__array__` asks for it: in this type, and copied always, never, or where it must be.
pub fn as_numpy<'py>(
    array: Bound<'py, PyAny>,
    dtype: Option<&Bound<'py, PyAny>>,
    copy: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let numpy = array.py().import("numpy")?;
    // Versions before 2 know no `copy=None`.
    let Some(copy) = copy else { return numpy.call_method1("asarray", (array, dtype)) };
    let keywords = PyDict::new(array.py());
    keywords.set_item("copy", copy)?;
    numpy.call_method("array", (array, dtype), Some(&keywords))
}

/// Makes an array of numbers that belongs to the caller, who may write to it.
pub fn owned_array<'py, E: numpy::Element>(
    py: Python<'py>,
    numbers: Vec<E>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    Ok(numbers.into_pyarray(py).reshape(shape)?.into_any())
}

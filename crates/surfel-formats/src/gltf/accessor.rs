//! Accessors: typed columns of numbers in buffers. All claims of an accessor are checked before it is read.

use std::array;
use surfel_core::words::counted;

use super::document::Document;
use super::json::Json;
use crate::error::{Error, Result};

/// A checked accessor.
pub(super) struct Accessor<'a> {
    /// The accessor's JSON.
    pub json: Json<'a>,
    /// Number of elements.
    pub count: usize,
    element_type: &'a str,
    component_type: ComponentType,
    is_normalized: bool,
    base: Option<StridedElements<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Conversion of integer components to floats.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum IntegerPolicy {
    /// Only 32-bit floats are allowed.
    Reject,
    /// 8- and 16-bit integers are allowed, and normalised if the accessor declares it.
    AsDeclared,
    /// 8- and 16-bit integers are allowed and always normalised, as colours and weights must be. Some exporters
    /// omit the declaration.
    Normalize,
}

/// The storage type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

/// Elements in a buffer at a constant stride.
#[derive(Clone, Copy)]
struct StridedElements<'a> {
    bytes: &'a [u8],
    /// Distance in bytes between consecutive elements.
    stride: usize,
    /// Size of an element in bytes.
    size: usize,
}

/// Replacements of single elements of an accessor.
struct Sparse<'a> {
    /// Indices of the replaced elements, strictly increasing.
    indices: Vec<u32>,
    values: StridedElements<'a>,
}

/// An element of an accessor without data. The largest element is a matrix of 16 floats.
static ZEROS: [u8; 64] = [0; 64];

impl<'a> Accessor<'a> {
    /// Opens the accessor at the index `reference`.
    pub fn open(document: &Document<'a>, reference: &Json<'a>) -> Result<Self> {
        let json = document.resolve("accessors", reference)?;
        let component_type = ComponentType::from_json(&json.require("componentType")?)?;
        let element_type = json.require("type")?;
        let n_components = match element_type.string()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => {
                return Err(element_type.type_error("SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4"));
            }
        };
        let size = n_components * component_type.size();
        let count = json.require("count")?.index()?;
        let base = json.get("bufferView");
        let base = base.map(|view| StridedElements::open(document, &json, &view, count, size));
        let sparse = json.get("sparse");
        let sparse = sparse.map(|sparse| Sparse::open(document, &sparse, count, size));
        Ok(Self {
            count,
            element_type: element_type.string()?,
            component_type,
            is_normalized: json.boolean_or("normalized", false)?,
            base: base.transpose()?,
            sparse: sparse.transpose()?,
            json,
        })
    }

    /// Returns the element type, such as `VEC3`.
    pub fn element_type(&self) -> &'a str {
        self.element_type
    }

    /// Returns true if no buffer holds the elements, for example because an extension would provide them.
    pub fn has_no_data(&self) -> bool {
        self.base.is_none() && self.sparse.is_none()
    }

    /// Reads all elements as floats, or the elements at the valid indices `selected`.
    pub fn floats<const N: usize>(
        &self,
        document: &Document,
        integers: IntegerPolicy,
        selected: Option<&[u32]>,
    ) -> Result<Vec<[f32; N]>> {
        self.check_element_type::<N>()?;
        let is_normalized = integers == IntegerPolicy::Normalize
            || integers == IntegerPolicy::AsDeclared && self.is_normalized;
        let divisor = |largest: f32| if is_normalized { largest } else { 1.0 };
        let (i8s, i16s) = (divisor(127.0), divisor(32767.0));
        let (u8s, u16s) = (divisor(255.0), divisor(65535.0));
        // The most negative integer would otherwise become less than -1.
        let min = if is_normalized { -1.0 } else { f32::NEG_INFINITY };
        match (self.component_type, integers) {
            (ComponentType::F32, _) => self.read(document, selected, f32::from_le_bytes),
            (ComponentType::U32, _) | (_, IntegerPolicy::Reject) => {
                Err(self.component_error(match integers {
                    IntegerPolicy::Reject => "5126 (float)",
                    _ => "5126 (float) or integers of 8 or 16 bits",
                }))
            }
            (ComponentType::I8, _) => self.read(document, selected, |bytes| {
                (f32::from(i8::from_le_bytes(bytes)) / i8s).max(min)
            }),
            (ComponentType::I16, _) => self.read(document, selected, |bytes| {
                (f32::from(i16::from_le_bytes(bytes)) / i16s).max(min)
            }),
            (ComponentType::U8, _) => {
                self.read(document, selected, |bytes| f32::from(u8::from_le_bytes(bytes)) / u8s)
            }
            (ComponentType::U16, _) => {
                self.read(document, selected, |bytes| f32::from(u16::from_le_bytes(bytes)) / u16s)
            }
        }
    }

    /// Reads all elements as unsigned integers, or the elements at the valid indices `selected`.
    pub fn integers<const N: usize>(
        &self,
        document: &Document,
        selected: Option<&[u32]>,
    ) -> Result<Vec<[u32; N]>> {
        self.check_element_type::<N>()?;
        match self.component_type {
            ComponentType::U8 => {
                self.read(document, selected, |bytes| u32::from(u8::from_le_bytes(bytes)))
            }
            ComponentType::U16 => {
                self.read(document, selected, |bytes| u32::from(u16::from_le_bytes(bytes)))
            }
            ComponentType::U32 => self.read(document, selected, u32::from_le_bytes),
            _ => Err(self.component_error("5121, 5123 or 5125 (unsigned integers)")),
        }
    }

    fn read<T, const SIZE: usize, const N: usize>(
        &self,
        document: &Document,
        selected: Option<&[u32]>,
        decode: impl Fn([u8; SIZE]) -> T,
    ) -> Result<Vec<[T; N]>> {
        let n = selected.map_or(self.count, <[u32]>::len);
        document.reserve(&self.json, n, size_of::<[T; N]>())?;
        let element = |i: usize| {
            let bytes = self.element(i);
            array::from_fn(|k| decode(array::from_fn(|byte| bytes[SIZE * k + byte])))
        };
        Ok(match selected {
            Some(selected) => selected.iter().map(|&i| element(i as usize)).collect(),
            None => (0..self.count).map(element).collect(),
        })
    }

    /// Returns the bytes of an element.
    fn element(&self, i: usize) -> &[u8] {
        if let Some(Sparse { indices, values }) = &self.sparse
            && let Ok(at) = indices.binary_search(&(i as u32))
        {
            return values.element(at);
        }
        self.base.as_ref().map_or(&ZEROS, |base| base.element(i))
    }

    fn check_element_type<const N: usize>(&self) -> Result<()> {
        let expected = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        if self.element_type == expected {
            return Ok(());
        }
        let found = format!("type {}", self.element_type);
        Err(self.json.error(found, format!("{expected} for this use")))
    }

    fn component_error(&self, expected: &str) -> Error {
        let found = format!("components of type {:?}", self.component_type);
        self.json.error(found, format!("{expected} for this use"))
    }
}

impl<'a> StridedElements<'a> {
    /// Opens `count` elements of `size` bytes at the offset in `json` of a buffer view.
    fn open(
        document: &Document<'a>,
        json: &Json<'a>,
        view_ref: &Json<'a>,
        count: usize,
        size: usize,
    ) -> Result<Self> {
        let view = document.view(view_ref)?;
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            let found = format!("a byteStride of {stride} in bufferView {}", view_ref.index()?);
            return Err(
                json.error(found, format!("at least the {} of an element", counted(size, "byte")))
            );
        }
        let offset = json.unsigned_or("byteOffset", 0)?;
        // 128 bits cannot overflow.
        let last = count.saturating_sub(1) as u128 * stride as u128;
        let needed = if count == 0 { 0 } else { u128::from(offset) + last + size as u128 };
        let n_bytes = view.bytes.len();
        if (n_bytes as u128) < needed {
            let found = format!(
                "{} of {}, {stride} apart, from {offset}",
                counted(count, "element"),
                counted(size, "byte")
            );
            return Err(
                json.error(found, format!("{} at most, as the view has", counted(n_bytes, "byte")))
            );
        }
        let bytes = if count == 0 { &[] } else { &view.bytes[offset as usize..] };
        Ok(Self { bytes, stride, size })
    }

    fn element(&self, i: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

impl<'a> Sparse<'a> {
    fn open(
        document: &Document<'a>,
        json: &Json<'a>,
        n_elements: usize,
        size: usize,
    ) -> Result<Self> {
        let count = json.require("count")?.index()?;
        let (indices_json, values) = (json.require("indices")?, json.require("values")?);
        let component_type = ComponentType::from_json(&indices_json.require("componentType")?)?;
        let read: fn(&[u8]) -> u32 = match component_type {
            ComponentType::U8 => |bytes| bytes[0].into(),
            ComponentType::U16 => |bytes| u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            ComponentType::U32 => {
                |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            }
            _ => {
                return Err(indices_json
                    .require("componentType")?
                    .type_error("5121, 5123 or 5125"));
            }
        };
        let view = indices_json.require("bufferView")?;
        let elements =
            StridedElements::open(document, &indices_json, &view, count, component_type.size())?;
        document.reserve(json, count, size_of::<u32>())?;
        let indices: Vec<u32> = (0..count).map(|i| read(elements.element(i))).collect();
        if let Some(i) = (1..count).find(|&i| indices[i] <= indices[i - 1]) {
            let found = format!("{} after {}", indices[i], indices[i - 1]);
            return Err(indices_json.error(found, "increasing indices"));
        }
        if let Some(last) = indices.last().filter(|last| n_elements <= **last as usize) {
            return Err(indices_json
                .error(format!("index {last}"), format!("less than the count of {n_elements}")));
        }
        let view = values.require("bufferView")?;
        Ok(Self { indices, values: StridedElements::open(document, &values, &view, count, size)? })
    }
}

impl ComponentType {
    fn from_json(json: &Json) -> Result<Self> {
        Ok(match json.unsigned()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(json.type_error("5120, 5121, 5122, 5123, 5125 or 5126")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

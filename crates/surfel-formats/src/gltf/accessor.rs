//! Accessors: columns of numbers in buffers. All that one claims is checked before a byte is read.

use std::array;

use super::document::Document;
use super::json::Json;
use crate::error::{Error, Result};

/// A column of `count` elements.
pub(super) struct Accessor<'a> {
    pub json: Json<'a>,
    pub count: usize,
    kind: &'a str,
    component: Component,
    is_normalized: bool,
    base: Option<Elements<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Which numbers a use allows, and what integers mean in it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    /// 32-bit floats alone.
    Float,
    /// Integers of 8 and 16 bits too: as they are, or shares of 1 if the accessor says so.
    Quantized,
    /// The same, but always shares of 1: as colours or weights they would mean nothing otherwise, and some
    /// programs forget to say so.
    Share,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

/// Elements at equal distances.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

/// Elements that stand in for some of the others.
struct Sparse<'a> {
    /// Rising.
    indices: Vec<u32>,
    values: Elements<'a>,
}

/// The largest element is a matrix of 16 floats.
static ZEROS: [u8; 64] = [0; 64];

impl<'a> Accessor<'a> {
    /// The accessor that `reference` names.
    pub fn open(document: &Document<'a>, reference: &Json<'a>) -> Result<Self> {
        let json = document.referred("accessors", reference)?;
        let component = Component::of(&json.need("componentType")?)?;
        let kind = json.need("type")?;
        let n_components = match kind.text()? {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            _ => return Err(kind.unlike("SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4")),
        };
        let size = n_components * component.size();
        let count = json.need("count")?.index()?;
        let base = json.get("bufferView");
        let base = base.map(|view| Elements::open(document, &json, &view, count, size));
        let sparse = json.get("sparse");
        let sparse = sparse.map(|sparse| Sparse::open(document, &sparse, count, size));
        Ok(Self {
            count,
            kind: kind.text()?,
            component,
            is_normalized: json.flag_or("normalized", false)?,
            base: base.transpose()?,
            sparse: sparse.transpose()?,
            json,
        })
    }

    pub fn kind(&self) -> &'a str {
        self.kind
    }

    /// Whether no buffer has its elements, as where an extension was to bring them.
    pub fn is_absent(&self) -> bool {
        self.base.is_none() && self.sparse.is_none()
    }

    /// The elements as floats: all of them, or those `picked`, which has to name elements that there are.
    pub fn floats<const N: usize>(
        &self,
        document: &Document,
        meaning: Meaning,
        picked: Option<&[u32]>,
    ) -> Result<Vec<[f32; N]>> {
        self.check_kind::<N>()?;
        let share =
            meaning == Meaning::Share || meaning == Meaning::Quantized && self.is_normalized;
        let unit = |largest: f32| if share { largest } else { 1.0 };
        let (i8s, i16s) = (unit(127.0), unit(32767.0));
        let (u8s, u16s) = (unit(255.0), unit(65535.0));
        // The most negative integer has no positive twin.
        let lowest = if share { -1.0 } else { f32::NEG_INFINITY };
        match (self.component, meaning) {
            (Component::F32, _) => self.read(document, picked, f32::from_le_bytes),
            (Component::U32, _) | (_, Meaning::Float) => Err(self.unfit_component(match meaning {
                Meaning::Float => "5126 (float)",
                _ => "5126 (float) or integers of 8 or 16 bits",
            })),
            (Component::I8, _) => self.read(document, picked, |bytes| {
                (f32::from(i8::from_le_bytes(bytes)) / i8s).max(lowest)
            }),
            (Component::I16, _) => self.read(document, picked, |bytes| {
                (f32::from(i16::from_le_bytes(bytes)) / i16s).max(lowest)
            }),
            (Component::U8, _) => {
                self.read(document, picked, |bytes| f32::from(u8::from_le_bytes(bytes)) / u8s)
            }
            (Component::U16, _) => {
                self.read(document, picked, |bytes| f32::from(u16::from_le_bytes(bytes)) / u16s)
            }
        }
    }

    /// The elements as unsigned integers, likewise.
    pub fn integers<const N: usize>(
        &self,
        document: &Document,
        picked: Option<&[u32]>,
    ) -> Result<Vec<[u32; N]>> {
        self.check_kind::<N>()?;
        match self.component {
            Component::U8 => {
                self.read(document, picked, |bytes| u32::from(u8::from_le_bytes(bytes)))
            }
            Component::U16 => {
                self.read(document, picked, |bytes| u32::from(u16::from_le_bytes(bytes)))
            }
            Component::U32 => self.read(document, picked, u32::from_le_bytes),
            _ => Err(self.unfit_component("5121, 5123 or 5125 (unsigned integers)")),
        }
    }

    fn read<T, const SIZE: usize, const N: usize>(
        &self,
        document: &Document,
        picked: Option<&[u32]>,
        decode: impl Fn([u8; SIZE]) -> T,
    ) -> Result<Vec<[T; N]>> {
        let n = picked.map_or(self.count, <[u32]>::len);
        document.charge(&self.json, n, size_of::<[T; N]>())?;
        let element = |i: usize| {
            let bytes = self.element(i);
            array::from_fn(|k| decode(array::from_fn(|byte| bytes[SIZE * k + byte])))
        };
        Ok(match picked {
            Some(picked) => picked.iter().map(|&i| element(i as usize)).collect(),
            None => (0..self.count).map(element).collect(),
        })
    }

    /// The bytes of an element.
    fn element(&self, i: usize) -> &[u8] {
        if let Some(Sparse { indices, values }) = &self.sparse
            && let Ok(at) = indices.binary_search(&(i as u32))
        {
            return values.element(at);
        }
        self.base.as_ref().map_or(&ZEROS, |base| base.element(i))
    }

    fn check_kind<const N: usize>(&self) -> Result<()> {
        let expected = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        if self.kind == expected {
            return Ok(());
        }
        let found = format!("type {}", self.kind);
        Err(self.json.error(found, format!("{expected} for what refers to it")))
    }

    fn unfit_component(&self, expected: &str) -> Error {
        let found = format!("components of kind {:?}", self.component);
        self.json.error(found, format!("{expected} for what refers to it"))
    }
}

impl<'a> Elements<'a> {
    /// `count` elements of `size` bytes from the offset that `json` names in a view.
    fn open(
        document: &Document<'a>,
        json: &Json<'a>,
        view: &Json<'a>,
        count: usize,
        size: usize,
    ) -> Result<Self> {
        let bytes = document.view(view)?;
        let stride = bytes.stride.unwrap_or(size);
        if stride < size {
            let found = format!("a byteStride of {stride} in bufferView {}", view.index()?);
            return Err(json.error(found, format!("at least the {size} bytes of an element")));
        }
        let offset = json.unsigned_or("byteOffset", 0)?;
        // In 128 bits nothing overflows.
        let last = count.saturating_sub(1) as u128 * stride as u128;
        let needed = if count == 0 { 0 } else { u128::from(offset) + last + size as u128 };
        let n_bytes = bytes.bytes.len();
        if (n_bytes as u128) < needed {
            let found = format!("{count} elements of {size} bytes, {stride} apart, from {offset}");
            return Err(json.error(found, format!("{n_bytes} bytes at most, as the view has")));
        }
        let bytes = if count == 0 { &[] } else { &bytes.bytes[offset as usize..] };
        Ok(Self { bytes, stride, size })
    }

    fn element(&self, i: usize) -> &'a [u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

impl<'a> Sparse<'a> {
    fn open(document: &Document<'a>, json: &Json<'a>, n: usize, size: usize) -> Result<Self> {
        let count = json.need("count")?.index()?;
        let (at, values) = (json.need("indices")?, json.need("values")?);
        let component = Component::of(&at.need("componentType")?)?;
        let read: fn(&[u8]) -> u32 = match component {
            Component::U8 => |bytes| bytes[0].into(),
            Component::U16 => |bytes| u16::from_le_bytes([bytes[0], bytes[1]]).into(),
            Component::U32 => |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            _ => return Err(at.need("componentType")?.unlike("5121, 5123 or 5125")),
        };
        let view = at.need("bufferView")?;
        let elements = Elements::open(document, &at, &view, count, component.size())?;
        document.charge(json, count, size_of::<u32>())?;
        let indices: Vec<u32> = (0..count).map(|i| read(elements.element(i))).collect();
        if let Some(i) = (1..count).find(|&i| indices[i] <= indices[i - 1]) {
            let found = format!("{} after {}", indices[i], indices[i - 1]);
            return Err(at.error(found, "indices that rise"));
        }
        if let Some(last) = indices.last().filter(|last| n <= **last as usize) {
            return Err(at.error(format!("index {last}"), format!("less than the count of {n}")));
        }
        let view = values.need("bufferView")?;
        Ok(Self { indices, values: Elements::open(document, &values, &view, count, size)? })
    }
}

impl Component {
    fn of(json: &Json) -> Result<Self> {
        Ok(match json.unsigned()? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(json.unlike("5120, 5121, 5122, 5123, 5125 or 5126")),
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

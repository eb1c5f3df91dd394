//! Walks over binary elements whose lists make them of different lengths.

use surfel::progress::Progress;

use super::header::{Element, Property};
use super::read::truncated;
use crate::error::{Error, Place, Result};
use crate::input::Input;
use crate::record::Field;

/// The vertices without their lists.
pub(super) fn pack_vertices(
    input: &Input,
    start: usize,
    vertex: &Element,
    big_endian: bool,
    progress: &dyn Progress,
) -> Result<Vec<u8>> {
    let mut packed = Vec::new();
    let mut at = start;
    for point in 0..vertex.count {
        if point % 65536 == 0 {
            progress.check()?;
        }
        for property in &vertex.properties {
            let end = property_end(input, at, property, big_endian)
                .ok_or_else(|| truncated(input, point, vertex))?;
            if property.list.is_none() {
                packed.extend_from_slice(&input[at..end]);
            }
            at = end;
        }
    }
    Ok(packed)
}

/// The first byte behind all of `element`, which begins at `start`.
pub(super) fn skip_elements(
    input: &Input,
    start: usize,
    element: &Element,
    big_endian: bool,
    progress: &dyn Progress,
) -> Result<usize> {
    let ends_early = || ends_early(input, element);
    if let Some(stride) = element.stride() {
        let length = element.count.checked_mul(stride as u64).ok_or_else(ends_early)?;
        let end = length.checked_add(start as u64).filter(|end| *end <= input.len() as u64);
        return end.map(|end| end as usize).ok_or_else(ends_early);
    }
    let mut at = start;
    for count in 0..element.count {
        if count % 65536 == 0 {
            progress.check()?;
        }
        for property in &element.properties {
            at = property_end(input, at, property, big_endian).ok_or_else(ends_early)?;
        }
    }
    Ok(at)
}

/// The error of a file that ends within `element`.
pub(super) fn ends_early(input: &Input, element: &Element) -> Error {
    input.malformed(
        Place::Byte(input.len() as u64),
        "the end of the file",
        format!("{} elements `{}`", element.count, element.name),
        "copy the file again from its source",
    )
}

/// The first byte behind the property at `at`, if the file holds all of it.
pub(super) fn property_end(
    bytes: &[u8],
    at: usize,
    property: &Property,
    big_endian: bool,
) -> Option<usize> {
    let (at, n_items) = match property.list {
        None => (at, 1),
        Some(kind) => {
            let length = bytes.get(at..)?.get(..kind.size())?;
            let n_items = Field::new(0, kind).value(length, big_endian);
            // The cast takes a negative length to zero items.
            (at + kind.size(), n_items as usize)
        }
    };
    let end = n_items.checked_mul(property.kind.size())?.checked_add(at)?;
    (end <= bytes.len()).then_some(end)
}

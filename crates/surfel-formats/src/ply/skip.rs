//! Skips over binary elements, and packs those whose lists make their lengths vary.

use surfel_core::progress::Progress;

use super::header::{Element, Property};
use crate::error::Result;
use crate::file::Input;
use crate::salvage::Salvage;
use crate::table::Field;

/// Returns the binary vertices without their lists, as records of fixed length.
pub(super) fn pack_vertices(
    salvage: &mut Salvage,
    start: usize,
    vertex: &Element,
    big_endian: bool,
    progress: &dyn Progress,
) -> Result<Vec<u8>> {
    let input = salvage.input;
    let mut packed = Vec::new();
    let mut at = start;
    for point in 0..vertex.count {
        if point % 65536 == 0 {
            progress.check()?;
        }
        let n_whole = packed.len();
        for property in &vertex.properties {
            let Some(end) = property_end(input, at, property, big_endian) else {
                salvage.accept(vertex.truncated(input, point))?;
                packed.truncate(n_whole);
                return Ok(packed);
            };
            if property.length_type.is_none() {
                packed.extend_from_slice(&input[at..end]);
            }
            at = end;
        }
    }
    Ok(packed)
}

/// Returns the first byte after the binary elements of kind `element`, which begin at `start`.
pub(super) fn skip_elements(
    input: &Input,
    start: usize,
    element: &Element,
    big_endian: bool,
    progress: &dyn Progress,
) -> Result<usize> {
    let ends_early = || element.ends_early(input);
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

/// Returns the first byte after the binary property at `at`; `None` if the file ends before.
pub(super) fn property_end(
    bytes: &[u8],
    at: usize,
    property: &Property,
    big_endian: bool,
) -> Option<usize> {
    let (at, n_items) = match property.length_type {
        None => (at, 1),
        Some(length_type) => {
            let length = bytes.get(at..)?.get(..length_type.size())?;
            let n_items = Field::new(0, length_type).value(length, big_endian);
            // The cast turns a negative length into zero items.
            (at + length_type.size(), n_items as usize)
        }
    };
    let end = n_items.checked_mul(property.number_type.size())?.checked_add(at)?;
    (end <= bytes.len()).then_some(end)
}

//! The header of a file and its XML, which describes the scans.

use std::io::Cursor;

use e57::{E57Reader, Image, PointCloud};

use super::pages::{PAGE_LENGTH, Pages};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;

/// Bytes of the header.
const HEADER_LENGTH: usize = 48;

/// The descriptions in a file.
pub(super) struct Document {
    /// Descriptions of the scans, which have points.
    pub scans: Vec<PointCloud>,
    /// Descriptions of the pictures.
    pub images: Vec<Image>,
    /// Coordinate system of the scans, as WKT or in the words of the file.
    pub coordinate_system: Option<String>,
}

const ADVICE: &str = "copy the file again from its source, or write it again";

/// Checks the header and returns the number of bytes that belong to the file. That the file ends earlier is damage.
pub(super) fn check_header(salvage: &mut Salvage) -> Result<usize> {
    let input = salvage.input;
    let number = |byte: usize| {
        let bytes = input.get(byte..byte + 8)?.first_chunk()?;
        Some(u64::from_le_bytes(*bytes))
    };
    let numbers = (number(16), number(24), number(32), number(40));
    let (Some(length), Some(xml_start), Some(xml_length), Some(page_length)) = numbers else {
        let location = Location::Byte(input.len() as u64);
        let expected = format!("a header of {HEADER_LENGTH} bytes");
        return Err(input.malformed(location, "the end of the file", expected, ADVICE));
    };
    if page_length != PAGE_LENGTH as u64 {
        let found = format!("pages of {page_length} bytes");
        let expected = format!("{PAGE_LENGTH}, as the standard asks");
        return Err(input.malformed(Location::Byte(40), found, expected, ADVICE));
    }
    if length == 0 || !length.is_multiple_of(page_length) {
        let found = format!("a length of {length} bytes");
        let expected = format!("whole pages of {PAGE_LENGTH}");
        return Err(input.malformed(Location::Byte(16), found, expected, ADVICE));
    }
    if length <= input.len() as u64 {
        return Ok(length as usize);
    }
    let ends_early = |expected: String| {
        let location = Location::Byte(input.len() as u64);
        input.malformed(location, "the end of the file", expected, ADVICE)
    };
    let readable = input.len() - input.len() % PAGE_LENGTH;
    let xml_end = Pages::content_position(xml_start).saturating_add(xml_length);
    if Pages::new(&input[..readable]).len() < xml_end {
        let expected = format!(
            "{length} bytes; the description of the scans, without which no point can be read, is at byte {xml_start}"
        );
        return Err(ends_early(expected));
    }
    salvage.accept(ends_early(format!("{length} bytes, as its header states")))?;
    Ok(readable)
}

/// Reads the XML of a file whose first `length` bytes belong to it.
pub(super) fn read_document(input: &Input, length: usize) -> Result<Document> {
    let reader = E57Reader::new(Cursor::new(&input[..length])).map_err(|error| {
        let expected = "a valid header, and XML that describes the scans";
        input.malformed(Location::Byte(0), format!("an error ({error})"), expected, ADVICE)
    })?;
    let coordinate_system =
        reader.coordinate_metadata().map(str::trim).filter(|text| !text.is_empty());
    Ok(Document {
        scans: reader.pointclouds(),
        images: reader.images(),
        coordinate_system: coordinate_system.map(str::to_owned),
    })
}

//! The header of a file and its XML, which describes the scans.

use std::io::Cursor;
use surfel_core::words::counted;

use e57::{E57Reader, Image, PointCloud};
use surfel_core::progress::Progress;

use super::pages::{HEADER_LENGTH, PAGE_LENGTH, Pages};
use super::partial_xml;
use super::undescribed::{
    NO_PACKET, Undescribed, add_unknown_fields, find_scans, n_other_sections,
};
use crate::error::{Location, Result};
use crate::file::Input;
use crate::salvage::Salvage;

/// Maximum bytes of XML that ends early; the crate that parses it accepts as many.
const MAX_XML_LENGTH: u64 = 50 << 20;

/// The descriptions in a file.
pub(super) struct Document {
    /// Descriptions of the scans, which have points.
    pub scans: Vec<PointCloud>,
    /// Descriptions of the pictures.
    pub images: Vec<Image>,
    /// Coordinate system of the scans, as WKT or in the words of the file.
    pub coordinate_system: Option<String>,
    /// False if the descriptions are missing, and those of the scans say only what the points show.
    pub is_described: bool,
}

const ADVICE: &str = "copy the file again from its source, or write it again";

/// The positions that a valid header states.
pub(super) struct Header {
    /// Number of bytes that belong to the file and are there, in whole pages.
    pub length: usize,
    /// Byte at which the XML begins.
    xml_start: u64,
    /// Bytes of the XML, without checksums.
    xml_length: u64,
}

/// Reads the header. That the file ends earlier than it states is damage.
pub(super) fn read_header(salvage: &mut Salvage) -> Result<Header> {
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
        let found = format!("pages of {}", counted(page_length, "byte"));
        let expected = format!("{PAGE_LENGTH}, as the standard asks");
        return Err(input.malformed(Location::Byte(40), found, expected, ADVICE));
    }
    if length == 0 || !length.is_multiple_of(page_length) {
        let found = format!("a length of {}", counted(length, "byte"));
        let expected = format!("whole pages of {PAGE_LENGTH}");
        return Err(input.malformed(Location::Byte(16), found, expected, ADVICE));
    }
    let readable = (input.len() - input.len() % PAGE_LENGTH) as u64;
    let header = Header { length: length.min(readable) as usize, xml_start, xml_length };
    let xml_end = Pages::content_position(xml_start).saturating_add(xml_length);
    let has_xml = xml_end <= Pages::new(&input[..header.length]).len();
    if has_xml && length <= input.len() as u64 {
        return Ok(header);
    }
    let expected = match has_xml {
        true => format!("{length} bytes, as its header states"),
        false => format!(
            "{length} bytes; the description of the scans, from byte {xml_start} on, is not whole"
        ),
    };
    let location = Location::Byte(input.len() as u64);
    salvage.accept(input.malformed(location, "the end of the file", expected, ADVICE))?;
    Ok(header)
}

/// Reads the XML of a file.
pub(super) fn read_document(input: &Input, header: &Header) -> Result<Document> {
    parse(&input[..header.length]).map_err(|error| {
        let expected = "a valid header, and XML that describes the scans";
        input.malformed(Location::Byte(0), format!("an error ({error})"), expected, ADVICE)
    })
}

/// Returns what the descriptions in a damaged file say, or what its points say if there are none.
pub(super) fn salvage_document(
    input: &Input,
    header: &Header,
    pages: Pages,
    progress: &dyn Progress,
) -> Result<Document> {
    let note = |line: &str| progress.note(&format!("{}: {line}", input.name));
    if let Some(mut document) = partial_document(input, header, pages) {
        note(&complete_last_scan(&mut document.scans, pages));
        let n_skipped = n_other_sections(&document.scans, pages, progress)?;
        if 0 < n_skipped {
            note(&format!("skipped {} of points or cells", counted(n_skipped, "more list")));
        }
        return Ok(document);
    }
    let Undescribed { scans, skipped } = find_scans(input, pages, progress)?;
    if scans.is_empty() {
        let reason = skipped.first().unwrap_or(&NO_PACKET);
        let found = format!("no description of the scans, and no points without it ({reason})");
        let location = Location::Byte(header.xml_start);
        let expected = "the XML that describes the scans";
        let advice = format!("nothing can be salvaged without it; {ADVICE}");
        return Err(input.malformed(location, found, expected, advice));
    }
    note(&format!(
        "the description of the scans is missing; the first three fields of {} are taken for positions about \
         their scanner, and poses, names, colors and all else are lost",
        counted(scans.len(), "scan")
    ));
    if let Some(reason) = skipped.first() {
        note(&format!(
            "skipped {} of points or cells: {reason}",
            counted(skipped.len(), "more list")
        ));
    }
    Ok(Document { scans, images: Vec::new(), coordinate_system: None, is_described: false })
}

/// Adds the fields that the description of the last scan lacks, and returns a line that says what is missing.
fn complete_last_scan(scans: &mut [PointCloud], pages: Pages) -> String {
    let n_scans = scans.len();
    let Some(last) = scans.last_mut() else { return String::new() };
    let n_missing = add_unknown_fields(last, pages);
    let subject = match n_scans {
        1 => "the first scan",
        _ => &format!("the first {n_scans} scans, the last"),
    };
    let lacks_pose = last.transform.is_none();
    let missing = match (n_missing, lacks_pose) {
        (0, false) => "whole".to_owned(),
        (0, true) => "maybe without its pose".to_owned(),
        (n, false) => format!("without its last fields ({n})"),
        (n, true) => format!("without its last fields ({n}), maybe without its pose"),
    };
    format!("the description ends early; it has {subject} {missing}")
}

/// Reads the descriptions of scans up to the end of the file or the next broken page, if there are any.
fn partial_document(input: &Input, header: &Header, pages: Pages) -> Option<Document> {
    let start = Pages::content_position(header.xml_start);
    let length = header.xml_length.min(pages.whole_length(start)).min(MAX_XML_LENGTH);
    let mut xml = vec![0; length as usize];
    pages.copy(start, &mut xml)?;
    let xml = partial_xml::close(&xml)?;
    let mut content = input[..HEADER_LENGTH].to_vec();
    content[24..32].copy_from_slice(&(HEADER_LENGTH as u64).to_le_bytes());
    content[32..40].copy_from_slice(&(xml.len() as u64).to_le_bytes());
    content.extend(xml.as_bytes());
    parse(&Pages::file_of(&content)).ok().filter(|document| !document.scans.is_empty())
}

fn parse(bytes: &[u8]) -> e57::Result<Document> {
    let reader = E57Reader::new(Cursor::new(bytes))?;
    let coordinate_system =
        reader.coordinate_metadata().map(str::trim).filter(|text| !text.is_empty());
    Ok(Document {
        scans: reader.pointclouds(),
        images: reader.images(),
        coordinate_system: coordinate_system.map(str::to_owned),
        is_described: true,
    })
}

//! The coordinate system that a LAS file names, as WKT or by GeoTIFF keys.

use super::header::{Header, read_u16, text};
use crate::input::Input;

pub(super) const USER_ID: &str = "LASF_Projection";
pub(super) const WKT: u16 = 2112;
pub(super) const GEO_KEYS: u16 = 34735;
const GEO_TEXTS: u16 = 34737;

/// GeoTIFF 1.1, section 7.4: the keys that hold EPSG codes, and the one of the citation.
pub(super) const PROJECTED: u16 = 3072;
pub(super) const GEODETIC: u16 = 2048;
const VERTICAL: u16 = 4096;
const CITATIONS: [u16; 3] = [3073, 1026, 2049];
const USER_DEFINED: u16 = 32767;

/// WKT if the file has it, else "EPSG:" and a code, else the file's own words.
pub(super) fn coordinate_system(input: &Input, header: &Header) -> Option<String> {
    let wkt = header.record(input, USER_ID, WKT).map(text).filter(|wkt| !wkt.is_empty());
    wkt.or_else(|| of_geo_keys(input, header))
}

fn of_geo_keys(input: &Input, header: &Header) -> Option<String> {
    let keys = header.record(input, USER_ID, GEO_KEYS)?;
    // The first entry is the directory's own header.
    let entries = || keys.chunks_exact(8).skip(1);
    let find = |key: u16| entries().find(|entry| read_u16(entry, 0) == key);
    let code = |key: u16| {
        let value = read_u16(find(key)?, 6);
        (value != 0 && value != USER_DEFINED).then_some(value)
    };
    if let Some(horizontal) = code(PROJECTED).or_else(|| code(GEODETIC)) {
        return Some(match code(VERTICAL) {
            Some(vertical) => format!("EPSG:{horizontal}+{vertical}"),
            None => format!("EPSG:{horizontal}"),
        });
    }
    let texts = header.record(input, USER_ID, GEO_TEXTS)?;
    let citation = CITATIONS.into_iter().find_map(find)?;
    let (length, start) = (read_u16(citation, 4).into(), read_u16(citation, 6).into());
    let words = text(texts.get(start..)?.get(..length)?);
    let words = words.trim_end_matches('|');
    (!words.is_empty()).then(|| words.to_owned())
}

//! Reads the coordinate system that a LAS file names, as WKT or by GeoTIFF keys.

use super::header::{Header, read_u16, text};
use crate::file::Input;

/// User id of the records of coordinate systems.
pub(super) const USER_ID: &str = "LASF_Projection";
/// Id of the record of WKT.
pub(super) const WKT: u16 = 2112;
/// Id of the record of the GeoTIFF key directory.
pub(super) const GEO_KEYS: u16 = 34735;
/// Id of the record of GeoTIFF texts.
const GEO_TEXTS: u16 = 34737;

/// Key of the EPSG code of a projected system (GeoTIFF 1.1, section 7.4, as are the following).
pub(super) const PROJECTED: u16 = 3072;
/// Key of the EPSG code of a geodetic system.
pub(super) const GEODETIC: u16 = 2048;
/// Key of the EPSG code of a vertical system.
const VERTICAL: u16 = 4096;
/// Keys of names in words.
const CITATIONS: [u16; 3] = [3073, 1026, 2049];
/// Code of a system without EPSG code.
const USER_DEFINED: u16 = 32767;

/// Returns the coordinate system as WKT if the file has it, else as "EPSG:" and a code, else in the words of the file.
pub(super) fn coordinate_system(input: &Input, header: &Header) -> Option<String> {
    let wkt = header.record(input, USER_ID, WKT).map(text).filter(|wkt| !wkt.is_empty());
    wkt.or_else(|| from_geo_keys(input, header))
}

/// Returns the coordinate system of the GeoTIFF keys.
fn from_geo_keys(input: &Input, header: &Header) -> Option<String> {
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

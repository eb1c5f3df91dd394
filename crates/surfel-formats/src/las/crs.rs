//! The coordinate system that a LAS file names, as WKT or by GeoTIFF keys: read and written.

use super::header::{Header, read_u16, text};
use crate::file::Input;
use crate::options::SaveOptions;

/// User id of the records of coordinate systems.
pub(super) const USER_ID: &str = "LASF_Projection";
/// Maximum bytes of the data of a record.
pub(super) const MAX_RECORD_SIZE: usize = 65535;
/// Id of the record of WKT.
pub(super) const WKT: u16 = 2112;
/// Id of the record of the GeoTIFF key directory.
pub(super) const GEO_KEYS: u16 = 34735;
/// Id of the record of GeoTIFF texts.
const GEO_TEXTS: u16 = 34737;

/// Key of the EPSG code of a projected system (GeoTIFF 1.1, section 7.4, as are the following).
const PROJECTED: u16 = 3072;
/// Key of the EPSG code of a geodetic system.
const GEODETIC: u16 = 2048;
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

/// Returns the records of the coordinate system by their ids: those of the source, or one made from the text of the
/// options, which is WKT or "EPSG:" and the code of a horizontal system. A vertical code after `+` is ignored.
pub(super) fn projection_records(options: &SaveOptions) -> Vec<(u16, Vec<u8>)> {
    let of_source = options.las.as_ref().map(|las| las.projection.clone());
    if let Some(records) = of_source.filter(|records| !records.is_empty()) {
        return records;
    }
    let Some(text) = &options.coordinate_system else { return Vec::new() };
    if let Some(codes) = text.strip_prefix("EPSG:") {
        let code = codes.split('+').next().and_then(|code| code.parse().ok());
        return code.map(|code| (GEO_KEYS, geo_keys(code))).into_iter().collect();
    }
    // The last byte of a record is zero.
    let is_wkt = text.contains('[') && text.len() < MAX_RECORD_SIZE;
    let wkt = is_wkt.then(|| (WKT, [text.as_bytes(), &[0]].concat()));
    wkt.into_iter().collect()
}

/// Returns a GeoTIFF key directory that names the coordinate system.
fn geo_keys(code: u16) -> Vec<u8> {
    // EPSG codes from 4000 to 4999 are geodetic systems, all others projected ones.
    let is_geodetic = (4000..5000).contains(&code);
    let key = if is_geodetic { GEODETIC } else { PROJECTED };
    let model_type = if is_geodetic { 2 } else { 1 };
    let entries = [[1, 1, 0, 2], [1024, 0, 1, model_type], [key, 0, 1, code]];
    entries.as_flattened().iter().flat_map(|v: &u16| v.to_le_bytes()).collect()
}

//! The coordinate system that a LAS file names, as WKT or by GeoTIFF keys: read and written.

use super::header::{Header, read_u16, text};
use super::point_format::PointFields;
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

/// Key of the kind of system (GeoTIFF 1.1, section 7.4, as are the following).
const MODEL_TYPE: u16 = 1024;
/// Model types.
const MODEL_PROJECTED: u16 = 1;
const MODEL_GEOGRAPHIC: u16 = 2;
const MODEL_GEOCENTRIC: u16 = 3;
/// Key of the EPSG code of a projected system.
const PROJECTED: u16 = 3072;
/// Key of the EPSG code of a geodetic system.
const GEODETIC: u16 = 2048;
/// Key of the EPSG code of a vertical system.
const VERTICAL: u16 = 4096;
/// Keys of names in words: of a projected system, of the whole, of a geodetic system.
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
    let value = |key: u16| find(key).map(|entry| read_u16(entry, 6)).filter(|value| *value != 0);
    let code = |key: u16| value(key).filter(|value| *value != USER_DEFINED);
    let is_projected = match value(MODEL_TYPE) {
        Some(model_type @ (MODEL_PROJECTED | MODEL_GEOGRAPHIC)) => model_type == MODEL_PROJECTED,
        _ => value(PROJECTED).is_some(),
    };
    // The geodetic system below a projected one is not that of the coordinates.
    let geodetic = code(GEODETIC).filter(|_| !is_projected);
    if let Some(horizontal) = code(PROJECTED).or(geodetic) {
        return Some(match code(VERTICAL) {
            Some(vertical) => format!("EPSG:{horizontal}+{vertical}"),
            None => format!("EPSG:{horizontal}"),
        });
    }
    let texts = header.record(input, USER_ID, GEO_TEXTS)?;
    let citations = &CITATIONS[..if is_projected { 2 } else { 3 }];
    let citation = citations.iter().find_map(|key| find(*key))?;
    let (length, start) = (read_u16(citation, 4).into(), read_u16(citation, 6).into());
    let words = text(texts.get(start..)?.get(..length)?);
    let words = words.trim_end_matches('|');
    (!words.is_empty()).then(|| words.to_owned())
}

/// Returns the records of the coordinate system by their ids: those of the source, or one made from the text of the
/// options, which is WKT or "EPSG:" and the code of a horizontal system. A vertical code after `+` is ignored.
///
/// The point formats from 6 on require WKT (LAS 1.4, section 2.4). A source that has only GeoTIFF keys keeps them if its
/// own format is one of these.
pub(super) fn projection_records(options: &SaveOptions, is_extended: bool) -> Vec<(u16, Vec<u8>)> {
    let kept = options.las.as_ref().map_or(Vec::new(), |las| las.projection.clone());
    let is_so_in_source = options
        .las
        .as_ref()
        .is_some_and(|las| PointFields::of_format(las.point_format).is_extended);
    let has_wkt = kept.iter().any(|(record_id, _)| *record_id == WKT);
    if !kept.is_empty() && (has_wkt || !is_extended || is_so_in_source) {
        return kept;
    }
    let record = options.coordinate_system.as_ref().and_then(|text| record(text, is_extended));
    record.map_or(kept, |record| vec![record])
}

/// Returns a record that describes a coordinate system.
fn record(text: &str, is_extended: bool) -> Option<(u16, Vec<u8>)> {
    let wkt_record = |wkt: &str| {
        // The last byte of a record is zero.
        let is_wkt = wkt.contains('[') && wkt.len() < MAX_RECORD_SIZE;
        is_wkt.then(|| (WKT, [wkt.as_bytes(), &[0]].concat()))
    };
    let Some(codes) = text.strip_prefix("EPSG:") else { return wkt_record(text) };
    let code = codes.split('+').next()?.parse().ok()?;
    let known = crs_definitions::from_code(code).filter(|_| is_extended);
    known.and_then(|system| wkt_record(system.wkt)).or_else(|| Some((GEO_KEYS, geo_keys(code))))
}

/// Returns a GeoTIFF key directory that names the coordinate system.
fn geo_keys(code: u16) -> Vec<u8> {
    let definition = crs_definitions::from_code(code).map(|system| system.proj4);
    let model_type = match definition {
        Some(definition) if definition.contains("+proj=longlat") => MODEL_GEOGRAPHIC,
        Some(definition) if definition.contains("+proj=geocent") => MODEL_GEOCENTRIC,
        Some(_) => MODEL_PROJECTED,
        // Most EPSG codes from 4000 to 4999 are geodetic systems.
        None if (4000..5000).contains(&code) => MODEL_GEOGRAPHIC,
        None => MODEL_PROJECTED,
    };
    let key = if model_type == MODEL_PROJECTED { PROJECTED } else { GEODETIC };
    let entries = [[1, 1, 0, 2], [MODEL_TYPE, 0, 1, model_type], [key, 0, 1, code]];
    entries.as_flattened().iter().flat_map(|v: &u16| v.to_le_bytes()).collect()
}

#[cfg(test)]
mod tests {
    //! GeoTIFF keys.

    use super::*;

    #[test]
    fn the_definition_of_a_code_decides_if_it_is_geodetic() {
        let (projected, geographic) = ((MODEL_PROJECTED, PROJECTED), (MODEL_GEOGRAPHIC, GEODETIC));
        for (code, expected) in [
            (2154, projected),
            (4647, projected),
            (4500, projected),
            (1, projected),
            (4326, geographic),
            (7844, geographic),
            (6318, geographic),
            (4978, (MODEL_GEOCENTRIC, GEODETIC)),
        ] {
            let keys = geo_keys(code);
            let entry = |i: usize, n: usize| read_u16(&keys[8 * i..], 2 * n);
            assert_eq!((entry(1, 3), entry(2, 0)), expected, "{code}");
            assert_eq!((entry(1, 0), entry(2, 3)), (MODEL_TYPE, code), "{code}");
        }
    }
}

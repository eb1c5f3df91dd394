//! The area whose points are kept: bounds, polygons as text, or those of a file.

use super::Invalid;
use super::clip_rule::{ANY, ClipBoxRule, box_of, ranges};
use super::rule::{Rule, absolute_text, as_numbers};
use geojson::{GeoJson, Geometry, GeometryValue};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use surfel_core::points::{PointFilter, rings_cross};
use surfel_core::scene::ClipBox;
use wkt::Wkt;

/// Greatest size of a file of polygons.
const MAX_BYTES: usize = 64 << 20;

/// The area whose points are kept, in the coordinates of the points' files.
#[derive(Clone, Debug, PartialEq)]
pub enum Crop {
    /// Bounds, which may be infinite.
    Bounds(ClipBox),
    /// A polygon or several, as well-known text.
    Wkt(String),
    /// A file of polygons, as GeoJSON or well-known text. It is read with the points.
    File(PathBuf),
}

/// A polygon: its outline and its holes, as rings of corners.
type Rings = Vec<Vec<[f64; 2]>>;

impl Crop {
    /// Returns the filter that keeps the points in the area.
    ///
    /// # Errors
    ///
    /// Fails for a file that cannot be read or has no polygons, and for polygons with broken rings.
    pub fn filter(&self) -> Result<PointFilter, Invalid> {
        if let Self::Bounds(bounds) = self {
            let (low, high) = (bounds.min.to_array(), bounds.max.to_array());
            return Ok(PointFilter::within_box(low, high));
        }
        let filter = PointFilter::within_polygons(&self.polygons()?);
        filter.map_err(|error| self.invalid(error.to_string()))
    }

    /// Returns true if rings of a polygon cross, which makes holes of areas inside of an even number of them.
    ///
    /// # Errors
    ///
    /// Fails for a file that cannot be read or has no polygons.
    pub fn crosses(&self) -> Result<bool, Invalid> {
        Ok(self.polygons()?.iter().any(|rings| rings_cross(rings)))
    }

    /// Returns the least and the greatest X and Y of the area.
    ///
    /// # Errors
    ///
    /// Fails for a file that cannot be read or has no polygons.
    pub fn xy_bounds(&self) -> Result<[[f64; 2]; 2], Invalid> {
        if let Self::Bounds(ClipBox { min, max }) = self {
            return Ok([[min.x, max.x], [min.y, max.y]]);
        }
        let polygons = self.polygons()?;
        let corners = || polygons.iter().flatten().flatten();
        Ok([0, 1].map(|axis| {
            corners().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], corner| {
                [low.min(corner[axis]), high.max(corner[axis])]
            })
        }))
    }

    /// Returns the polygons; none if the area is given by bounds.
    fn polygons(&self) -> Result<Vec<Rings>, Invalid> {
        let polygons = match self {
            Self::Bounds(_) => Ok(Vec::new()),
            Self::Wkt(text) => polygons_of_wkt(text),
            Self::File(path) => {
                let text = surfel_formats::load_text(path, MAX_BYTES)
                    .map_err(|error| Invalid::at("crop", error.to_string()))?;
                if is_wkt(&text) { polygons_of_wkt(&text) } else { polygons_of_geojson(&text) }
            }
        };
        polygons.map_err(|message| self.invalid(message))
    }

    /// Returns an error of the polygons, which names their file.
    fn invalid(&self, message: String) -> Invalid {
        let file = if let Self::File(path) = self { Some(path.clone()) } else { None };
        Invalid { file, ..Invalid::at("crop", message) }
    }
}

/// Returns true if text looks like polygons in well-known text.
fn is_wkt(text: &str) -> bool {
    let text = text.trim_start();
    let starts_with =
        |name: &str| text.get(..name.len()).is_some_and(|t| t.eq_ignore_ascii_case(name));
    starts_with("polygon") || starts_with("multipolygon")
}

fn polygons_of_wkt(text: &str) -> Result<Vec<Rings>, String> {
    let rings = |polygon: &wkt::types::Polygon<f64>| -> Rings {
        let corners = |ring: &wkt::types::LineString<f64>| {
            ring.coords().iter().map(|corner| [corner.x, corner.y]).collect()
        };
        polygon.rings().iter().map(corners).collect()
    };
    match text.trim().parse::<Wkt<f64>>() {
        Ok(Wkt::Polygon(polygon)) => Ok(vec![rings(&polygon)]),
        Ok(Wkt::MultiPolygon(several)) => Ok(several.polygons().iter().map(rings).collect()),
        Ok(_) => Err("expected POLYGON or MULTIPOLYGON".to_owned()),
        Err(error) => Err(match broken_coordinate(text) {
            Some(word) => format!("expected numbers as coordinates, not `{word}`"),
            None => format!("expected a polygon as well-known text: {error}"),
        }),
    }
}

/// Returns the first word of well-known text in the place of a coordinate that is no finite number.
fn broken_coordinate(text: &str) -> Option<&str> {
    let (_, rings) = text.split_once('(')?;
    let mut words = rings.split(|c: char| c.is_whitespace() || matches!(c, '(' | ')' | ','));
    words.find(|word| !word.is_empty() && !word.parse::<f64>().is_ok_and(f64::is_finite))
}

fn polygons_of_geojson(text: &str) -> Result<Vec<Rings>, String> {
    let json = text
        .parse::<GeoJson>()
        .map_err(|error| format!("expected polygons as GeoJSON or well-known text: {error}"))?;
    let geometries: Vec<Geometry> = match json {
        GeoJson::Geometry(geometry) => vec![geometry],
        GeoJson::Feature(feature) => feature.geometry.into_iter().collect(),
        GeoJson::FeatureCollection(features) => {
            features.into_iter().filter_map(|f| f.geometry).collect()
        }
    };
    let mut polygons = Vec::new();
    geometries.iter().for_each(|geometry| collect_polygons(geometry, &mut polygons));
    if polygons.is_empty() { Err("has no polygon".to_owned()) } else { Ok(polygons) }
}

/// Appends the polygons of a geometry; points and lines have no area.
fn collect_polygons(geometry: &Geometry, polygons: &mut Vec<Rings>) {
    let rings = |polygon: &geojson::PolygonType| -> Rings {
        let corner = |position: &geojson::Position| match position.as_slice() {
            [x, y, ..] => [*x, *y],
            _ => [f64::NAN; 2],
        };
        polygon.iter().map(|ring| ring.iter().map(corner).collect()).collect()
    };
    match &geometry.value {
        GeometryValue::Polygon { coordinates } => polygons.push(rings(coordinates)),
        GeometryValue::MultiPolygon { coordinates } => {
            polygons.extend(coordinates.iter().map(rings))
        }
        GeometryValue::GeometryCollection { geometries } => {
            geometries.iter().for_each(|geometry| collect_polygons(geometry, polygons));
        }
        _ => {}
    }
}

/// Bounds as those of a clip box or as four numbers, polygons as well-known text, or the name of a file.
pub struct CropRule;

impl Rule<Crop> for CropRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<Crop, Invalid> {
        let wrong = || {
            Invalid::new(
                "expected bounds as ([0,10],[0,10]) or 0,0,10,10, a POLYGON as well-known text, or the name of a \
                 file of polygons",
            )
        };
        if let Some(&[x0, y0, x1, y1]) = as_numbers(value).as_deref() {
            return box_of([[x0, x1], [y0, y1], ANY]).map(Crop::Bounds);
        }
        let text = value.as_str().map_or("", str::trim);
        if as_numbers(value).is_some() || text.starts_with('(') {
            return box_of(ranges(value).ok_or_else(wrong)?).map(Crop::Bounds);
        }
        match text {
            "" => Err(wrong()),
            text if is_wkt(text) => {
                let crop = Crop::Wkt(text.to_owned());
                crop.filter().map_err(|invalid| Invalid::new(invalid.message))?;
                Ok(crop)
            }
            name => Ok(Crop::File(folder.join(name))),
        }
    }

    fn write(&self, value: &Crop) -> Value {
        match value {
            Crop::Bounds(bounds) => ClipBoxRule.write(bounds),
            Crop::Wkt(text) => json!(text),
            Crop::File(path) => json!(absolute_text(path)),
        }
    }

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    //! Areas are read as people write them, and broken ones are refused.

    use super::*;

    fn read(value: Value) -> Result<Crop, String> {
        CropRule.read(&value, Path::new("/folder")).map_err(|error| error.message)
    }

    #[test]
    fn areas_read_back_as_written() {
        for value in [
            json!("0,0,10,5.5"),
            json!([0, 0, 10, 5]),
            json!([0, 0, -1, 10, 5, 2]),
            json!("([0,10],[0,5])"),
            json!("POLYGON ((0 0, 4 0, 4 3, 0 0))"),
            json!("/areas/site.geojson"),
        ] {
            let crop = read(value.clone()).unwrap();
            assert_eq!(read(CropRule.write(&crop)), Ok(crop), "{value}");
        }
        assert_eq!(read(json!("site.wkt")), Ok(Crop::File("/folder/site.wkt".into())));
    }

    #[test]
    fn broken_areas_are_refused_with_the_reason() {
        for value in [json!(""), json!([1, 2, 3]), json!("([0,1)"), json!(true)] {
            assert!(read(value.clone()).unwrap_err().contains("expected bounds"), "{value}");
        }
        for value in ["5,0,1,1", "([5,1],[0,1])", "0,5,0,0,1,0"] {
            let error = read(json!(value)).unwrap_err();
            assert_eq!(error, "expected the lower end of a range first, as in [1,5]", "{value}");
        }
        let refused = |text: &str| read(json!(text)).unwrap_err();
        assert!(refused("POLYGON ((0 0, 1 1, 0 0))").contains("a ring of 2 corners"));
        let not_finite = "expected numbers as coordinates, not `nan`";
        assert_eq!(refused("POLYGON ((0 0, nan 1, 2 2, 0 0))"), not_finite);
        assert!(refused("POLYGON ((0 0, 1 1, 2 2, 0 0)").contains("well-known text"));
        assert!(refused("POLYGON EMPTY").contains("no ring"));
        assert!(refused("POLYGON ((0 0, 1").contains("well-known text"));
    }

    #[test]
    fn geojson_gives_all_its_polygons() {
        let square = |x: i32| format!("[[[{x},0],[{},0],[{},1],[{x},1],[{x},0]]]", x + 1, x + 1);
        let feature = |kind: &str, coordinates: &str| {
            format!(
                r#"{{"type":"Feature","properties":null,"geometry":{{"type":"{kind}","coordinates":{coordinates}}}}}"#
            )
        };
        let several = format!("[{},{}]", square(2), square(4));
        let features = [
            feature("Polygon", &square(0)),
            feature("MultiPolygon", &several),
            feature("Point", "[9,9]"),
        ];
        let text = format!(r#"{{"type":"FeatureCollection","features":[{}]}}"#, features.join(","));
        assert_eq!(polygons_of_geojson(&text).unwrap().len(), 3);
        assert_eq!(
            polygons_of_geojson(&feature("Point", "[9,9]")),
            Err("has no polygon".to_owned())
        );
        assert!(polygons_of_geojson("{\"type\":").unwrap_err().contains("GeoJSON"));
    }
}

//! Measurements and annotations of the viewer.

use super::Invalid;
use super::rule::{MAX_LENGTH, Rule};
use serde_json::{Map, Value, json};
use std::path::Path;
use surfel_core::flat::BaseHeight;
use surfel_core::math::DVec3;

/// A figure that the viewer measures, or a text at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The kind of the figure.
    pub kind: MeasurementKind,
    /// Name of a measurement, text of an annotation.
    pub name: String,
    /// Points in world coordinates, in the order of the clicks.
    pub points: Vec<DVec3>,
}

/// Kinds of figures, with the settings that some have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeasurementKind {
    /// Distance of two points.
    Distance,
    /// Difference in height of two points.
    Height,
    /// Angle at the second of three points.
    Angle,
    /// Circle through three points.
    Circle,
    /// Length of a line.
    Polyline,
    /// Area of a polygon.
    Area,
    /// Heights of the points in a strip along a line.
    Profile {
        /// Width of the strip.
        width: f64,
    },
    /// Volume above and below a polygon.
    Volume {
        /// Height of the base plane.
        base: BaseHeight,
        /// Size of the cells of the grid; chosen from the points if there is none.
        cell_size: Option<f64>,
    },
    /// A text at a point.
    Annotation,
}

/// Maximum number of figures.
const MAX_FIGURES: usize = 2000;
/// Maximum number of points of a figure.
const MAX_POINTS: usize = 10_000;
/// Maximum number of characters of a name.
const MAX_NAME_LENGTH: usize = 100;

/// Tables `{ kind = "distance", name = "eaves", points = [[0, 0, 5], [8, 0, 5]] }`.
pub struct Measurements;

impl Rule<Vec<Measurement>> for Measurements {
    fn read(&self, value: &Value, _: &Path) -> Result<Vec<Measurement>, Invalid> {
        let tables = value.as_array().filter(|tables| tables.len() <= MAX_FIGURES);
        let tables = tables.ok_or_else(|| {
            let keys = "a kind, a name and points";
            Invalid::new(format!("expected tables with {keys}, {MAX_FIGURES} at most"))
        })?;
        let figures = tables.iter().enumerate();
        figures
            .map(|(i, table)| read(table).map_err(|error| error.within(&format!("[{i}]"))))
            .collect()
    }

    fn write(&self, value: &Vec<Measurement>) -> Value {
        value.iter().map(write).collect()
    }
}

impl MeasurementKind {
    fn name(&self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Height => "height",
            Self::Angle => "angle",
            Self::Circle => "circle",
            Self::Polyline => "polyline",
            Self::Area => "area",
            Self::Profile { .. } => "profile",
            Self::Volume { .. } => "volume",
            Self::Annotation => "annotation",
        }
    }

    /// Returns the least and the greatest number of points.
    fn n_points(&self) -> (usize, usize) {
        match self {
            Self::Distance | Self::Height => (2, 2),
            Self::Angle | Self::Circle => (3, 3),
            Self::Polyline | Self::Profile { .. } => (2, MAX_POINTS),
            Self::Area | Self::Volume { .. } => (3, MAX_POINTS),
            Self::Annotation => (1, 1),
        }
    }
}

/// Takes the kind, and the settings that it has, out of a table.
fn take_kind(table: &mut Map<String, Value>) -> Result<MeasurementKind, Invalid> {
    let name = table.shift_remove("kind").unwrap_or_default();
    Ok(match name.as_str() {
        Some("distance") => MeasurementKind::Distance,
        Some("height") => MeasurementKind::Height,
        Some("angle") => MeasurementKind::Angle,
        Some("circle") => MeasurementKind::Circle,
        Some("polyline") => MeasurementKind::Polyline,
        Some("area") => MeasurementKind::Area,
        Some("profile") => {
            let width = take_length(table, "width")?;
            let missing = || Invalid::at("width", "expected the width of the strip");
            MeasurementKind::Profile { width: width.ok_or_else(missing)? }
        }
        Some("volume") => MeasurementKind::Volume {
            base: take_base(table)?,
            cell_size: take_length(table, "cell_size")?,
        },
        Some("annotation") => MeasurementKind::Annotation,
        _ => {
            let kinds = "distance, height, angle, circle, polyline, area, profile, volume or \
                annotation";
            return Err(Invalid::at("kind", format!("expected {kinds}")).found(&name));
        }
    })
}

fn take_length(table: &mut Map<String, Value>, key: &str) -> Result<Option<f64>, Invalid> {
    let Some(value) = table.shift_remove(key) else { return Ok(None) };
    let length = value.as_f64().filter(|length| 0.0 < *length && *length < MAX_LENGTH);
    let wrong = || Invalid::at(key, "expected a length above 0").found(&value);
    length.map(Some).ok_or_else(wrong)
}

fn take_base(table: &mut Map<String, Value>) -> Result<BaseHeight, Invalid> {
    let value = table.shift_remove("base").unwrap_or(json!("lowest"));
    match (value.as_str(), value.as_f64()) {
        (Some("lowest"), _) => Ok(BaseHeight::Lowest),
        (Some("mean"), _) => Ok(BaseHeight::Mean),
        (_, Some(height)) if height.abs() < MAX_LENGTH => Ok(BaseHeight::At(height)),
        _ => Err(Invalid::at("base", "expected lowest, mean or a height").found(&value)),
    }
}

fn read(value: &Value) -> Result<Measurement, Invalid> {
    let wrong = || {
        let text = "expected a kind, a name and points, as in \
             { kind = \"annotation\", name = \"ridge\", points = [[1, 2, 3]] }";
        Invalid::new(text).found(value)
    };
    let table = value.as_object().ok_or_else(wrong)?;
    let mut table: Map<String, Value> =
        table.iter().map(|(key, value)| (key.replace('-', "_"), value.clone())).collect();
    let kind = take_kind(&mut table)?;
    let (name, points) = (table.shift_remove("name"), table.shift_remove("points"));
    if let Some(key) = table.keys().next() {
        return Err(Invalid::at(key.clone(), format!("is no key of the kind {}", kind.name())));
    }
    let (least, most) = kind.n_points();
    let name = name.as_ref().and_then(Value::as_str);
    let name = name.filter(|name| (1..=MAX_NAME_LENGTH).contains(&name.chars().count()));
    let name = name.ok_or_else(|| {
        Invalid::at("name", format!("expected a text of 1 to {MAX_NAME_LENGTH} characters"))
    })?;
    let points = points.and_then(|points| serde_json::from_value::<Vec<[f64; 3]>>(points).ok());
    let points = points.filter(|points| {
        let are_near = points.iter().flatten().all(|coordinate| coordinate.abs() < MAX_LENGTH);
        are_near && (least..=most).contains(&points.len())
    });
    let points = points.ok_or_else(|| {
        let number = if least == most { least.to_string() } else { format!("{least} or more") };
        Invalid::at("points", format!("expected {number} points of three numbers each"))
    })?;
    let points = points.into_iter().map(DVec3::from_array).collect();
    Ok(Measurement { kind, name: name.to_owned(), points })
}

fn write(figure: &Measurement) -> Value {
    let points: Vec<[f64; 3]> = figure.points.iter().map(DVec3::to_array).collect();
    let mut table = json!({ "kind": figure.kind.name(), "name": figure.name, "points": points });
    match figure.kind {
        MeasurementKind::Profile { width } => table["width"] = json!(width),
        MeasurementKind::Volume { base, cell_size } => {
            table["base"] = match base {
                BaseHeight::Lowest => json!("lowest"),
                BaseHeight::Mean => json!("mean"),
                BaseHeight::At(height) => json!(height),
            };
            if let Some(size) = cell_size {
                table["cell_size"] = json!(size);
            }
        }
        _ => (),
    }
    table
}

#[cfg(test)]
mod tests {
    //! Figures that are read back, and those that are rejected.

    use super::*;

    fn read(value: &Value) -> Result<Vec<Measurement>, Invalid> {
        Measurements.read(value, Path::new(""))
    }

    #[test]
    fn figures_read_back_equal() {
        let [a, b, c] = [[562_337.12, 4_183_203.4, 150.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.5]];
        let figures = json!([
            { "kind": "distance", "name": "distance 1", "points": [a, b] },
            { "kind": "angle", "name": "angle 2", "points": [a, b, c] },
            { "kind": "polyline", "name": "Traufe №1", "points": [a, b, c, a] },
            { "kind": "profile", "name": "profile 3", "points": [a, b], "width": 0.5 },
            { "kind": "volume", "name": "heap", "points": [a, b, c], "base": "mean" },
            { "kind": "volume", "name": "pit", "points": [a, b, c], "base": -3.0, "cell_size": 0.25 },
            { "kind": "annotation", "name": "ridge", "points": [c] },
        ]);
        assert_eq!(Measurements.write(&read(&figures).unwrap()), figures);
        let hyphens =
            json!([{ "kind": "volume", "name": "pit", "points": [a, b, c], "cell-size": 1 }]);
        let expected = MeasurementKind::Volume { base: BaseHeight::Lowest, cell_size: Some(1.0) };
        assert_eq!(read(&hyphens).unwrap()[0].kind, expected);
    }

    #[test]
    fn wrong_figures_are_rejected() {
        let figure = json!({ "kind": "distance", "name": "a", "points": [[0, 0, 0], [1, 0, 0]] });
        assert!(read(&json!([figure])).is_ok());
        assert!(read(&figure).is_err());
        assert!(read(&vec![figure.clone(); MAX_FIGURES + 1].into()).is_err());
        for (key, wrong) in [
            ("kind", json!("length")),
            ("kind", json!(null)),
            ("kind", json!("profile")),
            ("kind", json!("area")),
            ("name", json!("")),
            ("name", json!("a".repeat(MAX_NAME_LENGTH + 1))),
            ("points", json!([[0, 0, 0]])),
            ("points", json!([[0, 0], [1, 0]])),
            ("points", json!([[0, 0, 1e15], [1, 0, 0]])),
            ("width", json!(1)),
        ] {
            let mut changed = figure.clone();
            changed[key] = wrong;
            assert!(read(&json!([changed])).is_err(), "{changed}");
        }
    }
}

//! A scene on Earth: its coordinate system, its place, and the date of its sun.

use super::Invalid;
use super::rule::{Rule, Text, as_numbers, expected};
use crate::crs::{CoordinateSystem, Place};
use chrono::{DateTime, FixedOffset};
use serde_json::{Value, json};
use std::path::Path;

/// A coordinate system that is known.
pub(super) struct CrsRule;

impl Rule<String> for CrsRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<String, Invalid> {
        let mut text = Text.read(value, folder)?;
        if text.trim().parse::<u32>().is_ok() {
            text = format!("EPSG:{}", text.trim());
        }
        match CoordinateSystem::parse(&text) {
            Some(_) => Ok(text),
            None => Err(expected(
                "the EPSG code of a known system on Earth as in EPSG:25832 or 25832, or its WKT",
            )),
        }
    }

    fn write(&self, value: &String) -> Value {
        json!(value)
    }
}

/// Latitude and longitude in degrees.
pub(super) struct PlaceRule;

impl Rule<Place> for PlaceRule {
    fn read(&self, value: &Value, _: &Path) -> Result<Place, Invalid> {
        match as_numbers(value).as_deref() {
            Some(&[latitude_deg, longitude_deg])
                if latitude_deg.abs() <= 90.0 && longitude_deg.abs() <= 180.0 =>
            {
                Ok(Place { latitude_deg, longitude_deg })
            }
            _ => Err(expected("degrees of latitude and longitude as in 48.14,11.58")),
        }
    }

    fn write(&self, value: &Place) -> Value {
        json!([value.latitude_deg, value.longitude_deg])
    }

    fn may_begin_with_hyphen(&self) -> bool {
        true
    }
}

/// A date and time with the offset of its time zone.
pub(super) struct DateRule;

/// Forms of a date and time: with seconds or without, with `T` or a space.
const DATE_FORMS: [&str; 4] = [
    "%Y-%m-%dT%H:%M:%S%.f%:z",
    "%Y-%m-%dT%H:%M%:z",
    "%Y-%m-%d %H:%M:%S%.f%:z",
    "%Y-%m-%d %H:%M%:z",
];

impl Rule<DateTime<FixedOffset>> for DateRule {
    fn read(&self, value: &Value, folder: &Path) -> Result<DateTime<FixedOffset>, Invalid> {
        let text = Text.read(value, folder)?;
        let text = text.trim();
        let zoned = match text.strip_suffix(['Z', 'z']) {
            Some(universal) => format!("{universal}+00:00"),
            None => text.to_owned(),
        };
        let dates = DATE_FORMS.iter().map(|form| DateTime::parse_from_str(&zoned, form));
        dates.flatten().next().ok_or_else(|| {
            expected("a date, a time and its offset from UTC, as in 2026-06-21T15:00+02:00")
        })
    }

    fn write(&self, value: &DateTime<FixedOffset>) -> Value {
        json!(value.to_rfc3339())
    }
}

#[cfg(test)]
mod tests {
    //! Dates and places as people write them.

    use super::*;

    #[test]
    fn dates_name_an_instant() {
        let read = |text: &str| {
            let date = DateRule.read(&json!(text), Path::new("")).ok()?;
            assert_eq!(DateRule.read(&DateRule.write(&date), Path::new("")), Ok(date));
            Some(date.timestamp())
        };
        let instant = read("2026-06-21T15:00+02:00");
        assert_eq!(instant, Some(1_782_046_800));
        for same in ["2026-06-21T13:00Z", "2026-06-21 15:00:00+02:00", "2026-06-21T13:00:00.0z"] {
            assert_eq!(read(same), instant, "{same}");
        }
        for wrong in ["", "2026-06-21", "2026-06-21T15:00", "2026-13-01T00:00Z", "noon", "ZZ", "é"]
        {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_coordinate_system_is_named_by_its_code_with_or_without_epsg() {
        let read = |text: &str| CrsRule.read(&json!(text), Path::new(""));
        assert_eq!(read("25832"), read("EPSG:25832"));
        assert_eq!(read("25832").unwrap(), "EPSG:25832");
        let error = read("EPSG:99999").unwrap_err();
        assert!(error.message.contains("the EPSG code of a known system"), "{error}");
    }

    #[test]
    fn places_lie_on_earth() {
        let read = |text: &str| PlaceRule.read(&json!(text), Path::new("")).ok();
        let munich = Place { latitude_deg: 48.14, longitude_deg: 11.58 };
        assert_eq!(read("48.14,11.58"), Some(munich));
        for wrong in ["91,0", "0,181", "1", "1,2,3", "NaN,0"] {
            assert_eq!(read(wrong), None, "{wrong}");
        }
    }
}

//! Settings that choose points by their columns, and the filter that they make together.

use super::Invalid;
use super::rule::{Rule, as_list, expected};
use super::spelling::nearest_if_any;
use serde_json::{Value, json};
use std::path::Path;
use surfel_core::image::{class_name, class_named};
use surfel_core::points::PointFilter;

/// The returns of a laser pulse that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Returns {
    /// The first return of each pulse.
    First,
    /// The last return of each pulse: of vegetation, what is below it.
    Last,
    /// Returns of pulses that have no other: of solid surfaces.
    Only,
}

/// Names of the returns.
pub const RETURNS: &[(&str, Returns)] =
    &[("first", Returns::First), ("last", Returns::Last), ("only", Returns::Only)];

/// Numbers or names of ASPRS classes, as a list or separated by commas.
pub struct Classes;

impl Rule<Vec<u8>> for Classes {
    fn read(&self, value: &Value, _: &Path) -> Result<Vec<u8>, Invalid> {
        let class = |item: &Value| {
            let text = match item {
                Value::String(text) => text.trim().to_lowercase(),
                other => other.to_string(),
            };
            text.parse().ok().or_else(|| class_named(&text)).ok_or(text)
        };
        let invalid = |unknown: &str| {
            let advice = nearest_if_any(unknown, (0..=u8::MAX).map(class_name));
            expected(format_args!(
                "numbers or names of ASPRS classes, as in 2,6 or ground,building{advice}"
            ))
        };
        let classes: Result<Vec<u8>, String> = as_list(value).iter().map(class).collect();
        let classes = classes.map_err(|unknown| invalid(&unknown))?;
        if classes.is_empty() { Err(invalid("")) } else { Ok(classes) }
    }

    fn write(&self, value: &Vec<u8>) -> Value {
        json!(value)
    }
}

/// Returns the filters that the settings make, each with the key of its setting.
pub fn point_filters(
    filter: Option<&PointFilter>,
    classes: Option<&[u8]>,
    returns: Option<Returns>,
    area: Option<PointFilter>,
) -> Vec<(&'static str, PointFilter)> {
    let classes = classes.map(PointFilter::classes);
    let returns = returns.map(|returns| {
        let condition = match returns {
            Returns::First => "return_number == 1",
            Returns::Last => "return_number == number_of_returns",
            Returns::Only => "number_of_returns == 1",
        };
        condition.parse().expect("the condition is valid")
    });
    let filters =
        [("filter", filter.cloned()), ("class", classes), ("returns", returns), ("crop", area)];
    filters.into_iter().filter_map(|(key, filter)| Some((key, filter?))).collect()
}

#[cfg(test)]
mod tests {
    //! Names of classes.

    use super::*;

    #[test]
    fn classes_have_the_names_that_filters_know() {
        let read = |value: Value| Classes.read(&value, Path::new(""));
        assert_eq!(read(json!("ground, Low_Vegetation,6")).unwrap(), [2, 3, 6]);
        assert_eq!(read(json!([7, "building"])).unwrap(), [7, 6]);
        // Many classes are reserved.
        for unknown in ["reserved", "soil", ""] {
            assert!(read(json!(unknown)).is_err(), "{unknown}");
        }
    }
}

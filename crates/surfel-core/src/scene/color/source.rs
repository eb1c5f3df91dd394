//! Sources of point colours, their names and their colours in hexadecimal.

use crate::error::{Error, Result};
use crate::points::{PointCloud, Values, is_label};
use std::fmt;
use std::str::FromStr;

/// Name of a column of labels that [`ColorSource::Class`] shows where there is no classification.
pub(super) const CLASS: &str = "class";

/// The column or value that the colours of points show.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// The colours of the file.
    Rgb,
    /// Intensity, mapped to colours.
    Intensity,
    /// Height along [`Coloring::up`](super::Coloring::up), mapped to colours.
    Elevation,
    /// Classification, in the usual colours of the classes; without one a column of labels named `class`.
    Class,
    /// Direction of the normal as (n + 1) / 2.
    Normal,
    /// Distance from each hit to the nearest point, mapped to colours. A point itself has the first colour.
    Support,
    /// One sRGB-encoded colour.
    Constant([u8; 3]),
    /// Another column, by its name, mapped to colours.
    Column(String),
}

impl ColorSource {
    /// The sources that have a name of their own.
    pub const NAMED: [Self; 6] =
        [Self::Rgb, Self::Intensity, Self::Elevation, Self::Class, Self::Normal, Self::Support];

    /// Returns the name of the source, unless it is a colour or a column.
    pub fn name(&self) -> Option<&'static str> {
        match self {
            Self::Rgb => Some("rgb"),
            Self::Intensity => Some("intensity"),
            Self::Elevation => Some("elevation"),
            Self::Class => Some(CLASS),
            Self::Normal => Some("normal"),
            Self::Support => Some("support"),
            Self::Constant(_) | Self::Column(_) => None,
        }
    }

    /// Returns the names of those sources that `accepts` is true for.
    pub fn names_where(accepts: impl Fn(&Self) -> bool) -> Vec<&'static str> {
        Self::NAMED.iter().filter(|source| accepts(source)).filter_map(Self::name).collect()
    }

    /// True if surfel computes the values, so that files need no column for them.
    pub fn is_computed(&self) -> bool {
        matches!(self, Self::Elevation | Self::Normal | Self::Support)
    }

    /// True if a colour map turns the values of the source into colours.
    pub fn is_mapped(&self) -> bool {
        !matches!(self, Self::Rgb | Self::Class | Self::Normal | Self::Constant(_))
    }

    /// True if the values of the source are names of things rather than amounts, so that no value lies between two
    /// others: classes, labels and whole numbers.
    pub fn is_categorical(&self, cloud: &PointCloud) -> bool {
        match self {
            Self::Class => true,
            Self::Column(name) => {
                let values = cloud.scalar(name);
                let is_whole =
                    matches!(values, Some(Values::U8(_) | Values::U16(_) | Values::I32(_)));
                is_whole || is_label(name)
            }
            _ => false,
        }
    }

    /// True if `cloud` has the column that the source needs.
    pub fn is_available_in(&self, cloud: &PointCloud) -> bool {
        match self {
            Self::Rgb => cloud.colors.is_some(),
            Self::Intensity => cloud.intensity.is_some(),
            Self::Class => cloud.classification.is_some() || cloud.scalar(CLASS).is_some(),
            Self::Normal => cloud.normals.is_some(),
            Self::Elevation | Self::Support | Self::Constant(_) => true,
            Self::Column(name) => cloud.scalar(name).is_some(),
        }
    }

    /// Returns the error for a cloud without the column that the source needs.
    pub(super) fn missing_from(&self, cloud: &PointCloud) -> Error {
        let needs_column = |source: &Self| !source.is_available_in(&PointCloud::default());
        let mut known = Self::names_where(|source| !needs_column(source));
        known.push("#RRGGBB");
        known.extend(Self::names_where(|source| {
            needs_column(source) && source.is_available_in(cloud)
        }));
        known.extend(cloud.scalars.iter().map(|scalar| scalar.name.as_str()));
        let kind = "column of this cloud";
        Error::UnknownName { kind, found: self.to_string(), known: known.join(", ") }
    }
}

impl fmt::Display for ColorSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
            Self::Column(name) => f.write_str(name),
            named => f.write_str(named.name().unwrap_or_default()),
        }
    }
}

impl FromStr for ColorSource {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let invalid = || Error::Setting {
            name: "color",
            found: text.to_owned(),
            expected: "rgb, intensity, elevation, class, normal, support, #RRGGBB or the name of a column",
        };
        let plain = text.trim().to_lowercase();
        match &*plain {
            "" => Err(invalid()),
            "z" => Ok(Self::Elevation),
            "classification" => Ok(Self::Class),
            "normals" => Ok(Self::Normal),
            color if color.starts_with('#') => {
                parse_hex(color).map(Self::Constant).ok_or_else(invalid)
            }
            name => {
                let named = Self::NAMED.into_iter().find(|source| source.name() == Some(name));
                Ok(named.unwrap_or_else(|| Self::Column(text.trim().to_owned())))
            }
        }
    }
}

/// Parses `#RRGGBB` or `#RGB`; `None` if `text` is neither.
pub fn parse_hex(text: &str) -> Option<[u8; 3]> {
    let digits: Vec<u8> = text
        .strip_prefix('#')?
        .chars()
        .map(|digit| digit.to_digit(16).map(|digit| digit as u8))
        .collect::<Option<_>>()?;
    match digits[..] {
        [r, g, b] => Some([17 * r, 17 * g, 17 * b]),
        [r1, r0, g1, g0, b1, b0] => Some([16 * r1 + r0, 16 * g1 + g0, 16 * b1 + b0]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    //! Sources are parsed from their names and displayed by them.

    use super::*;

    #[test]
    fn sources_are_parsed_and_displayed_by_name() {
        for source in ColorSource::NAMED {
            assert_eq!(source.to_string().parse::<ColorSource>().unwrap(), source);
        }
        for text in ["rgb", "support", "#0a141e", "gps_time"] {
            assert_eq!(text.parse::<ColorSource>().unwrap().to_string(), text);
        }
        for (text, source) in [
            ("Intensity", ColorSource::Intensity),
            ("RGB", ColorSource::Rgb),
            ("Z", ColorSource::Elevation),
        ] {
            assert_eq!(text.parse::<ColorSource>().unwrap(), source);
        }
        assert_eq!("Amplitude".parse::<ColorSource>().unwrap().to_string(), "Amplitude");
        assert_eq!("#fff".parse::<ColorSource>().unwrap(), ColorSource::Constant([255; 3]));
        for text in ["", "#12345", "#ggg", "#éé"] {
            assert!(text.parse::<ColorSource>().is_err());
        }
    }

    #[test]
    fn errors_list_all_names() {
        let names = ColorSource::names_where(|_| true).join(", ");
        let error = "".parse::<ColorSource>().unwrap_err().to_string();
        assert!(error.contains(&format!("{names}, #RRGGBB")), "{error}");
    }
}

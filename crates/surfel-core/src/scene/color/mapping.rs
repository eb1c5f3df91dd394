//! The mapping from values of points to colours.

use super::coloring::Coloring;
use super::gamma::Gamma;
use super::labels::labels;
use super::source::ColorSource;
use super::support::DEFAULT_RANGE;
use crate::error::Result;
use crate::image::{Colormap, PercentileRange, is_data};
use crate::points::{PointCloud, STRUCTURE};

/// Range of the gray map that intensity uses if no map is named: shading is invisible on black.
const INTENSITY_GRAY_RANGE: (f32, f32) = (0.3, 0.95);

/// A mapping from the values of a cloud's points to colours.
pub(super) struct Mapping<'c> {
    /// Returns the value of a point.
    pub value_at: Box<dyn Fn(usize) -> f64 + Sync + 'c>,
    /// Values of the first and last colour.
    pub range: PercentileRange,
    map: Colormap,
    /// Positions of the first and last colour in the map, from 0 to 1.
    map_range: (f32, f32),
    gamma: Gamma,
    /// The origin of a range that is not given, for a note to the user.
    range_origin: Option<&'static str>,
}

impl<'c> Mapping<'c> {
    /// Makes the mapping for a source that has values.
    ///
    /// # Errors
    ///
    /// Fails if `cloud` lacks the source's column.
    pub fn new(cloud: &'c PointCloud, coloring: &Coloring, source: &ColorSource) -> Result<Self> {
        let value_at = source.values(cloud, coloring).ok_or_else(|| source.missing_from(cloud))?;
        let given = coloring.range.map(|(low, high)| PercentileRange { low, high });
        let (range, range_origin) = match given {
            Some(given) => (given, None),
            None => {
                let (range, origin) = source.automatic_range(cloud.len(), &value_at);
                (range, Some(origin))
            }
        };
        let map = coloring.colormap.unwrap_or(source.default_colormap());
        let is_gray = *source == ColorSource::Intensity && coloring.colormap.is_none();
        let map_range = if is_gray { INTENSITY_GRAY_RANGE } else { (0.0, 1.0) };
        let gamma = match coloring.gamma {
            None if !is_gray => Gamma::NONE,
            given => Gamma::new(given, cloud.len(), |i| range.normalize(value_at(i))),
        };
        Ok(Self { value_at, range, map, map_range, gamma, range_origin })
    }

    /// Returns the sRGB-encoded colour of a value; grey where it is missing.
    pub fn color(&self, value: f64) -> [u8; 3] {
        let value = if is_data(value) { value } else { f64::NAN };
        let (first, last) = self.map_range;
        self.map.color(first + (last - first) * self.gamma.apply(self.range.normalize(value)))
    }

    /// Returns the range and the name of the map, for a note to the user.
    pub fn description(&self) -> String {
        let Self { range, range_origin, map, gamma, .. } = self;
        let origin = range_origin.map_or_else(String::new, |origin| format!(" ({origin})"));
        let gamma = gamma.described().map_or_else(String::new, |gamma| format!(", {gamma}"));
        format!("from {}{origin}, map {map}{gamma}", format_range(*range))
    }
}

/// Returns the range from the 2nd to the 98th percentile, or of all values if these two are equal, and its origin.
fn automatic_range(
    n_values: usize,
    value_at: impl Fn(usize) -> f64,
) -> (PercentileRange, &'static str) {
    let range = |percentiles| PercentileRange::from_values(n_values, &value_at, percentiles);
    match range(PercentileRange::DEFAULT_PERCENTILES) {
        None => (PercentileRange { low: 0.0, high: 1.0 }, "no values"),
        Some(found) if found.low == found.high => {
            (range((0.0, 100.0)).unwrap_or(found), "all values, as most are equal")
        }
        Some(found) => (found, "2 % to 98 % of the values"),
    }
}

/// Returns the range of the values of several clouds that are coloured alike, and a line about it; `None` if it is given, if
/// the values are labels, and if the source or a cloud has no values.
pub fn common_range(
    clouds: &[&PointCloud],
    coloring: &Coloring,
    source: &ColorSource,
) -> Option<((f64, f64), String)> {
    let are_labels = |cloud: &&PointCloud| labels(cloud, coloring, source).is_some();
    if coloring.range.is_some() || clouds.iter().any(are_labels) {
        return None;
    }
    let values = clouds.iter().map(|cloud| Some((cloud.len(), source.values(cloud, coloring)?)));
    let values = values.collect::<Option<Vec<_>>>()?;
    let value_at = |i: usize| {
        let mut i = i;
        let of_point = values.iter().find_map(|(n_points, value_at)| {
            let found = (i < *n_points).then(|| value_at(i));
            i = i.saturating_sub(*n_points);
            found
        });
        of_point.unwrap_or(f64::NAN)
    };
    let n_values = values.iter().map(|(n_points, _)| n_points).sum();
    let (range, range_origin) = source.automatic_range(n_values, value_at);
    let line = format!("color {source} from {} ({range_origin})", format_range(range));
    Some(((range.low, range.high), line))
}

/// Formats both ends with enough digits to resolve a thousandth of the range.
fn format_range(PercentileRange { low, high }: PercentileRange) -> String {
    let size = (high - low).abs().log10();
    let digits = if size.is_finite() { (3.0 - size).clamp(0.0, 12.0) as usize } else { 3 };
    format!("{low:.digits$} to {high:.digits$}")
}

impl ColorSource {
    /// Returns the map that is used if none is named.
    pub(super) fn default_colormap(&self) -> Colormap {
        if *self == Self::Intensity { Colormap::GRAY } else { Colormap::VIRIDIS }
    }

    /// Returns the range of values that is not given, and its origin.
    fn automatic_range(
        &self,
        n_values: usize,
        value_at: impl Fn(usize) -> f64,
    ) -> (PercentileRange, &'static str) {
        match self {
            Self::Support => (DEFAULT_RANGE, "at a point to one radius away from all points"),
            Self::Column(name) if name == STRUCTURE => {
                let (range, _) = automatic_range(n_values, value_at);
                (range, "0 surface, 1 line, 2 scatter, 3 not drawn")
            }
            _ => automatic_range(n_values, value_at),
        }
    }

    /// Returns the value of each point, or `None` if the source has no values or `cloud` lacks its column.
    fn values<'c>(
        &self,
        cloud: &'c PointCloud,
        coloring: &Coloring,
    ) -> Option<Box<dyn Fn(usize) -> f64 + Sync + 'c>> {
        match self {
            Self::Intensity => {
                let values = cloud.intensity.as_ref()?;
                Some(Box::new(|i| values[i].into()))
            }
            Self::Elevation => {
                let up = coloring.up.as_dvec3();
                Some(Box::new(move |i| cloud.world_position(i).dot(up)))
            }
            Self::Column(name) => {
                let values = cloud.scalar(name)?;
                Some(Box::new(|i| values.get(i)))
            }
            Self::Support => Some(Box::new(|_| 0.0)),
            Self::Rgb | Self::Class | Self::Normal | Self::Constant(_) => None,
        }
    }
}

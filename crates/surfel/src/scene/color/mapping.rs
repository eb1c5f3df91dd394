//! From values of points to colours of a map.

use super::{ColorSource, Coloring};
use crate::error::Result;
use crate::image::{Colormap, Stretch};
use crate::points::PointCloud;

/// Part of the grey map that intensity uses where no map is named: light and shadow cannot show on black.
const SHADED: (f32, f32) = (0.3, 0.95);

/// What shows the values of a cloud's points.
pub(super) struct Mapping<'c> {
    /// Of a point.
    pub value_at: Box<dyn Fn(usize) -> f64 + Sync + 'c>,
    /// Values of the first and last colour.
    pub range: Stretch,
    map: Colormap,
    /// Places of these colours in the map.
    part: (f32, f32),
    is_range_given: bool,
}

impl<'c> Mapping<'c> {
    /// Of a source that has values.
    pub fn new(cloud: &'c PointCloud, coloring: &Coloring, source: &ColorSource) -> Result<Self> {
        let value_at = source.values(cloud, coloring).ok_or_else(|| source.missing_from(cloud))?;
        let found = || Stretch::of(cloud.len(), &value_at, Stretch::PERCENTILES);
        let given = coloring.range.map(|(low, high)| Stretch { low, high });
        let range = given.or_else(found).unwrap_or(Stretch { low: 0.0, high: 1.0 });
        let map = match coloring.colormap {
            Some(map) => map,
            None if *source == ColorSource::Intensity => Colormap::from_name("gray")?,
            None => Colormap::from_name("viridis")?,
        };
        let is_grey = *source == ColorSource::Intensity && coloring.colormap.is_none();
        let part = if is_grey { SHADED } else { (0.0, 1.0) };
        Ok(Self { value_at, range, map, part, is_range_given: given.is_some() })
    }

    pub fn color(&self, value: f64) -> [u8; 3] {
        let (first, last) = self.part;
        self.map.color(first + (last - first) * self.range.unit(value))
    }

    pub fn words(&self) -> String {
        let origin = if self.is_range_given { "as given" } else { "2 % to 98 % of the values" };
        format!("from {} ({origin}), map {}", words(self.range), self.map.name())
    }
}

/// Both ends, with as many digits as tell a thousandth of the range.
fn words(Stretch { low, high }: Stretch) -> String {
    let size = (high - low).abs().log10();
    let digits = if size.is_finite() { (3.0 - size).clamp(0.0, 12.0) as usize } else { 3 };
    format!("{low:.digits$} to {high:.digits$}")
}

impl ColorSource {
    /// The value of each point, where there are values and `cloud` has them.
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
            Self::Rgb | Self::Class | Self::Normal | Self::Constant(_) => None,
        }
    }
}

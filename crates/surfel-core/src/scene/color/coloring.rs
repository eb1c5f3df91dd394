//! Settings of point colours.

use super::choose::choose_source;
use super::source::{CLASS, ColorSource};
use super::support::{DEFAULT_RANGE, SupportColors};
use crate::image::{Colormap, PercentileRange};
use crate::math::Vec3;
use crate::points::PointCloud;

/// Settings of point colours.
#[derive(Clone, Debug)]
pub struct Coloring {
    /// Source of the colours; `None` takes [`choose_source`]'s.
    pub source: Option<ColorSource>,
    /// Colour map; `None` is gray for intensity and viridis for everything else.
    pub colormap: Option<Colormap>,
    /// Values of the first and last colour of the map; `None` takes the 2nd and 98th percentile.
    pub range: Option<(f64, f64)>,
    /// Exponent that brightens colours of the file and values of the map, `value^(1 / gamma)`; `None` brightens dark
    /// colours of the file, and dark intensities if no map is named.
    pub gamma: Option<f64>,
    /// Unit vector along which elevation is measured.
    pub up: Vec3,
}

impl Default for Coloring {
    /// Returns a chosen source, colour map and range, with Z up.
    fn default() -> Self {
        Self { source: None, colormap: None, range: None, gamma: None, up: Vec3::Z }
    }
}

impl Coloring {
    /// Returns the colours of hits by their support, if these are the source.
    pub fn support_colors(&self) -> Option<SupportColors> {
        let source = self.source.as_ref().filter(|source| **source == ColorSource::Support)?;
        let colormap = self.colormap.unwrap_or(source.default_colormap());
        let given = self.range.map(|(low, high)| PercentileRange { low, high });
        Some(SupportColors { colormap, range: given.unwrap_or(DEFAULT_RANGE) })
    }

    /// Returns the source for `cloud`, and the reason if it was chosen automatically.
    pub(super) fn source_for(&self, cloud: &PointCloud) -> (ColorSource, Option<String>) {
        let has_class_labels = cloud.classification.is_none() && cloud.scalar(CLASS).is_some();
        match &self.source {
            Some(ColorSource::Class) if has_class_labels => {
                (ColorSource::Column(CLASS.to_owned()), None)
            }
            Some(source) => (source.clone(), None),
            None => {
                let (source, reason) = choose_source(cloud);
                (source, Some(reason))
            }
        }
    }
}

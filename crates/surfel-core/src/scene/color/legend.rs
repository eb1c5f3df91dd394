//! Legends: the meaning of the points' colours.

use super::coloring::Coloring;
use super::labels::{first_labels, labels};
use super::mapping::Mapping;
use super::source::ColorSource;
use crate::error::Result;
use crate::image::{class_color, class_name, label_color};
use crate::points::PointCloud;

/// A legend of point colours.
#[derive(Clone, Debug, PartialEq)]
pub enum Legend {
    /// The colours need no legend.
    None,
    /// A colour map.
    Map {
        /// Name of the column.
        title: String,
        /// Value of the first colour.
        low: f64,
        /// Value of the last colour.
        high: f64,
        /// sRGB-encoded colours of values in equal steps from `low` to `high`.
        colors: Vec<[u8; 3]>,
    },
    /// The classes of the cloud in ascending order.
    Classes(Vec<LegendClass>),
    /// Labels of a column in ascending order.
    Labels {
        /// Name of the column.
        title: String,
        /// Numbers with their sRGB-encoded colours.
        entries: Vec<(i64, [u8; 3])>,
    },
}

/// A class of a legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LegendClass {
    /// Number of the class.
    pub class: u8,
    /// Name of the class.
    pub name: &'static str,
    /// sRGB-encoded colour.
    pub color: [u8; 3],
    /// Number of the points of the class; 0 where it is not known.
    pub n_points: u64,
}

impl LegendClass {
    /// A class with its name and colour.
    pub fn new(class: u8, n_points: u64) -> Self {
        Self { class, name: class_name(class), color: class_color(class), n_points }
    }
}

/// Number of colours in the legend of a map.
const N_STEPS: usize = 32;
/// Maximum number of labels in a legend.
const MAX_LABELS: usize = 256;

/// Returns the legend of the colours that [`colorize`](super::colorize) gives to the same cloud.
///
/// # Errors
///
/// Fails if `cloud` lacks the column that the colours show.
pub fn legend(cloud: &PointCloud, coloring: &Coloring) -> Result<Legend> {
    let (source, _) = coloring.source_for(cloud);
    match &source {
        ColorSource::Rgb | ColorSource::Normal | ColorSource::Constant(_) => Ok(Legend::None),
        ColorSource::Class => {
            let classes = cloud.classification.as_ref();
            Ok(classes_of(classes.ok_or_else(|| source.missing_from(cloud))?))
        }
        ColorSource::Intensity
        | ColorSource::Elevation
        | ColorSource::Support
        | ColorSource::Column(_) => {
            let title = source.to_string();
            if let Some(values) = labels(cloud, coloring, &source) {
                let labels = first_labels(values, MAX_LABELS).into_iter();
                let entries = labels.map(|label| (label, label_color(label))).collect();
                return Ok(Legend::Labels { title, entries });
            }
            Ok(steps_of(&Mapping::new(cloud, coloring, &source)?, title))
        }
    }
}

fn classes_of(classes: &[u8]) -> Legend {
    let mut n_points = [0; 256];
    classes.iter().for_each(|class| n_points[usize::from(*class)] += 1);
    let present = (0..=u8::MAX).zip(n_points).filter(|(_, n_points)| 0 < *n_points);
    Legend::Classes(present.map(|(class, n_points)| LegendClass::new(class, n_points)).collect())
}

fn steps_of(mapping: &Mapping, title: String) -> Legend {
    let (low, high) = (mapping.range.low, mapping.range.high);
    let value = |step: usize| {
        let weight = step as f64 / (N_STEPS - 1) as f64;
        (1.0 - weight) * low + weight * high
    };
    let colors = (0..N_STEPS).map(|step| mapping.color(value(step))).collect();
    Legend::Map { title, low, high, colors }
}

#[cfg(test)]
mod tests {
    //! Legends show the colours that points of the same values get.

    use super::*;
    use crate::math::Vec3;
    use crate::points::{Scalar, Values};
    use crate::progress::NoProgress;
    use crate::scene::color::colorize;

    /// Points with heights and values from 0 to 1000.
    fn ladder() -> PointCloud {
        let positions = (0..=1000).map(|i| Vec3::new(0.0, 0.0, i as f32)).collect();
        let values = Values::F64((0..=1000).map(f64::from).collect());
        PointCloud {
            intensity: Some((0..=1000).map(|i| i as f32).collect()),
            classification: Some((0..=1000).map(|i| [2, 200, 6][i % 3]).collect()),
            scalars: vec![Scalar { name: "rain".to_owned(), values }],
            ..PointCloud::from_positions(positions)
        }
    }

    fn coloring(source: &str) -> Coloring {
        let source = Some(source.parse().unwrap());
        Coloring { source, ..Coloring::default() }
    }

    #[test]
    fn the_first_and_last_color_are_those_of_points_with_these_values() {
        let cloud = ladder();
        let automatic = Coloring { source: None, ..coloring("rgb") };
        let reversed = Coloring { range: Some((900.0, 100.0)), ..coloring("rain") };
        for (coloring, expected) in [
            (coloring("rain"), "rain"),
            (coloring("intensity"), "intensity"),
            (coloring("elevation"), "elevation"),
            (automatic, "intensity"),
            (reversed, "rain"),
        ] {
            let points = colorize(&cloud, &coloring, &NoProgress).unwrap();
            let Legend::Map { title, low, high, colors } = legend(&cloud, &coloring).unwrap()
            else {
                panic!("no map for {expected}");
            };
            assert_eq!((title.as_str(), colors.len()), (expected, N_STEPS));
            assert_eq!(colors[0], points[low as usize], "{title}");
            assert_eq!(colors[N_STEPS - 1], points[high as usize], "{title}");
            assert!(colors.windows(2).all(|pair| pair[0] != pair[1]), "{title}");
        }
    }

    #[test]
    fn the_legend_of_classes_has_their_names_and_colors() {
        let expected = [(2, "ground", 334), (6, "building", 333), (200, "user definable", 334)];
        let expected = expected.map(|(class, name, n_points)| LegendClass {
            class,
            name,
            color: class_color(class),
            n_points,
        });
        let found = legend(&ladder(), &coloring("class")).unwrap();
        assert_eq!(found, Legend::Classes(expected.to_vec()));
    }

    #[test]
    fn colors_without_values_have_no_legend() {
        for source in ["rgb", "normal", "#fff"] {
            assert_eq!(legend(&ladder(), &coloring(source)), Ok(Legend::None));
        }
        assert!(legend(&ladder(), &coloring("height")).is_err());
        assert!(legend(&PointCloud::default(), &coloring("class")).is_err());
    }
}

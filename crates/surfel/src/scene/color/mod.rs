//! Colours of points: from one of a cloud's columns, which is chosen from the data if none is named.

mod choose;
mod mapping;
mod legend;

pub use choose::{PLAIN, choose};
pub use legend::{Legend, legend};

use crate::error::{Error, Result};
use crate::image::{Colormap, class_color};
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::progress::Progress;
use mapping::Mapping;
use rayon::prelude::*;
use std::fmt;
use std::str::FromStr;

/// What the points' colours show.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    Rgb,
    Intensity,
    /// Height along `Coloring::up`.
    Elevation,
    Class,
    /// The direction of the normal, (n + 1) / 2.
    Normal,
    /// sRGB-encoded.
    Constant([u8; 3]),
    /// Any other column, by its name.
    Column(String),
}

/// How points are coloured.
#[derive(Clone, Debug)]
pub struct Coloring {
    /// `None` chooses: the file's colours, or its intensity, or one light grey for all.
    pub source: Option<ColorSource>,
    /// `None` is gray for intensity, viridis for everything else.
    pub colormap: Option<Colormap>,
    /// Values of the first and last colour of the map; `None` takes 2 % to 98 % of the values.
    pub range: Option<(f64, f64)>,
    pub up: Vec3,
}

/// One colour a point, sRGB-encoded. `progress` is told the choice and the range.
pub fn colorize(
    cloud: &PointCloud,
    coloring: &Coloring,
    progress: &dyn Progress,
) -> Result<Vec<[u8; 3]>> {
    let (source, reason) = coloring.source_for(cloud);
    // Intensity is told with its range.
    if let Some(reason) = reason.filter(|_| source != ColorSource::Intensity) {
        progress.note(&format!("color {source}: {reason}"));
    }
    progress.check()?;
    let missing = || source.missing_from(cloud);
    let all = |color: &(dyn Fn(usize) -> [u8; 3] + Sync)| {
        (0..cloud.len()).into_par_iter().map(color).collect()
    };
    match &source {
        ColorSource::Rgb => {
            let colors = cloud.colors.as_ref().ok_or_else(missing)?;
            Ok(all(&|i| colors[i].map(to_8_bits)))
        }
        ColorSource::Class => {
            let classes = cloud.classification.as_ref().ok_or_else(missing)?;
            Ok(all(&|i| class_color(classes[i])))
        }
        ColorSource::Normal => {
            let normals = cloud.normals.as_ref().ok_or_else(missing)?;
            Ok(all(&|i| (0.5 * normals[i] + 0.5).to_array().map(|x| (x * 255.0).round() as u8)))
        }
        ColorSource::Constant(color) => Ok(vec![*color; cloud.len()]),
        ColorSource::Intensity | ColorSource::Elevation | ColorSource::Column(_) => {
            let mapping = Mapping::new(cloud, coloring, &source)?;
            progress.note(&format!("color {source} {}", mapping.words()));
            Ok(all(&|i| mapping.color((mapping.value_at)(i))))
        }
    }
}

/// A 16-bit channel as the 8-bit value that it was, or is nearest to.
fn to_8_bits(value: u16) -> u8 {
    ((u32::from(value) + 128) / 257) as u8
}

impl Coloring {
    /// What `cloud` is coloured by, and why, if that was left open.
    fn source_for(&self, cloud: &PointCloud) -> (ColorSource, Option<&'static str>) {
        match &self.source {
            Some(source) => (source.clone(), None),
            None => {
                let (source, reason) = choose(cloud);
                (source, Some(reason))
            }
        }
    }
}

impl ColorSource {
    /// Whether `cloud` has what it takes.
    pub fn is_in(&self, cloud: &PointCloud) -> bool {
        match self {
            Self::Rgb => cloud.colors.is_some(),
            Self::Intensity => cloud.intensity.is_some(),
            Self::Class => cloud.classification.is_some(),
            Self::Normal => cloud.normals.is_some(),
            Self::Elevation | Self::Constant(_) => true,
            Self::Column(name) => cloud.scalar(name).is_some(),
        }
    }

    fn missing_from(&self, cloud: &PointCloud) -> Error {
        let mut known: Vec<&str> = vec!["elevation", "#RRGGBB"];
        let columns = [
            ("rgb", Self::Rgb),
            ("intensity", Self::Intensity),
            ("class", Self::Class),
            ("normal", Self::Normal),
        ];
        known.extend(columns.iter().filter(|(_, color)| color.is_in(cloud)).map(|(name, _)| *name));
        known.extend(cloud.scalars.iter().map(|scalar| scalar.name.as_str()));
        let kind = "column of this cloud";
        Error::UnknownName { kind, found: self.to_string(), known: known.join(", ") }
    }
}

impl fmt::Display for ColorSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rgb => f.write_str("rgb"),
            Self::Intensity => f.write_str("intensity"),
            Self::Elevation => f.write_str("elevation"),
            Self::Class => f.write_str("class"),
            Self::Normal => f.write_str("normal"),
            Self::Constant([r, g, b]) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
            Self::Column(name) => f.write_str(name),
        }
    }
}

impl FromStr for ColorSource {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || Error::Setting {
            name: "color",
            found: text.to_owned(),
            expected: "rgb, intensity, elevation, class, normal, #RRGGBB or the name of a column",
        };
        match text.trim() {
            "" => Err(wrong()),
            "rgb" | "RGB" => Ok(Self::Rgb),
            "intensity" => Ok(Self::Intensity),
            "elevation" => Ok(Self::Elevation),
            "class" | "classification" => Ok(Self::Class),
            "normal" | "normals" => Ok(Self::Normal),
            color if color.starts_with('#') => {
                parse_hex(color).map(Self::Constant).ok_or_else(wrong)
            }
            name => Ok(Self::Column(name.to_owned())),
        }
    }
}

/// `#RRGGBB`, or `#RGB` for short.
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
    use super::*;
    use crate::points::{Scalar, Values};
    use crate::progress::Silent;
    use std::sync::Mutex;

    struct Listener(Mutex<Vec<String>>);

    impl Progress for Listener {
        fn note(&self, line: &str) {
            self.0.lock().unwrap().push(line.to_owned());
        }
    }

    fn coloring(source: Option<&str>) -> Coloring {
        Coloring {
            source: source.map(|text| text.parse().unwrap()),
            colormap: None,
            range: None,
            up: Vec3::Z,
        }
    }

    fn lattice() -> PointCloud {
        let place = |i: usize| Vec3::new((i % 50) as f32, (i / 50) as f32, i as f32);
        PointCloud::from_positions((0..2500).map(place).collect())
    }

    #[test]
    fn eight_bit_colors_come_back() {
        let colors = (0..=255u16).map(|v| [257 * v; 3]).collect();
        let cloud = PointCloud {
            colors: Some(colors),
            ..PointCloud::from_positions(vec![Vec3::ZERO; 256])
        };
        let found = colorize(&cloud, &coloring(None), &Silent).unwrap();
        assert!(found.iter().enumerate().all(|(v, color)| *color == [v as u8; 3]));
    }

    #[test]
    fn columns_are_stretched_and_mapped() {
        let mut cloud = lattice();
        let values = Values::U16((0..2500).collect());
        cloud.scalars.push(Scalar { name: "Deviation".to_owned(), values });
        let listener = Listener(Mutex::default());
        let found = colorize(&cloud, &coloring(Some("deviation")), &listener).unwrap();
        let viridis = Colormap::from_name("viridis").unwrap();
        assert_eq!((found[0], found[2499]), (viridis.color(0.0), viridis.color(1.0)));
        assert!(listener.0.lock().unwrap()[0].contains("50 to 2449 ("));
        assert_eq!(found, colorize(&cloud, &coloring(Some("elevation")), &Silent).unwrap());
        let range = Coloring {
            range: Some((0.0, 10_000.0)),
            colormap: Some(Colormap::from_name("gray").unwrap()),
            ..coloring(Some("deviation"))
        };
        assert_eq!(colorize(&cloud, &range, &Silent).unwrap()[2000], [51; 3]);
    }

    #[test]
    fn intensity_is_never_black_unless_its_map_is_named() {
        let intensity = Some((0..2500).map(|i| i as f32).collect());
        let cloud = PointCloud { intensity, ..lattice() };
        let listener = Listener(Mutex::default());
        let chosen = colorize(&cloud, &coloring(None), &listener).unwrap();
        assert!(70 < chosen[0][0] && chosen[0][0] < 80, "{:?}", chosen[0]);
        assert_eq!(listener.0.lock().unwrap().len(), 1);
        let named = coloring(Some("intensity"));
        assert_eq!(colorize(&cloud, &named, &Silent).unwrap(), chosen);
        let gray = Coloring { colormap: Some(Colormap::from_name("gray").unwrap()), ..named };
        assert_eq!(colorize(&cloud, &gray, &Silent).unwrap()[0], [0; 3]);
    }

    #[test]
    fn a_missing_column_names_those_there_are() {
        let mut cloud = lattice();
        cloud
            .scalars
            .push(Scalar { name: "GpsTime".to_owned(), values: Values::U8(vec![1; 2500]) });
        for source in ["rgb", "intensity", "class", "normal", "height"] {
            let error = colorize(&cloud, &coloring(Some(source)), &Silent).unwrap_err().to_string();
            assert!(error.contains(source) && error.contains("GpsTime"), "{error}");
        }
    }

    #[test]
    fn sources_have_names() {
        for text in ["rgb", "intensity", "elevation", "class", "normal", "#0a141e", "gps_time"] {
            assert_eq!(text.parse::<ColorSource>().unwrap().to_string(), text);
        }
        assert_eq!("#fff".parse::<ColorSource>().unwrap(), ColorSource::Constant([255; 3]));
        for text in ["", "#12345", "#ggg", "#éé"] {
            assert!(text.parse::<ColorSource>().is_err());
        }
    }
}

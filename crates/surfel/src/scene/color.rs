//! Colours of points: from one of a cloud's columns, which is chosen from the data if none is named.

use crate::error::{Error, Result};
use crate::image::{Colormap, Stretch, class_color};
use crate::math::Vec3;
use crate::points::PointCloud;
use crate::progress::Progress;
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

/// Light stone: white objects glare, and a grey without warmth looks dead.
pub const PLAIN: [u8; 3] = [0xd6, 0xd2, 0xca];

/// Part of the map that an automatic choice uses: light and shadow cannot show on black.
const SHADED: (f32, f32) = (0.3, 0.95);

/// One colour a point, sRGB-encoded. `progress` is told the choice and the range.
pub fn colorize(
    cloud: &PointCloud,
    coloring: &Coloring,
    progress: &dyn Progress,
) -> Result<Vec<[u8; 3]>> {
    let source = match &coloring.source {
        Some(source) => source.clone(),
        None => {
            let (source, reason) = choose(cloud);
            progress.note(&format!("color {source}: {reason}"));
            source
        }
    };
    progress.check()?;
    let missing = || missing_column(cloud, &source);
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
        ColorSource::Intensity => {
            let values = cloud.intensity.as_ref().ok_or_else(missing)?;
            mapped(cloud.len(), &|i| values[i].into(), coloring, &source, progress)
        }
        ColorSource::Elevation => {
            let up = coloring.up.as_dvec3();
            let height = |i| cloud.world_position(i).dot(up);
            mapped(cloud.len(), &height, coloring, &source, progress)
        }
        ColorSource::Column(name) => {
            let values = cloud.scalar(name).ok_or_else(missing)?;
            mapped(cloud.len(), &|i| values.get(i), coloring, &source, progress)
        }
    }
}

/// What to show when nothing was asked for, and why.
pub fn choose(cloud: &PointCloud) -> (ColorSource, &'static str) {
    if cloud.colors.as_ref().is_some_and(|colors| are_meant(colors)) {
        return (ColorSource::Rgb, "the file has colours");
    }
    match &cloud.intensity {
        Some(values) if is_picture(&cloud.positions, values) => {
            (ColorSource::Intensity, "the file has intensities and no colours")
        }
        Some(_) => (
            ColorSource::Constant(PLAIN),
            "the file has no colours, and its intensities differ between neighbours as much as anywhere",
        ),
        None => (ColorSource::Constant(PLAIN), "the file has no colours and no intensities"),
    }
}

/// A 16-bit channel as the 8-bit value that it was, or is nearest to.
fn to_8_bits(value: u16) -> u8 {
    ((u32::from(value) + 128) / 257) as u8
}

/// Programs fill columns of colours that nobody measured with black or white.
fn are_meant(colors: &[[u16; 3]]) -> bool {
    let filler = [[0; 3], [u16::MAX; 3]].into_iter().find(|filler| Some(filler) == colors.first());
    colors.iter().any(|color| Some(*color) != filler)
}

fn mapped(
    n_values: usize,
    value_at: &(dyn Fn(usize) -> f64 + Sync),
    coloring: &Coloring,
    source: &ColorSource,
    progress: &dyn Progress,
) -> Result<Vec<[u8; 3]>> {
    let found = || Stretch::of(n_values, value_at, Stretch::PERCENTILES);
    let given = coloring.range.map(|(low, high)| Stretch { low, high });
    let range = given.or_else(found).unwrap_or(Stretch { low: 0.0, high: 1.0 });
    let map = match coloring.colormap {
        Some(map) => map,
        None if *source == ColorSource::Intensity => Colormap::from_name("gray")?,
        None => Colormap::from_name("viridis")?,
    };
    let origin = if given.is_some() { "as given" } else { "2 % to 98 % of the values" };
    let Stretch { low, high } = range;
    progress.note(&format!("color {source} from {low} to {high} ({origin}), map {}", map.name()));
    let is_automatic = coloring.source.is_none() && coloring.colormap.is_none();
    let (first, last) = if is_automatic { SHADED } else { (0.0, 1.0) };
    let color = |i| map.color(first + (last - first) * range.unit(value_at(i)));
    Ok((0..n_values).into_par_iter().map(color).collect())
}

/// Patches looked at to tell a picture from noise.
const N_PATCHES: usize = 64;
/// Points of a patch.
const PATCH: usize = 24;
/// Share of the variance that points of one patch must have in common.
const IN_COMMON: f64 = 0.3;

/// Whether neighbouring points have similar values, as where the values show the surface.
///
/// The share of the variance that lies between patches, not within them (the intraclass correlation).
fn is_picture(positions: &[Vec3], values: &[f32]) -> bool {
    let stride = positions.len().div_ceil(N_PATCHES).max(1);
    let centers: Vec<usize> = (0..positions.len()).step_by(stride).collect();
    let patches: Vec<(f64, f64)> = centers
        .into_par_iter()
        .map(|center| mean_and_variance(nearest(positions, center).map(|i| f64::from(values[i]))))
        .filter(|(mean, variance)| mean.is_finite() && variance.is_finite())
        .collect();
    let (_, between) = mean_and_variance(patches.iter().map(|(mean, _)| *mean));
    let (within, _) = mean_and_variance(patches.iter().map(|(_, variance)| *variance));
    IN_COMMON * (between + within) < between
}

/// The points nearest to one of them, by looking at all.
fn nearest(positions: &[Vec3], center: usize) -> impl Iterator<Item = usize> {
    let mut nearest: Vec<(f32, usize)> = Vec::with_capacity(2 * PATCH);
    let mut bound = f32::INFINITY;
    for (i, position) in positions.iter().enumerate() {
        let squared = position.distance_squared(positions[center]);
        if squared < bound {
            nearest.push((squared, i));
            if nearest.len() == 2 * PATCH {
                nearest.select_nth_unstable_by(PATCH, |a, b| a.0.total_cmp(&b.0));
                nearest.truncate(PATCH);
                bound = nearest.iter().fold(0.0, |all, (squared, _)| all.max(*squared));
            }
        }
    }
    nearest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    nearest.into_iter().take(PATCH).map(|(_, i)| i)
}

fn mean_and_variance(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for value in values {
        n += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean = sum / n;
    (mean, (squares / n - mean * mean).max(0.0))
}

fn missing_column(cloud: &PointCloud, source: &ColorSource) -> Error {
    let mut known: Vec<&str> = vec!["elevation", "#RRGGBB"];
    let columns = [
        ("rgb", cloud.colors.is_some()),
        ("intensity", cloud.intensity.is_some()),
        ("class", cloud.classification.is_some()),
        ("normal", cloud.normals.is_some()),
    ];
    known.extend(columns.iter().filter(|(_, is_present)| *is_present).map(|(name, _)| *name));
    known.extend(cloud.scalars.iter().map(|scalar| scalar.name.as_str()));
    Error::UnknownName {
        kind: "column of this cloud",
        found: source.to_string(),
        known: known.join(", "),
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
    use crate::math::Random;
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
        assert!(listener.0.lock().unwrap()[0].contains("49.98 to 2449.02"));
        assert_eq!(found, colorize(&cloud, &coloring(Some("elevation")), &Silent).unwrap());
        let range = Coloring {
            range: Some((0.0, 10_000.0)),
            colormap: Some(Colormap::from_name("gray").unwrap()),
            ..coloring(Some("deviation"))
        };
        assert_eq!(colorize(&cloud, &range, &Silent).unwrap()[2000], [51; 3]);
    }

    #[test]
    fn the_choice_falls_on_what_shows_something() {
        let mut cloud = lattice();
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        let mut random = Random::new(1, 0);
        cloud.intensity = Some((0..2500).map(|_| random.next_f32()).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        cloud.intensity = Some((0..2500).map(|i| ((i % 50) / 10 % 2) as f32).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Intensity);
        cloud.colors = Some(vec![[0; 3]; 2500]);
        assert_eq!(choose(&cloud).0, ColorSource::Intensity);
        let darkest = colorize(&cloud, &coloring(None), &Silent).unwrap()[0][0];
        assert!(70 < darkest && darkest < 80, "{darkest}");
        assert_eq!(colorize(&cloud, &coloring(Some("intensity")), &Silent).unwrap()[0], [0; 3]);
        cloud.colors = Some(vec![[0x8080; 3]; 2500]);
        assert_eq!(choose(&cloud).0, ColorSource::Rgb);
        cloud.colors = Some((0..2500).map(|i| [i, 0, 0]).collect());
        assert_eq!(choose(&cloud).0, ColorSource::Rgb);
        cloud.intensity = Some(vec![0.5; 2500]);
        cloud.colors = None;
        assert_eq!(choose(&cloud).0, ColorSource::Constant(PLAIN));
        assert_eq!(choose(&PointCloud::default()).0, ColorSource::Constant(PLAIN));
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

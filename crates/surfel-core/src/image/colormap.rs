//! Colour maps with their matplotlib names.

use crate::error::{Error, Result};
use colorous::Gradient;

/// A map from [0, 1] to colours.
#[derive(Clone, Copy, Debug)]
pub struct Colormap {
    name: &'static str,
    source: Source,
    reversed: bool,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    Gradient(Gradient),
    Formula(fn(f32) -> [f32; 3]),
    /// Steps of equal width with a colour each.
    Steps(&'static [[u8; 3]]),
}

impl std::fmt::Display for Colormap {
    /// Writes the name that [`Colormap::from_name`] reads.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{}", self.name, if self.reversed { "_r" } else { "" })
    }
}

impl PartialEq for Colormap {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.reversed) == (other.name, other.reversed)
    }
}

use Source::{Formula, Steps};

const MAPS: [(&str, Source); 39] = [
    (Colormap::VIRIDIS.name, Colormap::VIRIDIS.source),
    ("plasma", Source::Gradient(colorous::PLASMA)),
    ("inferno", Source::Gradient(colorous::INFERNO)),
    ("magma", Source::Gradient(colorous::MAGMA)),
    ("cividis", Source::Gradient(colorous::CIVIDIS)),
    ("turbo", Source::Gradient(colorous::TURBO)),
    (Colormap::GRAY.name, Colormap::GRAY.source),
    ("terrain", Formula(terrain)),
    ("coolwarm", Formula(coolwarm)),
    ("jet", Formula(jet)),
    ("tab20", Steps(&TAB20)),
    ("Spectral", Source::Gradient(colorous::SPECTRAL)),
    ("cubehelix", Source::Gradient(colorous::CUBEHELIX)),
    ("Blues", Source::Gradient(colorous::BLUES)),
    ("Greens", Source::Gradient(colorous::GREENS)),
    ("Greys", Source::Gradient(colorous::GREYS)),
    ("Oranges", Source::Gradient(colorous::ORANGES)),
    ("Purples", Source::Gradient(colorous::PURPLES)),
    ("Reds", Source::Gradient(colorous::REDS)),
    ("BuGn", Source::Gradient(colorous::BLUE_GREEN)),
    ("BuPu", Source::Gradient(colorous::BLUE_PURPLE)),
    ("GnBu", Source::Gradient(colorous::GREEN_BLUE)),
    ("OrRd", Source::Gradient(colorous::ORANGE_RED)),
    ("PuBu", Source::Gradient(colorous::PURPLE_BLUE)),
    ("PuBuGn", Source::Gradient(colorous::PURPLE_BLUE_GREEN)),
    ("PuRd", Source::Gradient(colorous::PURPLE_RED)),
    ("RdPu", Source::Gradient(colorous::RED_PURPLE)),
    ("YlGn", Source::Gradient(colorous::YELLOW_GREEN)),
    ("YlGnBu", Source::Gradient(colorous::YELLOW_GREEN_BLUE)),
    ("YlOrBr", Source::Gradient(colorous::YELLOW_ORANGE_BROWN)),
    ("YlOrRd", Source::Gradient(colorous::YELLOW_ORANGE_RED)),
    ("BrBG", Source::Gradient(colorous::BROWN_GREEN)),
    ("PRGn", Source::Gradient(colorous::PURPLE_GREEN)),
    ("PiYG", Source::Gradient(colorous::PINK_GREEN)),
    ("PuOr", Source::Gradient(colorous::PURPLE_ORANGE)),
    ("RdBu", Source::Gradient(colorous::RED_BLUE)),
    ("RdGy", Source::Gradient(colorous::RED_GREY)),
    ("RdYlBu", Source::Gradient(colorous::RED_YELLOW_BLUE)),
    ("RdYlGn", Source::Gradient(colorous::RED_YELLOW_GREEN)),
];

impl Colormap {
    /// The map of values other than intensity.
    pub const VIRIDIS: Self = Self::new("viridis", Source::Gradient(colorous::VIRIDIS));
    /// The map of intensity.
    pub const GRAY: Self = Self::new("gray", Formula(|t| [t; 3]));

    const fn new(name: &'static str, source: Source) -> Self {
        Self { name, source, reversed: false }
    }

    /// Finds a map by its name in any case. The suffix `_r` reverses the map.
    ///
    /// # Errors
    ///
    /// Returns [`Error::UnknownName`] for an unknown name.
    pub fn from_name(name: &str) -> Result<Self> {
        let (base, reversed) = name.strip_suffix("_r").map_or((name, false), |base| (base, true));
        let base = if base.eq_ignore_ascii_case("grey") { "gray" } else { base };
        let found = MAPS.iter().find(|(known, _)| known.eq_ignore_ascii_case(base));
        let &(name, source) = found.ok_or_else(|| Error::UnknownName {
            kind: "colour map",
            found: name.to_owned(),
            known: format!(
                "{}, each also with the suffix _r",
                names().collect::<Vec<_>>().join(", ")
            ),
        })?;
        Ok(Self { name, source, reversed })
    }

    /// Returns the matplotlib name, without suffix.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the sRGB-encoded colour at `t`, which is clamped to [0, 1]. NaN is grey.
    pub fn color(&self, t: f32) -> [u8; 3] {
        if t.is_nan() {
            return [128; 3];
        }
        let t = t.clamp(0.0, 1.0);
        let t = if self.reversed { 1.0 - t } else { t };
        match self.source {
            Source::Gradient(gradient) => {
                let color = gradient.eval_continuous(t.into());
                [color.r, color.g, color.b]
            }
            Formula(formula) => formula(t).map(|c| (c * 255.0).round() as u8),
            Steps(colors) => colors[((t * colors.len() as f32) as usize).min(colors.len() - 1)],
        }
    }
}

/// Returns all names that `Colormap::from_name` knows, without suffix.
pub fn names() -> impl Iterator<Item = &'static str> {
    MAPS.iter().map(|(name, _)| *name)
}

/// Interpolates linearly between knots (position, value) in ascending order.
fn piecewise(knots: &[(f32, f32)], t: f32) -> f32 {
    let next = knots.partition_point(|knot| knot.0 < t).clamp(1, knots.len() - 1);
    let ((t0, a), (t1, b)) = (knots[next - 1], knots[next]);
    a + (b - a) * ((t - t0) / (t1 - t0))
}

/// Returns the colour of MATLAB's old default map, with matplotlib's knots.
fn jet(t: f32) -> [f32; 3] {
    [
        piecewise(&[(0.0, 0.0), (0.35, 0.0), (0.66, 1.0), (0.89, 1.0), (1.0, 0.5)], t),
        piecewise(
            &[(0.0, 0.0), (0.125, 0.0), (0.375, 1.0), (0.64, 1.0), (0.91, 0.0), (1.0, 0.0)],
            t,
        ),
        piecewise(&[(0.0, 0.5), (0.11, 1.0), (0.34, 1.0), (0.65, 0.0), (1.0, 0.0)], t),
    ]
}

/// Returns the colour of a map of water, lowland, hills, rock and snow, with matplotlib's knots.
fn terrain(t: f32) -> [f32; 3] {
    const AT: [f32; 6] = [0.0, 0.15, 0.25, 0.5, 0.75, 1.0];
    const VALUES: [[f32; 6]; 3] = [
        [0.2, 0.0, 0.0, 1.0, 0.5, 1.0],
        [0.2, 0.6, 0.8, 1.0, 0.36, 1.0],
        [0.6, 1.0, 0.4, 0.6, 0.33, 1.0],
    ];
    VALUES.map(|values| piecewise(&std::array::from_fn::<_, 6, _>(|i| (AT[i], values[i])), t))
}

/// Returns the colour of a perceptually uniform map from blue over light grey to red, given by the Msh coordinates
/// of its ends and its middle (Moreland, Diverging Color Maps for Scientific Visualization, 2009).
fn coolwarm(t: f32) -> [f32; 3] {
    const BLUE: [f32; 3] = [80.0, 1.08, -1.1];
    const RED: [f32; 3] = [80.0, 1.08, 0.5];
    const WHITE: f32 = 88.0;
    // The hue rotates away from white, so that no colour near white looks tinted.
    const HUE_SHIFT: f32 = 0.561;
    let between = |from: [f32; 3], to: [f32; 3], t: f32| {
        rgb_from_msh(std::array::from_fn(|i| from[i] + t * (to[i] - from[i])))
    };
    if t < 0.5 {
        between(BLUE, [WHITE, 0.0, BLUE[2] - HUE_SHIFT], 2.0 * t)
    } else {
        between([WHITE, 0.0, RED[2] + HUE_SHIFT], RED, 2.0 * t - 1.0)
    }
}

/// Converts Msh, the polar coordinates of CIELAB with white D65, to encoded sRGB.
fn rgb_from_msh([m, s, h]: [f32; 3]) -> [f32; 3] {
    let (l, a, b) = (m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin());
    let fy = (l + 16.0) / 116.0;
    let expand = |f: f32| if 6.0 / 29.0 < f { f * f * f } else { (f - 16.0 / 116.0) / 7.787 };
    let x = 0.950_47 * expand(fy + a / 500.0);
    let y = expand(fy);
    let z = 1.088_83 * expand(fy - b / 200.0);
    [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ]
    .map(|linear| super::encode_srgb(linear.clamp(0.0, 1.0)))
}

const TAB20: [[u8; 3]; 20] = [
    [31, 119, 180],
    [174, 199, 232],
    [255, 127, 14],
    [255, 187, 120],
    [44, 160, 44],
    [152, 223, 138],
    [214, 39, 40],
    [255, 152, 150],
    [148, 103, 189],
    [197, 176, 213],
    [140, 86, 75],
    [196, 156, 148],
    [227, 119, 194],
    [247, 182, 210],
    [127, 127, 127],
    [199, 199, 199],
    [188, 189, 34],
    [219, 219, 141],
    [23, 190, 207],
    [158, 218, 229],
];

#[cfg(test)]
mod tests {
    //! Colours of the maps.

    use super::*;

    fn color(name: &str, t: f32) -> [u8; 3] {
        Colormap::from_name(name).unwrap().color(t)
    }

    fn close(a: [u8; 3], b: [u8; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 2)
    }

    #[test]
    fn maps_have_the_colors_of_matplotlib() {
        let known = [
            ("viridis", [[68, 1, 84], [33, 145, 140], [253, 231, 37]]),
            ("magma", [[0, 0, 4], [183, 55, 121], [252, 253, 191]]),
            ("jet", [[0, 0, 128], [124, 255, 121], [128, 0, 0]]),
            ("coolwarm", [[59, 76, 192], [221, 220, 220], [180, 4, 38]]),
            ("terrain", [[51, 51, 153], [255, 255, 153], [255, 255, 255]]),
            ("gray", [[0; 3], [128; 3], [255; 3]]),
        ];
        for (name, colors) in known {
            for (t, expected) in [0.0, 0.5, 1.0].into_iter().zip(colors) {
                let found = color(name, t);
                assert!(close(found, expected), "{name} at {t}: {found:?}");
            }
        }
    }

    #[test]
    fn the_suffix_reverses_every_map() {
        for name in names() {
            for t in [0.0, 0.25, 0.625, 1.0] {
                if name != "tab20" {
                    assert_eq!(color(&format!("{name}_r"), t), color(name, 1.0 - t), "{name}");
                }
            }
        }
        assert_eq!(color("tab20_r", 0.0), color("tab20", 1.0));
    }

    #[test]
    fn values_outside_are_clamped_and_nan_is_grey() {
        assert_eq!(color("viridis", -3.0), color("viridis", 0.0));
        assert_eq!(color("tab20", f32::INFINITY), [158, 218, 229]);
        assert_eq!(color("gray", f32::NAN), [128; 3]);
    }

    #[test]
    fn an_error_about_an_unknown_name_lists_the_known_names() {
        let message = Colormap::from_name("viridish").unwrap_err().to_string();
        assert!(message.contains("viridish") && message.contains("coolwarm"), "{message}");
    }
}

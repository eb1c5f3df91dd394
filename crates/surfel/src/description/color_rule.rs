//! Rules of colours: single ones, backgrounds, and what colours points.

use super::Invalid;
use super::rule::{Rule, as_list, expected, from_core};
use super::spelling::nearest_if_any;
use csscolorparser::NAMED_COLORS;
use serde_json::{Value, json};
use std::path::Path;
use surfel_core::image::{Colormap, decode_srgb8, encode_srgb};
use surfel_core::math::Vec3;
use surfel_core::scene::Background;
use surfel_core::scene::color::ColorSource;

/// A linear colour, as `#RRGGBB`, `#RGB` or a name of CSS.
pub struct Color;

const COLOR: &str = "a colour as in #aabbcc or steelblue";

impl Rule<Vec3> for Color {
    fn read(&self, value: &Value, _: &Path) -> Result<Vec3, Invalid> {
        let color = value.as_str().and_then(srgb_color);
        let advice = || nearest_colors(std::slice::from_ref(value));
        color.map(to_linear).ok_or_else(|| expected(format_args!("{COLOR}{}", advice())))
    }

    fn write(&self, value: &Vec3) -> Value {
        json!(hex(*value))
    }
}

/// Returns a colour by its hexadecimal digits or its CSS name, sRGB-encoded.
pub fn srgb_color(text: &str) -> Option<[u8; 3]> {
    let text = text.trim();
    let is_hex = text.starts_with('#') && [4, 7].contains(&text.len());
    let is_name = text.bytes().all(|byte| byte.is_ascii_alphabetic()) && text != "transparent";
    let color = (is_hex || is_name).then(|| csscolorparser::parse(text).ok())??;
    let [r, g, b, _] = color.to_rgba8();
    Some([r, g, b])
}

/// Advises on the first of some colours that is not known, by the nearest name of CSS; empty if none is near.
fn nearest_colors(colors: &[Value]) -> String {
    let mut texts = colors.iter().filter_map(Value::as_str);
    let unknown = texts.find(|text| srgb_color(text).is_none()).unwrap_or_default();
    nearest_if_any(unknown, NAMED_COLORS.keys().map(|name| name.as_str()))
}

fn to_linear(srgb: [u8; 3]) -> Vec3 {
    Vec3::from_array(srgb.map(decode_srgb8))
}

fn hex(linear: Vec3) -> String {
    let byte = |value: f32| (255.0 * encode_srgb(value)).round() as u8;
    let [r, g, b] = linear.to_array().map(byte);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// One colour, two from top to bottom, or the name of a background.
pub struct BackgroundRule;

/// Dark enough at the top for light stone to stand out, light enough at the bottom for dark things.
const GRADIENT: [&str; 2] = ["#6f7c8a", "#c9ced3"];

/// Returns the background of pictures that name none.
pub fn default_background() -> Background {
    let [top, bottom] = GRADIENT.map(|color| to_linear(srgb_color(color).unwrap_or_default()));
    Background::Gradient { top, bottom }
}

impl Rule<Background> for BackgroundRule {
    fn read(&self, value: &Value, _: &Path) -> Result<Background, Invalid> {
        match value.as_str() {
            Some("transparent") => return Ok(Background::Transparent),
            Some("environment") => return Ok(Background::Environment),
            Some("gradient") => return Ok(default_background()),
            _ => {}
        }
        let texts = as_list(value);
        let colors: Option<Vec<Vec3>> =
            texts.iter().map(|color| color.as_str().and_then(srgb_color).map(to_linear)).collect();
        match colors.as_deref() {
            Some(&[plain]) => Ok(Background::Gradient { top: plain, bottom: plain }),
            Some(&[top, bottom]) => Ok(Background::Gradient { top, bottom }),
            _ => Err(expected(format_args!(
                "a colour as in #aabbcc or white, two colours (top, bottom), gradient, environment or transparent{}",
                nearest_colors(&texts)
            ))),
        }
    }

    fn write(&self, value: &Background) -> Value {
        match *value {
            Background::Transparent => json!("transparent"),
            Background::Environment => json!("environment"),
            Background::Gradient { top, bottom } => json!([hex(top), hex(bottom)]),
        }
    }
}

/// The source of colours of points: a column, a computed value, or one colour.
pub struct ColorSourceRule;

impl Rule<ColorSource> for ColorSourceRule {
    fn read(&self, value: &Value, _: &Path) -> Result<ColorSource, Invalid> {
        let text = value.as_str().unwrap_or_default().trim();
        match srgb_color(text) {
            Some(color) => Ok(ColorSource::Constant(color)),
            None if text == "height" => Ok(ColorSource::Elevation),
            None => text.parse().map_err(|_| {
                expected(format!(
                    "{}, the name of a column, #RRGGBB or a colour's CSS name",
                    ColorSource::names_where(|_| true).join(", ")
                ))
            }),
        }
    }

    fn write(&self, value: &ColorSource) -> Value {
        json!(value.to_string())
    }
}

/// A colour map by its matplotlib name.
pub struct ColormapRule;

impl Rule<Colormap> for ColormapRule {
    fn read(&self, value: &Value, _: &Path) -> Result<Colormap, Invalid> {
        Colormap::from_name(value.as_str().unwrap_or_default()).map_err(from_core)
    }

    fn write(&self, value: &Colormap) -> Value {
        json!(value.to_string())
    }
}

#[cfg(test)]
mod tests {
    //! Colours are read as people write them, nonsense is refused, and what is written reads back equal.

    use super::super::rule::tests_of_rules::{check, read};
    use super::*;

    #[test]
    fn colours_are_read_in_all_spellings() {
        assert_eq!(read(BackgroundRule, "transparent"), Ok(Background::Transparent));
        assert_eq!(read(BackgroundRule, "#fff"), read(BackgroundRule, "white,WHITE"));
        assert_eq!(read(Color, "tomato"), read(Color, "#ff6347"));
        assert_eq!(read(ColorSourceRule, "height"), Ok(ColorSource::Elevation));
        assert_eq!(read(ColorSourceRule, "red"), Ok(ColorSource::Constant([255, 0, 0])));
        assert_eq!(read(ColorSourceRule, "Redness"), Ok(ColorSource::Column("Redness".into())));
        check(Color, "#89abcd");
        check(BackgroundRule, "#123456,#fedcba");
        check(ColorSourceRule, "surface_variation");
    }

    #[test]
    fn an_unknown_colour_is_answered_with_the_nearest_name() {
        let error = read(BackgroundRule, "white,lightgrren").unwrap_err();
        assert!(error.ends_with("; the nearest known one is `lightgreen`"), "{error}");
        assert!(read(Color, "stelblue").unwrap_err().contains("`steelblue`"));
        assert!(!read(Color, "#12345").unwrap_err().contains("nearest"));
    }

    #[test]
    fn invalid_backgrounds_are_rejected() {
        for text in ["", "#12", "reddish", "#fff,#fff,#fff"] {
            assert!(read(BackgroundRule, text).is_err(), "{text}");
        }
    }
}

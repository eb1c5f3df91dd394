//! The legend: a row for each class, or a colour bar with ticks.

use super::canvas::{Area, Canvas, Ink, text_width};
use super::ticks::ticks;
use crate::crs::Unit;
use surfel_core::scene::color::Legend;

/// Height of a row in text heights.
const ROW: f32 = 1.5;
/// Height of a colour bar in text heights.
const BAR_HEIGHT: f32 = 12.0;
/// Width of a colour bar and of a class's swatch in text heights.
const SWATCH: f32 = 1.1;
/// Space between panel and content in text heights.
const PADDING: f32 = 0.6;

/// The content of a legend.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LegendBlock {
    /// The name and colour of each class or label.
    Classes(Vec<(String, [u8; 3])>),
    /// A colour bar.
    Bar {
        title: String,
        low: f64,
        high: f64,
        /// Colours in equal steps from `low` to `high`.
        colors: Vec<[u8; 3]>,
        ticks: Vec<(f64, String)>,
    },
}

impl LegendBlock {
    /// The block of a legend; `None` if there is nothing to explain. `unit` is that of the coordinates.
    pub fn new(legend: Legend, unit: Unit) -> Option<Self> {
        match legend {
            Legend::None => None,
            Legend::Classes(classes) => {
                let rows = classes.into_iter().map(|(class, name, color)| match name {
                    "reserved" | "user definable" => (format!("{name} ({class})"), color),
                    name => (name.to_owned(), color),
                });
                Some(Self::Classes(rows.collect()))
            }
            Legend::Labels { title, entries } => {
                let rows =
                    entries.into_iter().map(|(label, color)| (format!("{title} {label}"), color));
                Some(Self::Classes(rows.collect()))
            }
            Legend::Map { title, low, high, colors } => {
                let title = match unit {
                    Unit::Metres(_) if title == "elevation" => {
                        format!("elevation ({})", unit.symbol())
                    }
                    _ => title,
                };
                let ticks = ticks(low.min(high), low.max(high), 6);
                Some(Self::Bar { title, low, high, colors, ticks })
            }
        }
    }

    /// Returns width and height in pixels of a block in a picture of this height.
    pub fn size(&self, text_size: f32, picture_height: f32) -> [f32; 2] {
        let (width, height) = match self {
            Self::Classes(rows) => {
                let names = rows.iter().map(|(name, _)| text_width(name, text_size));
                let n_rows = rows.len().min(Self::max_rows(text_size, picture_height));
                let width = names.fold(0.0, f32::max) + (SWATCH + 0.5) * text_size;
                (width, ROW * n_rows as f32 * text_size)
            }
            Self::Bar { title, ticks, .. } => {
                let labels = ticks.iter().map(|(_, text)| text_width(text, text_size));
                let bar = (SWATCH + 0.8) * text_size + labels.fold(0.0, f32::max);
                (bar.max(text_width(title, text_size)), (BAR_HEIGHT + ROW) * text_size)
            }
        };
        [width, height].map(|length| length + 2.0 * PADDING * text_size)
    }

    /// Draws the block in `area`.
    pub fn draw(&self, canvas: &mut Canvas, area: Area, size: f32, ink: Ink) {
        let (x, y) = (area.x + PADDING * size, area.y + PADDING * size);
        match self {
            Self::Classes(rows) => {
                let n_rows = Self::max_rows(size, canvas.size()[1]);
                for (i, (name, color)) in rows.iter().take(n_rows).enumerate() {
                    let top = y + ROW * i as f32 * size;
                    let side = SWATCH * size;
                    let swatch = Area { x, y: top + 0.2 * size, width: side, height: side };
                    canvas.fill(swatch, Ink::opaque(*color));
                    canvas.write(name, x + (SWATCH + 0.5) * size, top + 1.1 * size, size, ink);
                }
            }
            Self::Bar { title, low, high, colors, ticks } => {
                canvas.write(title, x, y + 0.9 * size, size, ink);
                let bar = Area {
                    x,
                    y: y + (ROW + 0.2) * size,
                    width: SWATCH * size,
                    height: (BAR_HEIGHT - 0.4) * size,
                };
                draw_bar(canvas, bar, colors);
                for (value, text) in ticks {
                    let fraction = fraction_of(*value, *low, *high);
                    let at = bar.y + bar.height * (1.0 - fraction as f32);
                    let thickness = (0.08 * size).max(1.0);
                    let x = bar.x + bar.width;
                    let mark =
                        Area { x, y: at - 0.5 * thickness, width: 0.35 * size, height: thickness };
                    canvas.fill(mark, ink);
                    canvas.write(text, x + 0.6 * size, at + 0.36 * size, size, ink);
                }
            }
        }
    }

    /// Returns the number of classes that fit in a picture, beside margins.
    fn max_rows(text_size: f32, picture_height: f32) -> usize {
        ((picture_height / text_size - 2.0 - 2.0 * PADDING) / ROW).max(0.0) as usize
    }
}

/// Returns how far up a colour bar from `low` to `high`, which may be the lower one, a value lies: 0 to 1.
fn fraction_of(value: f64, low: f64, high: f64) -> f64 {
    if low == high { 0.5 } else { (value - low) / (high - low) }
}

/// Draws the colours from the bottom to the top.
fn draw_bar(canvas: &mut Canvas, bar: Area, colors: &[[u8; 3]]) {
    let Some(last) = colors.len().checked_sub(1) else { return };
    let (top, n_rows) = (bar.y.round(), bar.height.round() as usize);
    for row in 0..n_rows {
        let at = last as f32 * (1.0 - (row as f32 + 0.5) / n_rows as f32);
        let (below, weight) = (at as usize, at.fract());
        let above = colors[(below + 1).min(last)];
        let mix = |i: usize| {
            let (a, b) = (f32::from(colors[below][i]), f32::from(above[i]));
            ((1.0 - weight) * a + weight * b).round() as u8
        };
        let color = [mix(0), mix(1), mix(2)];
        let y = top + row as f32;
        canvas.fill(Area { y, height: 1.0, ..bar }, Ink::opaque(color));
    }
}

#[cfg(test)]
mod tests {
    //! Titles and ticks of colour bars.

    use super::*;

    #[test]
    fn a_reversed_range_has_the_ticks_of_the_range() {
        let ticks_of = |low: f64, high: f64| {
            let legend = Legend::Map { title: String::new(), low, high, colors: vec![[0; 3]; 2] };
            match LegendBlock::new(legend, Unit::Unknown) {
                Some(LegendBlock::Bar { ticks, .. }) => ticks,
                _ => Vec::new(),
            }
        };
        let (rising, falling) = (ticks_of(100.0, 900.0), ticks_of(900.0, 100.0));
        assert!(3 < rising.len() && rising == falling, "{rising:?} {falling:?}");
        assert_eq!([100.0, 300.0, 900.0].map(|x| fraction_of(x, 100.0, 900.0)), [0.0, 0.25, 1.0]);
        assert_eq!([100.0, 300.0, 900.0].map(|x| fraction_of(x, 900.0, 100.0)), [1.0, 0.75, 0.0]);
        assert_eq!(fraction_of(5.0, 5.0, 5.0), 0.5);
    }

    #[test]
    fn elevations_have_the_unit_of_the_coordinates_if_it_is_known() {
        let title = |name: &str, unit: Unit| {
            let (title, colors) = (name.to_owned(), vec![[0; 3], [255; 3]]);
            let legend = Legend::Map { title, low: 0.0, high: 9.0, colors };
            match LegendBlock::new(legend, unit) {
                Some(LegendBlock::Bar { title, .. }) => title,
                _ => String::new(),
            }
        };
        assert_eq!(title("elevation", Unit::Metres(1.0)), "elevation (m)");
        assert_eq!(title("elevation", Unit::Metres(0.3048)), "elevation (ft)");
        assert_eq!(title("elevation", Unit::Unknown), "elevation");
        assert_eq!(title("intensity", Unit::Metres(1.0)), "intensity");
    }
}

//! The legend: a row for each class, or a colour bar with ticks.

use super::canvas::{Area, Canvas, Ink, text_width};
use super::ticks::ticks;
use crate::crs::Unit;
use std::cmp::Reverse;
use surfel_core::scene::color::{Legend, LegendClass};

/// Height of a row in text heights.
const ROW: f32 = 1.5;
/// Height of a colour bar in text heights, where the picture is large enough.
const MAX_BAR_HEIGHT: f32 = 12.0;
/// Height below which a colour bar is left out, in text heights.
const MIN_BAR_HEIGHT: f32 = 3.0;
/// Mean distance of the ticks of a colour bar in text heights.
const TICK_DISTANCE: f32 = 1.9;
/// Maximum number of ticks, about.
const MAX_TICKS: usize = 6;
/// Width of a colour bar and of a class's swatch in text heights.
const SWATCH: f32 = 1.1;
/// Space between panel and content in text heights.
const PADDING: f32 = 0.6;

/// The content of a legend.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LegendBlock {
    /// A row for each class or label.
    Rows(Vec<LegendRow>),
    /// A colour bar.
    Bar {
        title: String,
        low: f64,
        high: f64,
        /// Colours in equal steps from `low` to `high`.
        colors: Vec<[u8; 3]>,
    },
}

/// A class or label.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LegendRow {
    name: String,
    color: [u8; 3],
    /// Number of its points; 0 where it is not known.
    n_points: u64,
}

impl LegendRow {
    fn of_class(row: LegendClass) -> Self {
        let LegendClass { class, name, color, n_points } = row;
        let name = match name {
            "reserved" | "user definable" => format!("{name} ({class})"),
            name => name.to_owned(),
        };
        Self { name, color, n_points }
    }
}

impl LegendBlock {
    /// The block of a legend; `None` if there is nothing to explain. `unit` is that of the coordinates.
    pub fn new(legend: Legend, unit: Unit) -> Option<Self> {
        match legend {
            Legend::None => None,
            Legend::Classes(classes) => {
                Some(Self::Rows(classes.into_iter().map(LegendRow::of_class).collect()))
            }
            Legend::Labels { title, entries } => {
                let row = |(label, color)| LegendRow {
                    name: format!("{title} {label}"),
                    color,
                    n_points: 0,
                };
                Some(Self::Rows(entries.into_iter().map(row).collect()))
            }
            Legend::Map { title, low, high, colors } => {
                let title = match unit {
                    Unit::Metres(_) if title == "elevation" => {
                        format!("elevation ({})", unit.symbol())
                    }
                    _ => title,
                };
                Some(Self::Bar { title, low, high, colors })
            }
        }
    }

    /// Returns width and height in pixels where `max_height` pixels are free; zero where nothing fits.
    pub fn size(&self, text_size: f32, max_height: f32) -> [f32; 2] {
        let free = max_height / text_size - 2.0 * PADDING;
        let (width, height) = match self {
            Self::Rows(all) => {
                let rows = rows(all, (free / ROW).max(0.0) as usize);
                let names = rows.iter().map(|(name, _)| text_width(name, text_size));
                let width = names.fold(0.0, f32::max) + (SWATCH + 0.5) * text_size;
                (width, ROW * rows.len() as f32)
            }
            Self::Bar { title, low, high, .. } => {
                let height = (free - ROW).min(MAX_BAR_HEIGHT);
                let ticks = bar_ticks(*low, *high, height);
                let labels = ticks.iter().map(|(_, text)| text_width(text, text_size));
                let bar = (SWATCH + 0.8) * text_size + labels.fold(0.0, f32::max);
                let height = if height < MIN_BAR_HEIGHT { 0.0 } else { height + ROW };
                (bar.max(text_width(title, text_size)), height)
            }
        };
        let is_there = 0.0 < height;
        let padded = [width, height * text_size].map(|length| length + 2.0 * PADDING * text_size);
        if is_there { padded } else { [0.0; 2] }
    }

    /// Draws the block in `area`, which has the size that [`size`](Self::size) returned.
    pub fn draw(&self, canvas: &mut Canvas, area: Area, size: f32, ink: Ink) {
        let (x, y) = (area.x + PADDING * size, area.y + PADDING * size);
        let height = area.height / size - 2.0 * PADDING;
        match self {
            Self::Rows(all) => {
                let rows = rows(all, (height / ROW).round() as usize);
                for (i, (name, color)) in rows.iter().enumerate() {
                    let top = y + ROW * i as f32 * size;
                    let side = SWATCH * size;
                    let swatch = Area { x, y: top + 0.2 * size, width: side, height: side };
                    if let Some(color) = color {
                        canvas.fill(swatch, Ink::opaque(*color));
                    }
                    canvas.write(name, x + (SWATCH + 0.5) * size, top + 1.1 * size, size, ink);
                }
            }
            Self::Bar { title, low, high, colors } => {
                canvas.write(title, x, y + 0.9 * size, size, ink);
                let bar = Area {
                    x,
                    y: y + (ROW + 0.2) * size,
                    width: SWATCH * size,
                    height: (height - ROW - 0.4) * size,
                };
                draw_bar(canvas, bar, colors);
                for (value, text) in bar_ticks(*low, *high, height - ROW) {
                    let fraction = fraction_of(value, *low, *high);
                    let at = bar.y + bar.height * (1.0 - fraction as f32);
                    let thickness = (0.08 * size).max(1.0);
                    let x = bar.x + bar.width;
                    let mark =
                        Area { x, y: at - 0.5 * thickness, width: 0.35 * size, height: thickness };
                    canvas.fill(mark, ink);
                    canvas.write(&text, x + 0.6 * size, at + 0.36 * size, size, ink);
                }
            }
        }
    }
}

/// Returns at most `n_rows` names with their colours, in the order of `all`. If there are more, these are the most frequent
/// ones, and the last row counts the others.
fn rows(all: &[LegendRow], n_rows: usize) -> Vec<(String, Option<[u8; 3]>)> {
    let n_named = if n_rows < all.len() { n_rows.saturating_sub(1) } else { all.len() };
    let mut by_frequency: Vec<usize> = (0..all.len()).collect();
    by_frequency.sort_by_key(|row| Reverse(all[*row].n_points));
    let mut named = by_frequency[..n_named].to_vec();
    named.sort_unstable();
    let names = named.into_iter().map(|row| (all[row].name.clone(), Some(all[row].color)));
    let n_others = all.len() - n_named;
    let others = (0 < n_others && 0 < n_rows).then(|| (format!("… {n_others} more"), None));
    names.chain(others).collect()
}

/// Returns the ticks of a colour bar as high as so many text heights, each with its text.
fn bar_ticks(low: f64, high: f64, height: f32) -> Vec<(f64, String)> {
    let n_ticks = (height / TICK_DISTANCE).max(1.0) as usize;
    let mut candidates = (n_ticks.min(MAX_TICKS)..=MAX_TICKS)
        .map(|n_ticks| ticks(low.min(high), low.max(high), n_ticks));
    candidates.find(|ticks| !ticks.is_empty()).unwrap_or_default()
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
    //! Titles and ticks of colour bars, and what small pictures show of a legend.

    use super::*;

    #[test]
    fn a_reversed_range_has_the_ticks_of_the_range() {
        let ticks_of = |low: f64, high: f64| bar_ticks(low, high, MAX_BAR_HEIGHT);
        let (rising, falling) = (ticks_of(100.0, 900.0), ticks_of(900.0, 100.0));
        assert!(3 < rising.len() && rising == falling, "{rising:?} {falling:?}");
        assert_eq!([100.0, 300.0, 900.0].map(|x| fraction_of(x, 100.0, 900.0)), [0.0, 0.25, 1.0]);
        assert_eq!([100.0, 300.0, 900.0].map(|x| fraction_of(x, 900.0, 100.0)), [1.0, 0.75, 0.0]);
        assert_eq!(fraction_of(5.0, 5.0, 5.0), 0.5);
    }

    #[test]
    fn the_most_frequent_classes_are_named_and_the_others_counted() {
        // Of the classes 0 to 39, the later ones have more points.
        let class = |class: u8| LegendClass::new(class, u64::from(class) + 1);
        let classes: Vec<LegendRow> = (0..40).map(class).map(LegendRow::of_class).collect();
        let names = |n_rows| -> Vec<String> {
            rows(&classes, n_rows).into_iter().map(|(name, _)| name).collect()
        };
        let expected = ["reserved (37)", "reserved (38)", "reserved (39)", "… 37 more"];
        assert_eq!(names(4), expected);
        assert_eq!((names(0).len(), names(1)), (0, vec!["… 40 more".to_owned()]));
        assert_eq!((names(40).len(), &*names(40)[2]), (40, "ground"));
        assert!(rows(&classes, 40).iter().all(|(_, color)| color.is_some()));
    }

    #[test]
    fn legends_fit_in_the_height_that_there_is() {
        let classes = (0..40).map(|class| LegendClass::new(class, 1)).collect();
        let (title, colors) = ("intensity".to_owned(), vec![[0; 3], [255; 3]]);
        let map = Legend::Map { title, low: 0.0, high: 1000.0, colors };
        for legend in [map, Legend::Classes(classes)] {
            let block = LegendBlock::new(legend, Unit::Unknown).unwrap();
            for max_height in [10.0, 20.0, 40.0, 60.0, 100.0, 128.0, 500.0] {
                let [width, height] = block.size(11.0, max_height);
                assert!(height <= max_height, "{block:?} {max_height}");
                assert_eq!(0.0 < height, 0.0 < width);
                assert!(0.0 < height || max_height < 65.0, "{block:?} {max_height}");
            }
        }
        assert_eq!(bar_ticks(0.0, 1000.0, 4.0).len(), 3);
        // None of the multiples of 20 is within the range.
        assert_eq!(bar_ticks(101.0, 115.5, 3.0)[0].1, "110");
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

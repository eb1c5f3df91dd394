//! The blocks of an overlay, each a panel in a corner with what stands on it.

use super::canvas::{Area, Canvas, Ink, text_width};
use super::legend_block::LegendBlock;

/// Opacity of the panel behind text.
const PANEL_OPACITY: f32 = 0.65;
/// Length of the north arrow in text heights.
const ARROW_LENGTH: f32 = 3.0;

/// A corner of a picture: whether it is at the right, and whether it is at the bottom.
pub(super) type Corner = (bool, bool);

/// A block at its place in the picture.
pub(super) struct Block<'a> {
    pub corner: Corner,
    pub area: Area,
    /// Height of the text in pixels.
    text_size: f32,
    content: Content<'a>,
}

/// The content of a panel.
pub(super) enum Content<'a> {
    /// A line of text.
    Caption(String),
    /// A bar of `length` pixels with its length in the world.
    ScaleBar { text: String, length: f32 },
    /// An arrow in a direction, to the right and down.
    North([f32; 2]),
    /// The meaning of the colours.
    Legend(&'a LegendBlock),
}

/// The space for blocks in the corners of a picture, in pixels.
pub(super) struct Layout {
    /// Width and height of the picture.
    pub picture: [f32; 2],
    /// Height of the text, and distance of blocks from the edges.
    pub text_size: f32,
    /// Height of a caption that takes the whole lower edge.
    pub lift: f32,
}

/// Choices made from the picture: where the legend stands, and which panels are light. Kept from one picture to the
/// next, nothing jumps while the camera moves.
#[derive(Clone, Debug, Default)]
pub struct Style {
    pub(super) legend_corner: Option<Corner>,
    /// For each corner, whether its panel is light.
    is_light: [[Option<bool>; 2]; 2],
}

impl<'a> Block<'a> {
    /// Places a block in a corner.
    pub fn new(content: Content<'a>, corner: Corner, layout: &Layout) -> Self {
        let text_size = layout.text_size;
        let height = layout.picture[1] - 2.0 * text_size - layout.lift;
        let area = layout.area(corner, content.size(text_size, height));
        Self { corner, area, text_size, content }
    }

    /// Draws the block.
    pub fn draw(&self, canvas: &mut Canvas, style: &mut Style) {
        let Self { corner, area, text_size: size, ref content } = *self;
        let (is_right, is_bottom) = corner;
        let is_light = &mut style.is_light[usize::from(is_right)][usize::from(is_bottom)];
        // 0.18 is the middle grey of sRGB.
        let is_light = *is_light.get_or_insert_with(|| 0.18 < canvas.luminance(area));
        let ink = draw_panel(canvas, area, is_light);
        match content {
            Content::Caption(text) => {
                canvas.write(text, area.x + 0.5 * size, area.y + 1.1 * size, size, ink);
            }
            Content::ScaleBar { text, length } => {
                draw_scale_bar(canvas, area, size, text, *length, ink);
            }
            Content::North(direction) => draw_north(canvas, area, size, *direction, ink),
            Content::Legend(legend) => legend.draw(canvas, area, size, ink),
        }
    }
}

impl Content<'_> {
    /// Returns width and height in pixels where this height is free.
    fn size(&self, text_size: f32, max_height: f32) -> [f32; 2] {
        match self {
            Self::Caption(text) => [text_width(text, text_size) + text_size, 1.6 * text_size],
            Self::ScaleBar { text, length } => {
                [length.max(text_width(text, text_size)) + text_size, 2.4 * text_size]
            }
            Self::North(_) => [(ARROW_LENGTH + 2.0) * text_size; 2],
            Self::Legend(legend) => legend.size(text_size, max_height),
        }
    }
}

impl Layout {
    /// Returns where a block of this size lies in a corner.
    fn area(&self, (is_right, is_bottom): Corner, [width, height]: [f32; 2]) -> Area {
        let margin = self.text_size;
        let x = if is_right { self.picture[0] - width - margin } else { margin };
        let bottom = self.picture[1] - height - margin - self.lift;
        let y = if is_bottom { bottom.max(margin) } else { margin };
        Area { x, y, width, height }
    }
}

/// Draws a light or a dark panel, and returns the ink that is read on it.
fn draw_panel(canvas: &mut Canvas, area: Area, is_light: bool) -> Ink {
    let (paper, ink) = if is_light { ([255; 3], [20; 3]) } else { ([10; 3], [245; 3]) };
    canvas.fill(area, Ink { color: paper, opacity: PANEL_OPACITY });
    Ink::opaque(ink)
}

/// Draws a bar below its length.
fn draw_scale_bar(canvas: &mut Canvas, area: Area, size: f32, text: &str, length: f32, ink: Ink) {
    let middle = area.x + 0.5 * area.width;
    canvas.write(text, middle - 0.5 * text_width(text, size), area.y + 1.1 * size, size, ink);
    let (left, thickness) = (middle - 0.5 * length, (0.14 * size).max(1.0));
    let y = area.y + 1.75 * size;
    canvas.fill(Area { x: left, y, width: length, height: thickness }, ink);
    for end in [left, left + length - thickness] {
        let height = 0.5 * size;
        let y = y + 0.5 * (thickness - height);
        canvas.fill(Area { x: end, y, width: thickness, height }, ink);
    }
}

/// Draws an arrow with the letter N at its tip.
fn draw_north(canvas: &mut Canvas, area: Area, size: f32, [dx, dy]: [f32; 2], ink: Ink) {
    let middle = [area.x + 0.5 * area.width, area.y + 0.5 * area.height];
    let at = |along: f32, aside: f32| {
        [middle[0] + size * (along * dx - aside * dy), middle[1] + size * (along * dy + aside * dx)]
    };
    let (tip, tail) = (0.5 * ARROW_LENGTH - 0.5, -0.5 * ARROW_LENGTH);
    for aside in [-0.7, 0.7] {
        canvas.fill_triangle([at(tip, 0.0), at(tail, aside), at(tail + 0.5, 0.0)], ink);
    }
    let letter = at(tip + 0.75, 0.0);
    let half_width = 0.5 * text_width("N", size);
    canvas.write("N", letter[0] - half_width, letter[1] + 0.36 * size, size, ink);
}

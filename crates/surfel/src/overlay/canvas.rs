//! Draws rectangles, lines and text onto a picture, in linear light.

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};
use std::ops::Range;
use std::sync::LazyLock;
use surfel_core::image::{Image, decode_srgb8};

static FONT: LazyLock<FontRef> = LazyLock::new(|| {
    FontRef::try_from_slice(dejavu::sans::regular()).expect("the font is part of the program")
});

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    /// Left edge.
    pub x: f32,
    /// Upper edge.
    pub y: f32,
    /// Width.
    pub width: f32,
    /// Height.
    pub height: f32,
}

/// An sRGB-encoded colour and its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ink {
    /// Colour.
    pub color: [u8; 3],
    /// Opacity from 0 to 1.
    pub opacity: f32,
}

/// A picture, or a part of one, that is drawn on.
pub(super) struct Canvas<'a> {
    image: &'a mut Image,
    /// The corner of the image at the upper left in the picture.
    origin: [f32; 2],
    /// Width and height of the picture.
    size: [f32; 2],
}

impl Area {
    /// Returns the columns and rows of the pixels that lie within a picture of this size.
    pub fn pixels(&self, (width, height): (u32, u32)) -> (Range<u32>, Range<u32>) {
        let columns = pixels(self.x, self.x + self.width, width);
        (columns, pixels(self.y, self.y + self.height, height))
    }
}

impl Ink {
    /// An opaque colour.
    pub fn opaque(color: [u8; 3]) -> Self {
        Self { color, opacity: 1.0 }
    }
}

impl<'a> Canvas<'a> {
    /// A canvas on `image`.
    pub fn new(image: &'a mut Image) -> Self {
        let size = [image.width as f32, image.height as f32];
        Self { image, origin: [0.0; 2], size }
    }

    /// A canvas on the part of a picture of `size` that begins at `origin`. Positions are those in the picture.
    pub fn of_part(image: &'a mut Image, origin: [f32; 2], size: [f32; 2]) -> Self {
        Self { image, origin, size }
    }

    /// Returns width and height of the picture in pixels.
    pub fn size(&self) -> [f32; 2] {
        self.size
    }

    /// Fills a rectangle; its edges are antialiased.
    pub fn fill(&mut self, area: Area, ink: Ink) {
        let area = self.local(area);
        let (right, bottom) = (area.x + area.width, area.y + area.height);
        let overlap = |pixel: u32, low: f32, high: f32| {
            (high.min(pixel as f32 + 1.0) - low.max(pixel as f32)).max(0.0)
        };
        let (columns, rows) = area.pixels((self.image.width, self.image.height));
        for y in rows {
            for x in columns.clone() {
                let coverage = overlap(x, area.x, right) * overlap(y, area.y, bottom);
                self.blend(x, y, ink, coverage);
            }
        }
    }

    /// Fills the triangle of three corners; its edges are antialiased by 16 samples a pixel.
    pub fn fill_triangle(&mut self, corners: [[f32; 2]; 3], ink: Ink) {
        const N: u32 = 4;
        let [left, top] = self.origin;
        let corners = corners.map(|[x, y]| [x - left, y - top]);
        let [a, b, c] = corners;
        let side = |a: [f32; 2], b: [f32; 2], p: [f32; 2]| {
            (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
        };
        let is_inside = |p: [f32; 2]| {
            let sides = [side(a, b, p), side(b, c, p), side(c, a, p)];
            sides.iter().all(|s| 0.0 <= *s) || sides.iter().all(|s| *s <= 0.0)
        };
        let bounds = |axis: usize| {
            let values = corners.map(|corner| corner[axis]);
            (
                values.iter().copied().fold(f32::MAX, f32::min),
                values.iter().copied().fold(f32::MIN, f32::max),
            )
        };
        let ((left, right), (top, bottom)) = (bounds(0), bounds(1));
        let [width, height] = [self.image.width, self.image.height];
        for y in pixels(top, bottom, height) {
            for x in pixels(left, right, width) {
                let at = |pixel: u32, i: u32| pixel as f32 + (i as f32 + 0.5) / N as f32;
                let samples = (0..N * N).filter(|i| is_inside([at(x, i % N), at(y, i / N)]));
                let coverage = samples.count() as f32 / (N * N) as f32;
                self.blend(x, y, ink, coverage);
            }
        }
    }

    /// Writes a line of text whose capitals stand on `baseline`.
    pub fn write(&mut self, text: &str, x: f32, baseline: f32, size: f32, ink: Ink) {
        let [left, top] = self.origin;
        let (width, height) = (self.image.width as f32, self.image.height as f32);
        for glyph in glyphs(text, size, x - left, baseline - top) {
            let Some(outline) = FONT.outline_glyph(glyph) else { continue };
            let bounds = outline.px_bounds();
            outline.draw(|column, row, coverage| {
                let (x, y) = (bounds.min.x + column as f32, bounds.min.y + row as f32);
                if 0.0 <= x && 0.0 <= y && x < width && y < height {
                    self.blend(x as u32, y as u32, ink, coverage.min(1.0));
                }
            });
        }
    }

    /// Returns the fraction of an area that a surface covers.
    pub fn coverage(&self, area: Area) -> f32 {
        coverage(self.image, self.local(area))
    }

    /// Returns the mean luminance of an area, up to 1 a pixel; transparent pixels count as white.
    pub fn luminance(&self, area: Area) -> f32 {
        mean(self.image, self.local(area), |i| {
            let [r, g, b, a] = self.image.color[i];
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            (luminance + 1.0 - a).clamp(0.0, 1.0)
        })
    }

    fn local(&self, area: Area) -> Area {
        Area { x: area.x - self.origin[0], y: area.y - self.origin[1], ..area }
    }

    fn blend(&mut self, x: u32, y: u32, ink: Ink, coverage: f32) {
        let pixel = &mut self.image.color[y as usize * self.image.width as usize + x as usize];
        let opacity = ink.opacity * coverage;
        let color = ink.color.map(decode_srgb8);
        for (channel, new) in pixel.iter_mut().zip([color[0], color[1], color[2], 1.0]) {
            // A light beyond white would shine through.
            *channel = channel.min(1.0) * (1.0 - opacity) + new * opacity;
        }
    }
}

/// Returns the fraction of an area of an image that a surface covers.
pub(super) fn coverage(image: &Image, area: Area) -> f32 {
    mean(image, area, |i| image.coverage[i])
}

/// Returns the mean of a value over the pixels of an area.
fn mean(image: &Image, area: Area, value: impl Fn(usize) -> f32) -> f32 {
    let (columns, rows) = area.pixels((image.width, image.height));
    let (mut sum, mut n) = (0.0f64, 0usize);
    for y in rows {
        for x in columns.clone() {
            sum += f64::from(value(y as usize * image.width as usize + x as usize));
            n += 1;
        }
    }
    (sum / n.max(1) as f64) as f32
}

/// Returns the width of a line of text in pixels.
pub(super) fn text_width(text: &str, size: f32) -> f32 {
    let font = FONT.as_scaled(PxScale::from(size));
    glyphs(text, size, 0.0, 0.0)
        .last()
        .map_or(0.0, |last| last.position.x + font.h_advance(last.id))
}

/// More characters than fit in any picture.
const MAX_CHARACTERS: usize = 10_000;

/// Returns the start of a text that fits in `width` pixels, with an ellipsis if it is cut.
pub(super) fn cut_to_width(text: &str, size: f32, width: f32) -> String {
    let characters: Vec<char> = text.chars().take(MAX_CHARACTERS).collect();
    if characters.len() < MAX_CHARACTERS && text_width(text, size) <= width {
        return text.to_owned();
    }
    let cut = |n: usize| characters[..n].iter().collect::<String>().trim_end().to_owned() + "…";
    let lengths: Vec<usize> = (1..characters.len()).collect();
    match lengths.partition_point(|n| text_width(&cut(*n), size) <= width) {
        0 => String::new(),
        n => cut(n),
    }
}

/// Returns the glyphs of a line of text. Characters that the font lacks become its box.
fn glyphs(text: &str, size: f32, x: f32, baseline: f32) -> Vec<Glyph> {
    let font = FONT.as_scaled(PxScale::from(size));
    let mut at = x;
    let mut previous = None;
    let mut glyphs = Vec::new();
    for character in text.chars().filter(|character| !character.is_control()) {
        let id = font.glyph_id(character);
        at += previous.map_or(0.0, |previous| font.kern(previous, id));
        glyphs.push(id.with_scale_and_position(size, point(at, baseline)));
        at += font.h_advance(id);
        previous = Some(id);
    }
    glyphs
}

/// Returns the pixels from `low` to `high` that lie within a picture of `n` pixels.
fn pixels(low: f32, high: f32, n: u32) -> Range<u32> {
    let end = (high.ceil().max(0.0) as u32).min(n);
    (low.floor().max(0.0) as u32).min(end)..end
}

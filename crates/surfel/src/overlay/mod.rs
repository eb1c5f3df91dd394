//! Overlays: legend, scale bar, north arrow and caption, drawn onto the finished picture.

mod canvas;
mod ticks;
mod legend_block;

use canvas::{Area, Canvas, Ink, cut_to_width, text_width};
use legend_block::LegendBlock;
use ticks::round_step;

use crate::crs::Unit;
use crate::description::{Invalid, PictureSettings};
use surfel_core::image::Image;
use surfel_core::math::Vec3;
use surfel_core::progress::Progress;
use surfel_core::scene::color::Legend;
use surfel_core::scene::{Camera, Projection, north};

/// The legend, scale bar, north arrow and caption of a picture.
#[derive(Clone, Debug, Default)]
pub struct Overlay {
    legend: Option<LegendBlock>,
    caption: Option<String>,
    has_scale_bar: bool,
    /// Unit of the coordinates.
    unit: Unit,
    /// Direction of north if an arrow shows it.
    north: Option<Vec3>,
    /// True if the legend stays in its corner, as in movies.
    pub(crate) is_fixed: bool,
}

/// A corner of a picture: whether it is at the right, and whether it is at the bottom.
type Corner = (bool, bool);

/// Corners in the order in which the legend takes them if they are equally free.
const CORNERS: [Corner; 4] = [(true, true), (true, false), (false, false), (false, true)];

/// Lines of text that fit in the height of a picture.
const LINES_PER_PICTURE: f32 = 45.0;
/// Height of the smallest readable text in pixels.
const MIN_TEXT_SIZE: f32 = 11.0;
/// Opacity of the panel behind text.
const PANEL_OPACITY: f32 = 0.65;
/// Length of the north arrow in text heights.
const ARROW_LENGTH: f32 = 3.0;

impl Overlay {
    /// The overlay that settings ask for. `camera` is the one of the first picture; `up` and `unit` are those of the
    /// coordinates.
    ///
    /// # Errors
    ///
    /// Fails if a scale bar or a north arrow is asked of a camera that is not orthographic, and if north is along the
    /// view.
    pub fn new(
        picture: &PictureSettings,
        legend: Legend,
        camera: &Camera,
        (up, unit): (Vec3, Unit),
        progress: &dyn Progress,
    ) -> Result<Self, Invalid> {
        let is_orthographic = matches!(camera.projection, Projection::Orthographic { .. });
        let needs_scale =
            [("picture.scale_bar", picture.scale_bar()), ("picture.north", picture.north())];
        if let Some((key, _)) = needs_scale.iter().find(|(_, asked)| *asked && !is_orthographic) {
            let advice = "needs a camera without perspective: add --camera-orthographic";
            return Err(Invalid::at(*key, advice));
        }
        let legend = LegendBlock::new(legend).filter(|_| picture.legend());
        if picture.legend() && legend.is_none() {
            progress.note("no legend: the colours are the points' own, or one for all");
        }
        let north = picture.north().then(|| north(up));
        if north.is_some_and(|north| arrow(camera, north).is_none()) {
            let advice = "north is along the view; look down, as with --camera-direction 0,0,-1";
            return Err(Invalid::at("picture.north", advice));
        }
        Ok(Self {
            legend,
            caption: picture.caption.clone(),
            has_scale_bar: picture.scale_bar(),
            unit,
            north,
            is_fixed: false,
        })
    }

    /// Draws onto the picture that `camera` shows.
    pub fn draw(&self, image: &mut Image, camera: &Camera) {
        let mut canvas = Canvas::new(image);
        let [width, height] = canvas.size();
        let size = (height / LINES_PER_PICTURE).max(MIN_TEXT_SIZE);
        if width < 4.0 * size || height < 4.0 * size {
            return;
        }
        let mut taken: Vec<Corner> = Vec::new();
        let mut layout = Layout { picture: canvas.size(), margin: size, lift: 0.0 };
        if let Some(caption) = &self.caption {
            let text = cut_to_width(caption, size, width - 4.0 * size);
            let area = draw_text(&mut canvas, &text, size, &layout);
            taken.push((false, true));
            if 0.5 * width < area.width {
                layout.lift = area.height + 0.5 * size;
            }
        }
        if let (true, Projection::Orthographic { height: shown }) =
            (self.has_scale_bar, camera.projection)
        {
            draw_scale_bar(&mut canvas, size, f64::from(height) / shown, self.unit, &layout);
            taken.push((true, true));
        }
        if let Some(direction) = self.north.and_then(|north| arrow(camera, north)) {
            draw_north(&mut canvas, size, direction, &layout);
            taken.push((true, false));
        }
        if let Some(legend) = &self.legend {
            let block = legend.size(size, height);
            let free = CORNERS.into_iter().filter(|corner| !taken.contains(corner));
            let areas = free.map(|corner| layout.area(corner, block));
            let coverage = |area: &Area| if self.is_fixed { 0.0 } else { canvas.coverage(*area) };
            let best = areas.min_by(|a, b| coverage(a).total_cmp(&coverage(b)));
            if let Some(area) = best {
                let ink = panel(&mut canvas, area);
                legend.draw(&mut canvas, area, size, ink);
            }
        }
    }
}

/// Returns the direction of north in the picture, to the right and down; `None` if it is almost along the view.
fn arrow(camera: &Camera, north: Vec3) -> Option<[f32; 2]> {
    let [right, up, _] = camera.axes();
    let north = north.as_dvec3();
    let direction = [right.dot(north) as f32, -up.dot(north) as f32];
    let length = direction[0].hypot(direction[1]);
    (0.2 < length).then(|| direction.map(|component| component / length))
}

/// The space for blocks in the corners of a picture, in pixels.
struct Layout {
    /// Width and height of the picture.
    picture: [f32; 2],
    /// Distance of blocks from the edges.
    margin: f32,
    /// Height of a caption that takes the whole lower edge.
    lift: f32,
}

impl Layout {
    /// Returns where a block of this size lies in a corner.
    fn area(&self, (is_right, is_bottom): Corner, [width, height]: [f32; 2]) -> Area {
        let x = if is_right { self.picture[0] - width - self.margin } else { self.margin };
        let bottom = self.picture[1] - height - self.margin - self.lift;
        let y = if is_bottom { bottom.max(self.margin) } else { self.margin };
        Area { x, y, width, height }
    }
}

/// Draws a panel that is light on light ground and dark on dark ground, and returns the ink that is read on it.
fn panel(canvas: &mut Canvas, area: Area) -> Ink {
    // 0.18 is the middle grey of sRGB.
    let is_light = 0.18 < canvas.luminance(area);
    let (paper, ink) = if is_light { ([255; 3], [20; 3]) } else { ([10; 3], [245; 3]) };
    canvas.fill(area, Ink { color: paper, opacity: PANEL_OPACITY });
    Ink::opaque(ink)
}

/// Draws a line of text at the lower left, and returns the area that it takes.
fn draw_text(canvas: &mut Canvas, text: &str, size: f32, layout: &Layout) -> Area {
    let block = [text_width(text, size) + size, 1.6 * size];
    let area = layout.area((false, true), block);
    let ink = panel(canvas, area);
    canvas.write(text, area.x + 0.5 * size, area.y + 1.1 * size, size, ink);
    area
}

/// Draws a bar of a round length, about a fifth of the picture's width, at the lower right.
fn draw_scale_bar(
    canvas: &mut Canvas,
    size: f32,
    pixels_per_unit: f64,
    unit: Unit,
    layout: &Layout,
) {
    let [width, _] = canvas.size();
    let length = round_step(f64::from(width) / 4.0 / pixels_per_unit);
    if !length.is_finite() {
        return;
    }
    let text = length_text(length, unit);
    let bar = (length * pixels_per_unit) as f32;
    let block = [bar.max(text_width(&text, size)) + size, 2.4 * size];
    let area = layout.area((true, true), block);
    let ink = panel(canvas, area);
    let middle = area.x + 0.5 * area.width;
    canvas.write(&text, middle - 0.5 * text_width(&text, size), area.y + 1.1 * size, size, ink);
    let (left, thickness) = (middle - 0.5 * bar, (0.14 * size).max(1.0));
    let y = area.y + 1.75 * size;
    canvas.fill(Area { x: left, y, width: bar, height: thickness }, ink);
    for end in [left, left + bar - thickness] {
        let height = 0.5 * size;
        canvas.fill(
            Area { x: end, y: y + 0.5 * (thickness - height), width: thickness, height },
            ink,
        );
    }
}

/// Writes a length of the coordinates with its unit. Coordinates without a known unit are taken as metres.
fn length_text(length: f64, unit: Unit) -> String {
    match unit.symbol() {
        "m" if (0.001..1.0).contains(&length) => format!("{} mm", (1000.0 * length).round()),
        "m" if 1000.0 <= length => format!("{} km", length / 1000.0),
        "°" => format!("{length}°"),
        symbol => format!("{length} {symbol}"),
    }
}

/// Draws an arrow in a direction, to the right and down, at the upper right.
fn draw_north(canvas: &mut Canvas, size: f32, [dx, dy]: [f32; 2], layout: &Layout) {
    let block = [(ARROW_LENGTH + 2.0) * size; 2];
    let area = layout.area((true, false), block);
    let ink = panel(canvas, area);
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

#[cfg(test)]
mod tests {
    //! Lengths, directions and places of what is drawn.

    use super::*;
    use surfel_core::math::DVec3;
    use surfel_core::progress::NoProgress;

    fn plan(height: f64) -> Camera {
        Camera {
            position: DVec3::new(0.0, 0.0, 10.0),
            focal_point: DVec3::ZERO,
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height },
        }
    }

    fn overlay(picture: &PictureSettings, legend: Legend) -> Overlay {
        Overlay::new(picture, legend, &plan(50.0), (Vec3::Z, Unit::Unknown), &NoProgress).unwrap()
    }

    fn everything() -> (PictureSettings, Legend) {
        let picture = PictureSettings {
            legend: Some(true),
            scale_bar: Some(true),
            north: Some(true),
            caption: Some("Grüße \u{1F600} 漢".into()),
            ..PictureSettings::default()
        };
        let (low, high) = (3.7, 1250.0);
        let colors = vec![[0; 3], [255; 3]];
        (picture, Legend::Map { title: "elevation".into(), low, high, colors })
    }

    /// Returns the first and last column of pixels in a row that are darker than middle grey.
    fn dark_columns(image: &Image, y: u32) -> Option<(u32, u32)> {
        let is_dark = |x: &u32| image.color[(y * image.width + x) as usize][1] < 0.1;
        let dark: Vec<u32> = (0..image.width).filter(is_dark).collect();
        Some((*dark.first()?, *dark.last()?))
    }

    #[test]
    fn the_scale_bar_has_the_length_that_it_says() {
        // 500 pixels show 50 m, so a bar of 10 m is 100 pixels long.
        let picture = PictureSettings { scale_bar: Some(true), ..PictureSettings::default() };
        let mut image = Image::new(600, 500);
        image.color.fill([1.0; 4]);
        overlay(&picture, Legend::None).draw(&mut image, &plan(50.0));
        let rows = (0..image.height).filter_map(|y| dark_columns(&image, y));
        let longest = rows.map(|(first, last)| last - first + 1).max().unwrap();
        assert!((99..=101).contains(&longest), "{longest}");
    }

    #[test]
    fn lengths_have_the_unit_of_the_coordinates() {
        let texts =
            [Unit::Unknown, Unit::Metres(1.0), Unit::Metres(1200.0 / 3937.0), Unit::Degrees];
        let texts = texts.map(|unit| length_text(0.5, unit));
        assert_eq!(texts, ["500 mm", "500 mm", "0.5 ft", "0.5°"]);
        assert_eq!(length_text(2000.0, Unit::Metres(1.0)), "2 km");
        assert_eq!(length_text(2000.0, Unit::Metres(0.3048)), "2000 ft");
    }

    #[test]
    fn the_arrow_points_north() {
        let turned = Camera { view_up: DVec3::X, ..plan(50.0) };
        let [dx, dy] = arrow(&plan(50.0), Vec3::Y).unwrap();
        assert!(dx.abs() < 1e-6 && dy < -0.999);
        // With the east upward, north is at the left.
        let [dx, dy] = arrow(&turned, Vec3::Y).unwrap();
        assert!(dx < -0.999 && dy.abs() < 1e-6);
        let along =
            Camera { position: DVec3::new(0.0, -10.0, 0.0), view_up: DVec3::Z, ..plan(50.0) };
        assert_eq!(arrow(&along, Vec3::Y), None);
    }

    #[test]
    fn the_legend_takes_the_freest_corner() {
        let picture = PictureSettings { legend: Some(true), ..PictureSettings::default() };
        let legend = Legend::Classes(vec![(2, "ground", [200, 0, 0])]);
        let mut image = Image::new(400, 300);
        image.coverage.fill(1.0);
        for y in 0..150 {
            image.coverage[y * 400..][..200].fill(0.0);
        }
        overlay(&picture, legend.clone()).draw(&mut image, &plan(50.0));
        let red = |i: &usize| 0.5 < image.color[*i][0] && image.color[*i][1] < 0.1;
        let place = (0..image.color.len()).find(red).unwrap();
        assert!(place % 400 < 200 && place / 400 < 150, "{place}");
        assert_eq!(overlay(&PictureSettings::default(), legend).legend, None);
    }

    #[test]
    fn pictures_of_any_size_are_drawn_on_and_are_the_same_twice() {
        let (picture, legend) = everything();
        let overlay = overlay(&picture, legend);
        for size in [(1, 1), (16, 9), (60, 44), (320, 180), (100, 2000), (640, 360)] {
            let draw = || {
                let mut image = Image::new(size.0, size.1);
                overlay.draw(&mut image, &plan(50.0));
                image
            };
            assert_eq!(draw(), draw(), "{size:?}");
        }
        assert!(cut_to_width("a long line of text", 20.0, 100.0).ends_with('…'));
    }

    #[test]
    fn cameras_with_perspective_have_no_scale() {
        let camera =
            Camera { projection: Projection::Perspective { view_angle_deg: 35.0 }, ..plan(1.0) };
        let (picture, legend) = everything();
        let error = Overlay::new(&picture, legend, &camera, (Vec3::Z, Unit::Unknown), &NoProgress)
            .unwrap_err();
        assert!(error.to_string().contains("--camera-orthographic"), "{error}");
    }
}

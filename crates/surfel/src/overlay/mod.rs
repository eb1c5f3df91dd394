//! Overlays: legend, scale bar, north arrow and caption, drawn onto the finished picture.

mod canvas;
mod ticks;
mod legend_block;
mod block;
mod enlarged;

pub use block::Style;
pub use enlarged::Patch;

use block::{Block, Content, Corner, Layout};
use canvas::{Area, Canvas, cut_to_width};
use enlarged::Enlarged;
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

/// Corners in the order in which the legend takes them if they are equally free.
const CORNERS: [Corner; 4] = [(true, true), (true, false), (false, false), (false, true)];
const CAPTION_CORNER: Corner = (false, true);
const SCALE_BAR_CORNER: Corner = (true, true);
const NORTH_CORNER: Corner = (true, false);

/// Lines of text that fit in the height of a picture.
const LINES_PER_PICTURE: f32 = 45.0;
/// Height of the smallest readable text in pixels.
const MIN_TEXT_SIZE: f32 = 11.0;

impl Overlay {
    /// The overlay that settings ask for. `up` and `unit` are those of the coordinates.
    pub fn new(
        picture: &PictureSettings,
        legend: Legend,
        (up, unit): (Vec3, Unit),
        progress: &dyn Progress,
    ) -> Self {
        let overlay = Self::of(picture, legend, (up, unit));
        if picture.legend() && overlay.legend.is_none() {
            progress.note("no legend: the colours are the points' own, or one for all");
        }
        overlay
    }

    /// The overlay that settings ask for, for cameras that may change: pictures lack what their camera does not allow.
    pub fn of(picture: &PictureSettings, legend: Legend, (up, unit): (Vec3, Unit)) -> Self {
        Self {
            legend: LegendBlock::new(legend, unit).filter(|_| picture.legend()),
            caption: picture.caption.clone(),
            has_scale_bar: picture.scale_bar(),
            unit,
            north: picture.north().then(|| north(up)),
            is_fixed: false,
        }
    }

    /// Returns true if there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        let has_text = self.legend.is_some() || self.caption.is_some();
        !has_text && !self.has_scale_bar && self.north.is_none()
    }

    /// Draws onto the picture that `camera` shows.
    pub fn draw(&self, image: &mut Image, camera: &Camera) {
        self.draw_in_style(image, camera, &mut Style::default());
    }

    /// Draws onto the picture that `camera` shows. What `style` leaves open is chosen from the picture.
    pub fn draw_in_style(&self, image: &mut Image, camera: &Camera, style: &mut Style) {
        let mut canvas = Canvas::new(image);
        let blocks = self.blocks(canvas.size(), camera, style, &|area| canvas.coverage(area));
        blocks.iter().for_each(|block| block.draw(&mut canvas, style));
    }

    /// Returns the parts of the picture of `size` that are drawn on, over a smaller `draft` that is enlarged. What
    /// `style` leaves open is chosen from the draft.
    pub fn patches(
        &self,
        draft: &Image,
        size: (u32, u32),
        camera: &Camera,
        style: &mut Style,
    ) -> Vec<Patch> {
        let enlarged = Enlarged { draft, size };
        let size = [size.0 as f32, size.1 as f32];
        let blocks = self.blocks(size, camera, style, &|area| enlarged.coverage(area));
        let patches = blocks.iter().map(|block| {
            let mut patch = enlarged.patch(block.area);
            let origin = [patch.x as f32, patch.y as f32];
            block.draw(&mut Canvas::of_part(&mut patch.image, origin, size), style);
            patch
        });
        patches.collect()
    }

    /// Places everything in a picture. `coverage` tells how much of an area is not free.
    fn blocks(
        &self,
        picture: [f32; 2],
        camera: &Camera,
        style: &mut Style,
        coverage: &dyn Fn(Area) -> f32,
    ) -> Vec<Block<'_>> {
        let [width, height] = picture;
        let size = (height / LINES_PER_PICTURE).max(MIN_TEXT_SIZE);
        if width < 4.0 * size || height < 4.0 * size {
            return Vec::new();
        }
        let mut layout = Layout { picture, text_size: size, lift: 0.0 };
        let mut blocks: Vec<Block> = Vec::new();
        if let Some(caption) = &self.caption {
            let content = Content::Caption(cut_to_width(caption, size, width - 4.0 * size));
            let block = Block::new(content, CAPTION_CORNER, &layout);
            if 0.5 * width < block.area.width {
                layout.lift = block.area.height + 0.5 * size;
            }
            blocks.push(block);
        }
        if let Some(bar) = self.scale_bar(picture, camera) {
            blocks.push(Block::new(bar, SCALE_BAR_CORNER, &layout));
        }
        if let Some(direction) = self.north.and_then(|north| arrow(camera, north)) {
            blocks.push(Block::new(Content::North(direction), NORTH_CORNER, &layout));
        }
        if let Some(legend) = &self.legend {
            let is_free = |corner: &Corner| blocks.iter().all(|block| block.corner != *corner);
            let free = CORNERS.into_iter().filter(is_free);
            let candidates = free
                .map(|corner| Block::new(Content::Legend(legend), corner, &layout))
                .filter(|block| 0.0 < block.area.height);
            let covered = |block: &Block| match (style.legend_corner, self.is_fixed) {
                (Some(kept), _) => f32::from(u8::from(block.corner != kept)),
                (None, true) => 0.0,
                (None, false) => coverage(block.area),
            };
            let best = candidates.min_by(|a, b| covered(a).total_cmp(&covered(b)));
            style.legend_corner = best.as_ref().map(|block| block.corner);
            blocks.extend(best);
        }
        blocks
    }

    /// Returns a bar of a round length, about a fifth of the picture's width.
    fn scale_bar(&self, [width, height]: [f32; 2], camera: &Camera) -> Option<Content<'_>> {
        let Projection::Orthographic { height: shown } = camera.projection else { return None };
        let pixels_per_unit = f64::from(height) / shown;
        let length = round_step(f64::from(width) / 4.0 / pixels_per_unit);
        let bar = (length * pixels_per_unit) as f32;
        let is_shown = self.has_scale_bar && length.is_finite();
        is_shown.then(|| Content::ScaleBar { text: length_text(length, self.unit), length: bar })
    }
}

/// Returns why a camera does not allow what settings ask for, at the keys at fault.
pub fn faults(picture: &PictureSettings, camera: &Camera, up: Vec3) -> Vec<Invalid> {
    let is_orthographic = matches!(camera.projection, Projection::Orthographic { .. });
    let fault = |key: &str| {
        let advice = match is_orthographic {
            false => "needs a camera without perspective [camera.orthographic, gsd]",
            true => "north is along the view; look down, as along 0,0,-1 [camera.direction]",
        };
        Invalid::at(key, advice)
    };
    let lacks_scale = picture.scale_bar() && !is_orthographic;
    let lacks_north = picture.north() && arrow(camera, north(up)).is_none();
    [("scale_bar", lacks_scale), ("north", lacks_north)]
        .into_iter()
        .filter(|(_, is_fault)| *is_fault)
        .map(|(key, _)| fault(key))
        .collect()
}

/// Returns the direction of north in the picture, to the right and down; `None` with perspective, and if it is almost
/// along the view.
fn arrow(camera: &Camera, north: Vec3) -> Option<[f32; 2]> {
    let Projection::Orthographic { .. } = camera.projection else { return None };
    let [right, up, _] = camera.axes();
    let north = north.as_dvec3();
    let direction = [right.dot(north) as f32, -up.dot(north) as f32];
    let length = direction[0].hypot(direction[1]);
    (0.2 < length).then(|| direction.map(|component| component / length))
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

#[cfg(test)]
mod tests {
    //! Lengths, directions and places of what is drawn.

    use super::canvas::text_width;
    use super::*;
    use surfel_core::math::DVec3;
    use surfel_core::progress::NoProgress;
    use surfel_core::scene::color::LegendClass;

    fn plan(height: f64) -> Camera {
        Camera {
            position: DVec3::new(0.0, 0.0, 10.0),
            focal_point: DVec3::ZERO,
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height },
        }
    }

    fn overlay(picture: &PictureSettings, legend: Legend) -> Overlay {
        Overlay::new(picture, legend, (Vec3::Z, Unit::Unknown), &NoProgress)
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
        let ground = LegendClass { color: [200, 0, 0], ..LegendClass::new(2, 9) };
        let legend = Legend::Classes(vec![ground]);
        let mut image = Image::new(400, 300);
        image.coverage.fill(1.0);
        for y in 0..150 {
            image.coverage[y * 400..][..200].fill(0.0);
        }
        overlay(&picture, legend.clone()).draw(&mut image, &plan(50.0));
        let red = |i: &usize| 0.5 < image.color[*i][0] && image.color[*i][1] < 0.1;
        let legend_position = (0..image.color.len()).find(red).unwrap();
        assert!(legend_position % 400 < 200 && legend_position / 400 < 150, "{legend_position}");
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
    }

    #[test]
    fn a_caption_is_cut_to_the_width_that_there_is() {
        let cut = |n: usize, width| cut_to_width(&"a line ".repeat(n), 20.0, width);
        for n in [2, 100, 100_000] {
            assert!(cut(n, 100.0).ends_with('…') && text_width(&cut(n, 100.0), 20.0) <= 100.0);
        }
        assert_eq!(cut(1, 100.0), "a line ");
        assert_eq!(cut(1, 1.0), "");
    }

    #[test]
    fn patches_of_a_draft_show_what_the_whole_picture_shows() {
        let (picture, legend) = everything();
        let overlay = overlay(&picture, legend);
        let mut image = Image::new(640, 360);
        image.color.fill([0.4, 0.5, 0.6, 1.0]);
        let mut draft = Image::new(160, 90);
        draft.color.fill([0.4, 0.5, 0.6, 1.0]);
        let patches = overlay.patches(&draft, (640, 360), &plan(50.0), &mut Style::default());
        let mut patched = image.clone();
        for Patch { x, y, image } in &patches {
            for (i, color) in image.color.iter().enumerate() {
                let (column, row) = (i as u32 % image.width, i as u32 / image.width);
                patched.color[((y + row) * 640 + x + column) as usize] = *color;
            }
        }
        overlay.draw(&mut image, &plan(50.0));
        let differs = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).any(|i| 0.02 < (a[i] - b[i]).abs());
        let n_different = image.color.iter().zip(&patched.color).filter(|pair| differs(*pair));
        assert_eq!(n_different.count(), 0);
        assert_eq!(patches.len(), 4);
    }

    #[test]
    fn a_kept_style_keeps_the_place_of_the_legend() {
        let picture = PictureSettings { legend: Some(true), ..PictureSettings::default() };
        let overlay = overlay(&picture, everything().1);
        let mut draft = Image::new(160, 90);
        let mut style = Style::default();
        let mut legend_position = |draft: &Image| {
            let patches = overlay.patches(draft, (640, 360), &plan(50.0), &mut style);
            (patches[0].x, patches[0].y)
        };
        let at_first = legend_position(&draft);
        draft.coverage[80 * 160 + 80..].fill(1.0);
        assert_eq!(legend_position(&draft), at_first);
        style = Style::default();
        let freest = overlay.patches(&draft, (640, 360), &plan(50.0), &mut style);
        assert_ne!((freest[0].x, freest[0].y), at_first);
    }

    #[test]
    fn cameras_with_perspective_have_no_scale() {
        let camera =
            Camera { projection: Projection::Perspective { view_angle_deg: 35.0 }, ..plan(1.0) };
        let (picture, _) = everything();
        let error = faults(&picture, &camera, Vec3::Z).remove(0);
        assert!(error.to_string().ends_with("[camera.orthographic, gsd]"), "{error}");
        assert_eq!(error.path, "scale_bar");
    }
}

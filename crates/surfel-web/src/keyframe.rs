//! The last picture at rest, drawn as a moved camera sees it (after Walter, Drettakis and Parker, "Interactive rendering
//! using the render cache", 1999).

use rayon::prelude::*;
use surfel_core::image::{Aovs, Image, NO_ID, decode_srgb8, encode_srgb8};
use surfel_core::math::Vec3;
use surfel_core::scene::View;

/// A picture whose pixels know their places in the world.
pub struct Keyframe {
    width: u32,
    height: u32,
    /// Place that each pixel shows, relative to the scene's origin; NaN where it shows the background.
    positions: Vec<Vec3>,
    /// sRGB codes of each pixel.
    colors: Vec<[u8; 3]>,
}

/// Pixels of a keyframe at most: with 15 bytes each it takes less than 8 MiB.
const MAX_PIXELS: f64 = 500_000.0;
/// Side of a keyframe as a fraction of the page's picture.
const SCALE: f64 = 0.5;
/// No pixel of the keyframe.
const NONE: u32 = u32::MAX;

/// Returns width and height of the keyframe of a page's picture.
pub fn keyframe_size((width, height): (u32, u32)) -> (u32, u32) {
    let n_pixels = f64::from(width) * f64::from(height);
    let scale = (MAX_PIXELS / n_pixels.max(1.0)).sqrt().min(SCALE);
    let scaled = |length: u32| (scale * f64::from(length)).ceil().max(1.0) as u32;
    (scaled(width), scaled(height))
}

impl Keyframe {
    /// A keyframe of this size that shows the background everywhere.
    pub fn new((width, height): (u32, u32)) -> Self {
        let n_pixels = width as usize * height as usize;
        let positions = vec![Vec3::NAN; n_pixels];
        Self { width, height, positions, colors: vec![[0; 3]; n_pixels] }
    }

    /// Returns its width and height.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Sets what the rows from `first_row` on show.
    pub fn set_rows(&mut self, first_row: u32, aovs: &Aovs) {
        let start = first_row as usize * self.width as usize;
        let shown = aovs.position.iter().zip(&aovs.instance_id);
        for (position, (shown, instance)) in self.positions[start..].iter_mut().zip(shown) {
            *position = if *instance == NO_ID { Vec3::NAN } else { *shown };
        }
    }

    /// Takes the colours from a larger picture: `pixel` returns one of its linear colours by column and row.
    pub fn set_colors(
        &mut self,
        (width, height): (u32, u32),
        pixel: impl Fn(u32, u32) -> [f32; 3] + Sync,
    ) {
        let range =
            |i: u32, n: u32, of: u32| i * of / n..((i + 1) * of / n).clamp(i * of / n + 1, of);
        let rows = self.colors.par_chunks_mut(self.width as usize).enumerate();
        rows.for_each(|(y, row)| {
            for (x, color) in row.iter_mut().enumerate() {
                let (xs, ys) =
                    (range(x as u32, self.width, width), range(y as u32, self.height, height));
                let n_averaged = (xs.len() * ys.len()).max(1) as f32;
                let mut sum = Vec3::ZERO;
                for y in ys {
                    sum += xs.clone().map(|x| Vec3::from_array(pixel(x, y))).sum::<Vec3>();
                }
                *color = (sum / n_averaged).to_array().map(encode_srgb8);
            }
        });
    }

    /// Draws the picture that `view` shows in the keyframe's size. Pixels that the keyframe does not show are those of
    /// `draft`, enlarged.
    pub fn draw(&self, view: &View, draft: &Image) -> Image {
        let nearest = self.nearest_pixels(view);
        let mut image = Image::new(self.width, self.height);
        let width = self.width as usize;
        let linear: [f32; 256] = std::array::from_fn(|code| decode_srgb8(code as u8));
        let columns: Vec<Between> =
            (0..self.width).map(|x| Between::new(x, self.width, draft.width)).collect();
        let rows = image.color.par_chunks_mut(width).zip(image.coverage.par_chunks_mut(width));
        rows.enumerate().for_each(|(y, (color, coverage))| {
            let above = y.saturating_sub(1);
            let below = (y + 1).min(self.height as usize - 1);
            let around = [y, above, below].map(|y| &nearest[y * width..][..width]);
            let row = Between::new(y as u32, self.height, draft.height);
            for x in 0..width {
                let shown = shown_pixel(around, x);
                if shown == NONE {
                    (color[x], coverage[x]) = draft_pixel(draft, columns[x], row);
                } else {
                    let [r, g, b] = self.colors[shown as usize];
                    let [r, g, b] = [linear[r as usize], linear[g as usize], linear[b as usize]];
                    (color[x], coverage[x]) = ([r, g, b, 1.0], 1.0);
                }
            }
        });
        image
    }

    /// Returns for each pixel of the new picture the index of the nearest of the keyframe's pixels whose places it shows.
    fn nearest_pixels(&self, view: &View) -> Vec<u32> {
        let (width, height) = (self.width as f32, self.height as f32);
        let project = |position: &Vec3| {
            let (x, y, depth) = view.project(*position)?;
            let is_inside = (0.0..width).contains(&x) && (0.0..height).contains(&y);
            is_inside.then(|| (y as u32 * self.width + x as u32, depth))
        };
        // Places of the background are NaN, and lie in no picture.
        let project = |position: &Vec3| project(position).unwrap_or((NONE, f32::INFINITY));
        let mut projected = Vec::new();
        self.positions.par_iter().map(project).collect_into_vec(&mut projected);
        let mut nearest = vec![NONE; projected.len()];
        // Each thread looks for the places in its own rows: that is faster than atomic minima.
        let n_rows = (self.height as usize).div_ceil(rayon::current_num_threads());
        let n_pixels = n_rows * self.width as usize;
        nearest.par_chunks_mut(n_pixels).enumerate().for_each(|(band, nearest)| {
            let start = (band * n_pixels) as u32;
            for (i, (pixel, depth)) in projected.iter().enumerate() {
                let Some(known) = nearest.get_mut(pixel.wrapping_sub(start) as usize) else {
                    continue;
                };
                if *known == NONE || *depth < projected[*known as usize].1 {
                    *known = i as u32;
                }
            }
        });
        nearest
    }
}

/// Returns the index of the keyframe's pixel that a pixel shows: its own, or one of its neighbours', as places that were
/// neighbours are up to three pixels apart where the camera has come nearer. `around` has its row and the two beside it.
fn shown_pixel(around: [&[u32]; 3], x: usize) -> u32 {
    let own = around[0][x];
    if own != NONE {
        return own;
    }
    let (first, end) = (x.saturating_sub(1), (x + 2).min(around[0].len()));
    let mut found = NONE;
    for row in around {
        for neighbor in &row[first..end] {
            found = found.min(*neighbor);
        }
    }
    found
}

/// The two columns or rows of a smaller picture between which a pixel of a larger one lies.
#[derive(Clone, Copy)]
struct Between {
    low: usize,
    high: usize,
    /// Weight of `high`.
    weight: f32,
}

impl Between {
    /// Pixel `i` of `n`, in a picture of `n_smaller`.
    fn new(i: u32, n: u32, n_smaller: u32) -> Self {
        let at = (i as f32 + 0.5) * n_smaller as f32 / n as f32 - 0.5;
        let last = n_smaller.saturating_sub(1) as f32;
        let low = at.floor().clamp(0.0, last);
        let high = (low + 1.0).min(last);
        Self { low: low as usize, high: high as usize, weight: (at - low).clamp(0.0, 1.0) }
    }
}

/// Returns colour and coverage of the enlarged draft: of what is there, or of the background.
fn draft_pixel(draft: &Image, x: Between, y: Between) -> ([f32; 4], f32) {
    let width = draft.width as usize;
    let corners = [
        (y.low * width + x.low, (1.0 - x.weight) * (1.0 - y.weight)),
        (y.low * width + x.high, x.weight * (1.0 - y.weight)),
        (y.high * width + x.low, (1.0 - x.weight) * y.weight),
        (y.high * width + x.high, x.weight * y.weight),
    ];
    let mut coverage = 0.0;
    for (i, weight) in corners {
        coverage += weight * draft.coverage[i];
    }
    // Things and background are not mixed, so that edges stay sharp.
    let is_thing = 0.5 <= coverage;
    let (mut color, mut total) = ([0.0; 4], 0.0);
    for (i, weight) in corners {
        let covered = draft.coverage[i];
        let weight = weight * if is_thing { covered } else { 1.0 - covered };
        let [r, g, b, a] = draft.color[i];
        color[0] += weight * r;
        color[1] += weight * g;
        color[2] += weight * b;
        color[3] += weight * a;
        total += weight;
    }
    let scale = 1.0 / total;
    let [r, g, b, a] = color;
    ([scale * r, scale * g, scale * b, scale * a], f32::from(u8::from(is_thing)))
}

#[cfg(test)]
mod tests {
    //! Keyframes seen by the same camera and by others.

    use super::*;
    use surfel_core::math::DVec3;
    use surfel_core::scene::{Camera, Projection};

    const SIZE: (u32, u32) = (40, 30);

    /// A camera that looks down at 40 x 30 units of the floor, moved to the right.
    fn view(x: f64) -> View {
        let camera = Camera {
            position: DVec3::new(x, 0.0, 100.0),
            focal_point: DVec3::new(x, 0.0, 0.0),
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height: 30.0 },
        };
        camera.view(DVec3::ZERO, SIZE.0, SIZE.1)
    }

    /// The floor with columns of different greys, and a wall of one pixel that stands 50 higher in column 10.
    fn keyframe() -> Keyframe {
        let mut keyframe = Keyframe::new(SIZE);
        let mut aovs = Image::with_aovs(SIZE.0, SIZE.1).aovs.unwrap();
        for i in 0..aovs.position.len() {
            let (x, y) = (i as u32 % SIZE.0, i as u32 / SIZE.0);
            let position = view(0.0).ray(x as f32 + 0.5, y as f32 + 0.5).at(100.0);
            aovs.position[i] = position.with_z(if x == 10 { 50.0 } else { 0.0 });
            aovs.instance_id[i] = 0;
        }
        keyframe.set_rows(0, &aovs);
        keyframe.set_colors(SIZE, |x, _| [decode_srgb8(6 * x as u8); 3]);
        keyframe
    }

    fn draft() -> Image {
        let mut draft = Image::new(4, 3);
        draft.color.fill([0.0, 1.0, 0.0, 1.0]);
        draft
    }

    fn codes(image: &Image) -> Vec<u8> {
        image.color[..40].iter().map(|[r, ..]| encode_srgb8(*r)).collect()
    }

    #[test]
    fn the_same_camera_sees_the_same_picture() {
        let image = keyframe().draw(&view(0.0), &draft());
        assert_eq!(codes(&image), (0..40).map(|x| 6 * x).collect::<Vec<u8>>());
        assert!(image.coverage.iter().all(|coverage| *coverage == 1.0));
    }

    #[test]
    fn what_was_not_seen_is_that_of_the_draft() {
        let image = keyframe().draw(&view(5.0), &draft());
        // The last column overlaps what is beyond by one pixel.
        let expected: Vec<u8> = (5..40).map(|x| 6 * x).chain([234, 0, 0, 0, 0]).collect();
        assert_eq!(codes(&image), expected);
        assert_eq!((image.color[38], image.coverage[38]), ([0.0, 1.0, 0.0, 1.0], 0.0));
        // Nothing of it is seen from behind.
        let behind = Camera {
            position: DVec3::new(0.0, 0.0, 200.0),
            focal_point: DVec3::new(0.0, 0.0, 300.0),
            view_up: DVec3::Y,
            projection: Projection::Perspective { view_angle_deg: 40.0 },
        };
        let image = keyframe().draw(&behind.view(DVec3::ZERO, SIZE.0, SIZE.1), &draft());
        assert!(image.color.iter().all(|[r, g, ..]| *r == 0.0 && 0.999 < *g));
    }

    #[test]
    fn the_nearer_of_two_surfaces_hides_the_other() {
        let from_left = Camera {
            position: DVec3::new(-40.0, 0.0, 100.0),
            focal_point: DVec3::new(-10.0, 0.0, 0.0),
            view_up: DVec3::Y,
            projection: Projection::Orthographic { height: 30.0 },
        };
        let view = from_left.view(DVec3::ZERO, SIZE.0, SIZE.1);
        let image = keyframe().draw(&view, &draft());
        // The wall appears where its top projects to, before the floor that lies there.
        let (x, y, _) = view.project(Vec3::new(-9.5, 0.5, 50.0)).unwrap();
        let seen = image.color[y as usize * 40 + x as usize][0];
        assert_eq!(encode_srgb8(seen), 60);
    }

    #[test]
    fn keyframes_have_half_the_width_and_a_limit() {
        assert_eq!(keyframe_size((1128, 872)), (564, 436));
        let (width, height) = keyframe_size((3840, 2160));
        assert!((460_000..510_000).contains(&(width * height)), "{width}x{height}");
        assert_eq!(keyframe_size((1, 1)), (1, 1));
    }
}

//! Small maps of the points that are nearest to a camera.

use super::camera::{Camera, View};
use crate::math::{DVec3, Vec3};

/// Number of points for each covered pixel: enough to hide the points behind them.
const POINTS_PER_PIXEL: f64 = 10.0;
/// Maximum height in pixels.
const MAX_HEIGHT: f64 = 128.0;

/// Returns the width over height of a small picture that stands for one of this aspect: at most 64, or its inverse.
pub(super) fn small_aspect(aspect: f64) -> f64 {
    aspect.clamp(1.0 / 64.0, 64.0)
}

/// The nearest point of each pixel of a small picture.
pub(super) struct DepthMap {
    /// The camera, in the coordinates of the points.
    pub view: View,
    /// Width and height in pixels.
    pub size: (usize, usize),
    nearest: Vec<Option<(f32, Vec3)>>,
}

impl DepthMap {
    /// Returns the map of `points` seen by `camera`, which is in their coordinates. `aspect` is width over height.
    pub fn new(points: &[Vec3], camera: &Camera, aspect: f64) -> Self {
        let aspect = small_aspect(aspect);
        let height = (points.len() as f64 / POINTS_PER_PIXEL / aspect).sqrt();
        let height = height.clamp(4.0, MAX_HEIGHT) as u32;
        let width = (f64::from(height) * aspect) as u32;
        let view = camera.view(DVec3::ZERO, width, height);
        let size = (width as usize, height as usize);
        let mut map = Self { view, size, nearest: vec![None; size.0 * size.1] };
        for point in points {
            let Some((pixel, depth)) = map.pixel_and_depth(*point) else { continue };
            if map.nearest[pixel].is_none_or(|(least, _)| depth < least) {
                map.nearest[pixel] = Some((depth, *point));
            }
        }
        map
    }

    /// Returns the nearest point of a pixel.
    pub fn nearest(&self, x: usize, y: usize) -> Option<Vec3> {
        self.nearest[y * self.size.0 + x].map(|(_, point)| point)
    }

    /// True if no point is nearer than `point` in its pixel by more than `slack`; false outside of the picture.
    pub fn shows(&self, point: Vec3, slack: f32) -> bool {
        self.pixel_and_depth(point).is_some_and(|(pixel, depth)| {
            self.nearest[pixel].is_none_or(|(least, _)| depth <= least + slack)
        })
    }

    fn pixel_and_depth(&self, point: Vec3) -> Option<(usize, f32)> {
        let (width, height) = self.size;
        let (x, y, depth) = self.view.project(point)?;
        let is_inside = (0.0..width as f32).contains(&x) && (0.0..height as f32).contains(&y);
        is_inside.then(|| (y as usize * width + x as usize, depth))
    }
}

//! Planes of disparities over the pixels of a window of a depth image.

use crate::math::{DMat3, DVec3};

/// Number of times that a plane is fitted, each time with weights by the one before.
const N_FITS: usize = 2;
/// Minimum fraction of the pixels in a window near its plane, and minimum number of them.
const MIN_NEAR: f32 = 0.4;
const MIN_PIXELS: usize = 6;
/// Weight of a change of slopes, as a fraction of that of the disparities: pixels in a line determine no plane.
const STIFFNESS: f64 = 1e-4;

/// The pixels around a pixel that take part in its plane. Lengths are in pixels, disparities in the unit at the pixel.
pub struct ImageWindow {
    pub radius: isize,
    /// Distance between the pixels that take part.
    pub stride: isize,
    /// Distance of a disparity from the plane from which it takes no part.
    pub max_distance: f32,
    /// Root mean square distance from which the plane of the smaller window stays.
    pub max_error: f32,
}

/// A measured disparity, and where in the image it was measured, in pixels.
#[derive(Clone, Copy)]
pub struct DisparitySample {
    pub x: f32,
    pub y: f32,
    pub disparity: f32,
}

/// The surface at a pixel.
#[derive(Clone, Copy, Default)]
pub struct DisparityPlane {
    pub disparity: f32,
    /// Change of the disparity from pixel to pixel along both axes.
    pub slope: [f32; 2],
    /// True if the plane was fitted to a window.
    pub is_known: bool,
}

impl DisparityPlane {
    /// Returns the disparity at an offset from the pixel.
    pub fn at(&self, x: f32, y: f32) -> f32 {
        self.disparity + self.slope[0] * x + self.slope[1] * y
    }
}

/// A plane fitted to the pixels of a window.
pub struct DisparityFit {
    pub plane: DisparityPlane,
    /// Number of pixels near the plane before the last change, and their weighted root mean square distance from it.
    n_near: usize,
    pub error: f32,
}

impl DisparityFit {
    /// Fits a plane to the pixels that are near it, from `start` on. `unit` is that of the disparities of `window`.
    pub fn new(
        pixels: &[DisparitySample],
        window: &ImageWindow,
        unit: f32,
        start: DisparityPlane,
    ) -> Self {
        let mut fit = Self { plane: start, n_near: 0, error: 0.0 };
        for _ in 0..N_FITS {
            fit.refine(pixels, window, unit);
        }
        fit
    }

    /// Fits the plane to the pixels that are near it.
    fn refine(&mut self, pixels: &[DisparitySample], window: &ImageWindow, unit: f32) {
        let per_reach = 1.0 / ((window.radius + window.stride) as f32).powi(2);
        let per_distance = 1.0 / (window.max_distance * unit).powi(2);
        let [mut w, mut wx, mut wy, mut wxx, mut wxy, mut wyy] = [0.0f32; 6];
        let [mut wd, mut wxd, mut wyd, mut wdd] = [0.0f32; 4];
        let mut n_near = 0;
        for &DisparitySample { x, y, disparity } in pixels {
            let distance = disparity - self.plane.at(x, y);
            let nearness = 1.0 - distance * distance * per_distance;
            let closeness = (1.0 - (x * x + y * y) * per_reach).max(0.0);
            if nearness <= 0.0 || closeness == 0.0 {
                continue;
            }
            n_near += 1;
            let weight = nearness * nearness * closeness * closeness;
            w += weight;
            wx += weight * x;
            wy += weight * y;
            wxx += weight * x * x;
            wxy += weight * x * y;
            wyy += weight * y * y;
            wd += weight * distance;
            wxd += weight * x * distance;
            wyd += weight * y * distance;
            wdd += weight * distance * distance;
        }
        self.n_near = n_near;
        if w <= 0.0 {
            return;
        }
        let stiff = STIFFNESS * f64::from(w);
        let [w, wx, wy, wxx, wxy, wyy, wd, wxd, wyd] =
            [w, wx, wy, wxx, wxy, wyy, wd, wxd, wyd].map(f64::from);
        let matrix = DMat3::from_cols(
            DVec3::new(w, wx, wy),
            DVec3::new(wx, wxx + stiff, wxy),
            DVec3::new(wy, wxy, wyy + stiff),
        );
        let change = (matrix.inverse() * DVec3::new(wd, wxd, wyd)).as_vec3();
        if change.is_finite() {
            self.plane.disparity += change.x;
            self.plane.slope[0] += change.y;
            self.plane.slope[1] += change.z;
        }
        self.error = (wdd / w as f32).sqrt();
    }

    /// True if enough of the pixels are near the plane.
    pub fn is_supported(&self, n_pixels: usize) -> bool {
        MIN_PIXELS <= self.n_near && MIN_NEAR * n_pixels as f32 <= self.n_near as f32
    }
}

//! Environment maps: light from an equirectangular picture of the whole sphere around the scene.

mod repair;
#[cfg(test)]
mod tests;

use super::ground::ground_axes;
use crate::error::{Error, Result};
use crate::math::{DQuat, Distribution2d, Vec3};
use repair::{MAX_RADIANCE, repair};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// An equirectangular picture as a light that is infinitely far away, sampled in proportion to its luminance.
///
/// Row 0 looks straight up; columns go clockwise seen from above, and the middle one looks north, as in
/// pictures of [`Projection::Panorama`](super::Projection::Panorama). North is that of
/// [`Sun::direction_from_angles`](super::Sun::direction_from_angles). Between the centres of pixels, the
/// radiance is linear in the angles (the common choice, as in pbrt). Directions are sampled as by Pharr and
/// Humphreys 2004 (Physically Based Rendering, Infinite Area Light Source Sampling), with a constant density
/// in each pixel.
///
/// Clones share the picture. The radiance takes 12 bytes per pixel, the density 4.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    /// Linear radiance of `width * height` pixels, from 0 to `MAX_RADIANCE`.
    pixels: Arc<[Vec3]>,
    /// Factor of the radiance.
    strength: f32,
    /// Unit vectors to the right of the picture's middle, to its middle, and up.
    axes: [Vec3; 3],
    /// Distribution over the pixels, in proportion to luminance times solid angle.
    distribution: Arc<Distribution2d>,
    n_repaired: usize,
}

/// The arrays of an environment, for other implementations of its sampling.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentArrays<'a> {
    /// Width and height of the picture in pixels.
    pub size: [usize; 2],
    /// Linear radiances, row by row from the top.
    pub pixels: &'a [Vec3],
    /// Factor of the radiances.
    pub strength: f32,
    /// Unit vectors to the right of the picture's middle, to its middle, and up.
    pub axes: [Vec3; 3],
    /// Starts of the rows in the cumulative distribution over all rows.
    pub row_cdf: &'a [u32],
    /// Starts of the pixels in the cumulative distribution of each row, row by row.
    pub column_cdf: &'a [u32],
}

impl Environment {
    /// Returns the arrays from which the environment is sampled.
    pub fn arrays(&self) -> EnvironmentArrays<'_> {
        let Self { width, height, pixels, strength, axes, distribution, .. } = self;
        let (row_cdf, column_cdf) = distribution.arrays();
        let (size, strength, axes) = ([*width, *height], *strength, *axes);
        EnvironmentArrays { size, pixels, strength, axes, row_cdf, column_cdf }
    }

    /// Makes an environment of `width * height` linear Rec.709 radiances; row 0 is the top.
    ///
    /// `rotation_deg` rotates the environment about `up`, in degrees clockwise seen from above: the middle
    /// column then looks toward that azimuth. Negative components and NaN become 0, infinite ones the
    /// largest finite one; [`Environment::n_repaired`] counts the pixels changed so.
    ///
    /// # Errors
    ///
    /// Fails if the picture is empty, if the number of pixels is not `width * height`, if no component of
    /// any pixel is finite and at least 0, or if `up` or `rotation_deg` are not finite or `up` is zero.
    pub fn new(
        width: u32,
        height: u32,
        pixels: Vec<Vec3>,
        up: Vec3,
        rotation_deg: f32,
    ) -> Result<Self> {
        let reject = |name, found, expected| Err(Error::Setting { name, found, expected });
        let axes = axes(up, rotation_deg)?;
        let n_pixels = (width as usize).checked_mul(height as usize);
        if n_pixels != Some(pixels.len()) || pixels.is_empty() {
            let found = format!("{} pixels for {width} x {height}", pixels.len());
            return reject("an environment", found, "width x height pixels, at least one");
        }
        let Some((pixels, n_repaired)) = repair(pixels) else {
            let expected = "at least one finite number from 0";
            return reject("the values of an environment", "no valid radiance".into(), expected);
        };
        let (width, height) = (width as usize, height as usize);
        let is_black = pixels.iter().all(|pixel| *pixel == Vec3::ZERO);
        let weight = |x: usize, y: usize| {
            let luminance = if is_black { 1.0 } else { mean_luminance(&pixels, width, x, y) };
            luminance * solid_angle(width, height, y) as f32
        };
        let Some(distribution) = Distribution2d::new(width as u32, height as u32, weight) else {
            return reject("an environment", "no pixels".into(), "at least one");
        };
        let distribution = Arc::new(distribution);
        let pixels = pixels.into();
        Ok(Self { width, height, pixels, strength: 1.0, axes, distribution, n_repaired })
    }

    /// Returns the number of pixels with components that were invalid or above the maximum radiance.
    pub fn n_repaired(&self) -> usize {
        self.n_repaired
    }

    /// Returns the environment with another `up` and rotation, as in [`Environment::new`].
    ///
    /// # Errors
    ///
    /// Fails if `up` or `rotation_deg` are not finite or `up` is zero.
    pub fn with_orientation(&self, up: Vec3, rotation_deg: f32) -> Result<Self> {
        Ok(Self { axes: axes(up, rotation_deg)?, ..self.clone() })
    }

    /// Returns the environment rotated about the scene.
    pub fn rotated(&self, rotation: DQuat) -> Self {
        let axes = self.axes.map(|axis| (rotation * axis.as_dvec3()).as_vec3());
        Self { axes, ..self.clone() }
    }

    /// Multiplies the radiance by `factor`, in constant time. A negative factor or NaN counts as 0.
    pub fn scale(&mut self, factor: f32) {
        self.strength = (self.strength * factor.max(0.0)).min(MAX_RADIANCE);
    }

    /// Returns the linear radiance from `direction` (unit), interpolated between four pixels.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.interpolate(self.pixel_position(direction))
    }

    /// Returns the linear radiance from `direction` (unit), and the density per steradian with which
    /// [`Environment::sample`] samples it. The density is 0 only where the radiance is.
    pub fn radiance_and_density(&self, direction: Vec3) -> (Vec3, f32) {
        let (x, y) = self.pixel_position(direction);
        let cell = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let density = f64::from(self.distribution.probability(cell))
            / solid_angle(self.width, self.height, cell.1);
        (self.interpolate((x, y)), density as f32)
    }

    /// Interpolates the radiance bilinearly at a position in pixels.
    fn interpolate(&self, (x, y): (f32, f32)) -> Vec3 {
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        // Columns wrap around the sphere; the first and last rows extend to the poles.
        let columns = if left < 0.0 {
            (self.width - 1, 0)
        } else {
            let left = (left as usize).min(self.width - 1);
            (left, if left + 1 < self.width { left + 1 } else { 0 })
        };
        let rows = (top.max(0.0) as usize, (top + 1.0) as usize);
        let row = |y: usize| {
            let row = &self.pixels[y.min(self.height - 1) * self.width..][..self.width];
            row[columns.0].lerp(row[columns.1], x - left)
        };
        self.strength * row(rows.0).lerp(row(rows.1), y - top)
    }

    /// Samples a direction (unit) with `uv`, which is uniform in the unit square.
    pub fn sample(&self, uv: (f32, f32)) -> Vec3 {
        let (cell, offset) = self.distribution.sample(uv);
        let azimuth = TAU * ((cell.0 as f64 + f64::from(offset.0)) / self.width as f64 - 0.5);
        // The area of a sphere is uniform in height (Archimedes), so this is uniform within the pixel. It
        // needs double precision: near the poles of a fine picture all heights are one single float.
        let [top, bottom] =
            [cell.1, cell.1 + 1].map(|y| (PI * y as f64 / self.height as f64).cos());
        let height = top + f64::from(offset.1) * (bottom - top);
        let level = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
        let [right, middle, up] = self.axes;
        let across = (level * azimuth.sin()) as f32;
        let along = (level * azimuth.cos()) as f32;
        let direction = across * right + along * middle + height as f32 * up;
        direction.normalize()
    }

    /// Returns the position of a direction in the picture, in pixels from its upper left corner.
    fn pixel_position(&self, direction: Vec3) -> (f32, f32) {
        let [right, middle, up] = self.axes.map(|axis| direction.dot(axis));
        let x = 0.5 + right.atan2(middle) / std::f32::consts::TAU;
        let y = right.hypot(middle).atan2(up) / std::f32::consts::PI;
        (x * self.width as f32, y * self.height as f32)
    }
}

/// Returns the axes of a picture with this orientation: right of its middle, its middle, and up.
fn axes(up: Vec3, rotation_deg: f32) -> Result<[Vec3; 3]> {
    let Some(up) = up.try_normalize() else {
        let expected = "a direction";
        return Err(Error::Setting { name: "up", found: up.to_string(), expected });
    };
    if !rotation_deg.is_finite() {
        let (name, expected) = ("the rotation of an environment", "a finite number of degrees");
        return Err(Error::Setting { name, found: rotation_deg.to_string(), expected });
    }
    let (sin, cos) = rotation_deg.to_radians().sin_cos();
    let (east, north) = ground_axes(up);
    Ok([cos * east - sin * north, cos * north + sin * east, up])
}

/// Returns the mean luminance (Rec.709) of the interpolated radiance over the area of a pixel.
///
/// The area extends half way to the neighbouring pixels: they have weights 1, 6 and 1 of 8 on each axis. The
/// mean is 0 only if the whole area is black.
fn mean_luminance(pixels: &[Vec3], width: usize, x: usize, y: usize) -> f32 {
    let last_row = pixels.len() / width - 1;
    let rows = [y.saturating_sub(1), y, (y + 1).min(last_row)];
    let columns =
        [if x == 0 { width - 1 } else { x - 1 }, x, if x + 1 == width { 0 } else { x + 1 }];
    let mean = |[a, b, c]: [Vec3; 3]| 0.125 * (a + c) + 0.75 * b;
    let row = |y: usize| mean(columns.map(|x| pixels[y * width + x]));
    mean(rows.map(row)).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Returns the solid angle in steradians of each pixel in row `y`.
fn solid_angle(width: usize, height: usize, y: usize) -> f64 {
    let step = PI / height as f64;
    TAU / width as f64 * 2.0 * (step * (y as f64 + 0.5)).sin() * (0.5 * step).sin()
}

//! Light from a picture of the whole sphere around the scene.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::light::ground_axes;
use crate::error::{Error, Result};
use crate::math::{DQuat, Distribution2d, Vec3};

/// An equirectangular picture as light from infinitely far away, drawn in proportion to its luminance.
///
/// Row 0 looks straight up; columns go clockwise as seen from above, the middle one toward north, as in
/// pictures of [`super::Projection::Panorama`]. Between the centres of pixels, radiance is linear in the
/// angles (the common choice, as in pbrt); north is that of [`super::Sun::toward`]. Directions are drawn
/// as by Pharr and Humphreys 2004 (Physically Based Rendering, Infinite Area Light Source Sampling), with
/// a density that is the same everywhere in a pixel.
///
/// Clones share the picture. Lights are 12 bytes a pixel, the density 4.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    /// `width * height` of them, neither negative nor larger than `MOST_RADIANCE`.
    pixels: Arc<[Vec3]>,
    strength: f32,
    /// Right of the picture's middle, its middle, and up: orthonormal.
    axes: [Vec3; 3],
    /// Over the pixels as cells.
    distribution: Arc<Distribution2d>,
    n_repaired: usize,
}

/// Radiance is cut off here: products with strengths, colours and densities stay finite.
const MOST_RADIANCE: f32 = 1e15;
/// An infinite value counts as at least this: it is mostly a sun brighter than half floats can tell.
const LARGEST_HALF: f32 = 65504.0;

impl Environment {
    /// Of `width * height` linear Rec.709 radiances, row 0 at the top. `rotation_deg` turns the light
    /// clockwise about `up`, seen from above: the middle column then looks toward that azimuth.
    ///
    /// Components that are no light (negative, NaN) become 0, infinite ones the largest finite one; what
    /// was repaired is counted by [`Environment::n_repaired`]. An error if the picture is empty, if the
    /// number of pixels is not `width * height`, if no component of any pixel is a finite number from 0,
    /// or if `up` or `rotation_deg` say nothing.
    pub fn new(
        width: u32,
        height: u32,
        pixels: Vec<Vec3>,
        up: Vec3,
        rotation_deg: f32,
    ) -> Result<Self> {
        let refuse = |name, found, expected| Err(Error::Setting { name, found, expected });
        let axes = axes(up, rotation_deg)?;
        let n_pixels = (width as usize).checked_mul(height as usize);
        if n_pixels != Some(pixels.len()) || pixels.is_empty() {
            let found = format!("{} pixels for {width} x {height}", pixels.len());
            return refuse("an environment", found, "width x height pixels, at least one");
        }
        let Some((pixels, n_repaired)) = repair(pixels) else {
            let expected = "at least one number from 0";
            return refuse("the values of an environment", "none that is light".into(), expected);
        };
        let (width, height) = (width as usize, height as usize);
        let is_black = pixels.iter().all(|pixel| *pixel == Vec3::ZERO);
        let weight = |x: usize, y: usize| {
            let luminance = if is_black { 1.0 } else { mean_luminance(&pixels, width, x, y) };
            luminance * solid_angle(width, height, y) as f32
        };
        let Some(distribution) = Distribution2d::new(width as u32, height as u32, weight) else {
            return refuse("an environment", "no pixels".into(), "at least one");
        };
        let distribution = Arc::new(distribution);
        let pixels = pixels.into();
        Ok(Self { width, height, pixels, strength: 1.0, axes, distribution, n_repaired })
    }

    /// Number of pixels with components that were not light or cut off.
    pub fn n_repaired(&self) -> usize {
        self.n_repaired
    }

    /// The same about another `up`, turned by `rotation_deg` as in [`Environment::new`].
    pub fn facing(&self, up: Vec3, rotation_deg: f32) -> Result<Self> {
        Ok(Self { axes: axes(up, rotation_deg)?, ..self.clone() })
    }

    /// The same, carried about the scene.
    pub fn turned(&self, turn: DQuat) -> Self {
        let axes = self.axes.map(|axis| (turn * axis.as_dvec3()).as_vec3());
        Self { axes, ..self.clone() }
    }

    /// Multiplies the radiance by `factor`, which counts as 0 if it is negative or NaN. Costs nothing.
    pub fn gain(&mut self, factor: f32) {
        self.strength = (self.strength * factor.max(0.0)).min(MOST_RADIANCE);
    }

    /// Linear radiance from `direction` (unit), between the four pixels around it.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.between_pixels(self.place(direction))
    }

    /// The same, and the density per steradian with which [`Environment::sample`] draws `direction`, which
    /// is 0 only where the radiance is.
    pub fn radiance_and_density(&self, direction: Vec3) -> (Vec3, f32) {
        let (x, y) = self.place(direction);
        let cell = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let density = f64::from(self.distribution.probability(cell))
            / solid_angle(self.width, self.height, cell.1);
        (self.between_pixels((x, y)), density as f32)
    }

    fn between_pixels(&self, (x, y): (f32, f32)) -> Vec3 {
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        // Around the sphere to the sides; at the poles the last row goes on.
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

    /// Direction (unit) that `uv`, uniform in the unit square, draws.
    pub fn sample(&self, uv: (f32, f32)) -> Vec3 {
        let (cell, place) = self.distribution.sample(uv);
        let azimuth = TAU * ((cell.0 as f64 + f64::from(place.0)) / self.width as f64 - 0.5);
        // Even in height, as a sphere's area is (Archimedes), and so even within the pixel. In double
        // precision: near the poles of a fine picture all heights are one float.
        let [top, bottom] =
            [cell.1, cell.1 + 1].map(|y| (PI * y as f64 / self.height as f64).cos());
        let height = top + f64::from(place.1) * (bottom - top);
        let level = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
        let [right, middle, up] = self.axes;
        let across = (level * azimuth.sin()) as f32;
        let along = (level * azimuth.cos()) as f32;
        let direction = across * right + along * middle + height as f32 * up;
        direction.normalize()
    }

    /// Place in the picture in pixels, from its top left corner.
    fn place(&self, direction: Vec3) -> (f32, f32) {
        let [right, middle, up] = self.axes.map(|axis| direction.dot(axis));
        let x = 0.5 + right.atan2(middle) / std::f32::consts::TAU;
        let y = right.hypot(middle).atan2(up) / std::f32::consts::PI;
        (x * self.width as f32, y * self.height as f32)
    }
}

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

/// The pixels as light, and the number of those that were not; None if none holds any number from 0.
fn repair(mut pixels: Vec<Vec3>) -> Option<(Vec<Vec3>, usize)> {
    let components = pixels.iter().flat_map(Vec3::to_array);
    let most = components.filter(|value| value.is_finite()).fold(-1.0f32, f32::max);
    if most < 0.0 {
        return None;
    }
    let infinite = most.clamp(LARGEST_HALF, MOST_RADIANCE);
    let mut n_repaired = 0;
    for pixel in &mut pixels {
        let repaired = pixel.to_array().map(|value| match value {
            f32::INFINITY => infinite,
            _ if 0.0 < value => value.min(MOST_RADIANCE),
            // NaN too.
            _ => 0.0,
        });
        n_repaired += usize::from(pixel.to_array() != repaired);
        *pixel = Vec3::from_array(repaired);
    }
    Some((pixels, n_repaired))
}

/// Mean luminance (Rec.709) of the interpolated radiance over the area of a pixel, which reaches half
/// way to its neighbours: weights 1, 6 and 1 of 8 each way. It is 0 only where all the area is black.
fn mean_luminance(pixels: &[Vec3], width: usize, x: usize, y: usize) -> f32 {
    let last_row = pixels.len() / width - 1;
    let rows = [y.saturating_sub(1), y, (y + 1).min(last_row)];
    let columns =
        [if x == 0 { width - 1 } else { x - 1 }, x, if x + 1 == width { 0 } else { x + 1 }];
    let mean = |[a, b, c]: [Vec3; 3]| 0.125 * (a + c) + 0.75 * b;
    let row = |y: usize| mean(columns.map(|x| pixels[y * width + x]));
    mean(rows.map(row)).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Steradians of each pixel in row `y`.
fn solid_angle(width: usize, height: usize, y: usize) -> f64 {
    let step = PI / height as f64;
    TAU / width as f64 * 2.0 * (step * (y as f64 + 0.5)).sin() * (0.5 * step).sin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec3, hash, scrambled_pair};

    fn environment(width: u32, height: u32, pixel: impl Fn(usize, usize) -> Vec3) -> Environment {
        turned(width, height, Vec3::Z, 0.0, pixel)
    }

    fn turned(
        width: u32,
        height: u32,
        up: Vec3,
        rotation_deg: f32,
        pixel: impl Fn(usize, usize) -> Vec3,
    ) -> Environment {
        let w = width as usize;
        let pixels = (0..w * height as usize).map(|i| pixel(i % w, i / w)).collect();
        Environment::new(width, height, pixels, up, rotation_deg).unwrap()
    }

    /// Some pixels bright, some black, in all colours.
    fn motley(width: u32, height: u32) -> Environment {
        turned(width, height, Vec3::new(0.2, -0.5, 1.0), 77.0, |x, y| {
            let random = |channel| (hash((x * 131 + y * 7 + channel) as u64) % 256) as f32 / 255.0;
            let scale = if 2 < (x + y) % 5 { 0.0 } else { 40f32.powf(random(3)) };
            scale * Vec3::new(random(0), random(1), random(2))
        })
    }

    /// Directions even over the sphere, and the area of each.
    fn sphere(n: u32) -> (impl Iterator<Item = Vec3>, f64) {
        let direction = |i: u32| {
            let (u, v) = scrambled_pair(i, 11);
            let (height, azimuth) = (1.0 - 2.0 * v, std::f32::consts::TAU * u);
            let level = (1.0 - height * height).max(0.0).sqrt();
            Vec3::new(level * azimuth.cos(), level * azimuth.sin(), height)
        };
        ((0..n).map(direction), 4.0 * PI / f64::from(n))
    }

    #[test]
    fn the_density_integrates_to_one() {
        for (width, height) in [(1, 1), (2, 1), (3, 5), (16, 8), (64, 32)] {
            let environment = motley(width, height);
            let (directions, area) = sphere(1 << 16);
            let sum: f64 = directions.map(|d| area * f64::from(environment.density(d))).sum();
            assert!((sum - 1.0).abs() < 0.01, "{width} x {height}: {sum}");
        }
    }

    #[test]
    fn the_average_is_the_mean_over_the_sphere_and_over_the_samples() {
        for (width, height) in [(1, 1), (1, 2), (2, 1), (3, 5), (16, 8), (64, 32)] {
            let environment = motley(width, height);
            let average = environment.average().as_dvec3();
            let n = 1 << 16;
            let (directions, _) = sphere(n);
            let even = directions.map(|d| environment.radiance(d).as_dvec3()).sum::<DVec3>();
            let drawn = (0..n).map(|i| {
                let direction = environment.sample(scrambled_pair(i, 5));
                let (radiance, density) = environment.radiance_and_density(direction);
                assert!((direction.length() - 1.0).abs() < 1e-5 && 0.0 < density);
                radiance.as_dvec3() / (f64::from(density) * 4.0 * PI)
            });
            let drawn = drawn.sum::<DVec3>() / f64::from(n);
            let even = even / f64::from(n);
            let error = |found: DVec3| ((found - average).abs() / average).max_element();
            assert!(error(even) < 0.01, "{width} x {height}: {even} {average}");
            // Standard error: below 2 in a sample, 2 / 256 for that many, less as they are well spread.
            assert!(error(drawn) < 0.01, "{width} x {height}: {drawn} {average}");
        }
    }

    #[test]
    fn directions_come_as_often_as_their_density_says() {
        let environment = motley(24, 12);
        let (n_bins, n) = (8 * 6, 1u32 << 15);
        let bin = |d: Vec3| {
            let azimuth = d.y.atan2(d.x) / std::f32::consts::TAU + 0.5;
            let height = 0.5 * (d.z + 1.0);
            ((6.0 * height) as usize).min(5) * 8 + ((8.0 * azimuth) as usize).min(7)
        };
        let mut expected = vec![0.0; n_bins];
        let (directions, area) = sphere(1 << 18);
        for d in directions {
            expected[bin(d)] += f64::from(n) * area * f64::from(environment.density(d));
        }
        let mut counts = vec![0.0; n_bins];
        for i in 0..n {
            let mut random = crate::math::Random::new(1, u64::from(i));
            counts[bin(environment.sample((random.next_f32(), random.next_f32())))] += 1.0;
        }
        let terms = expected.iter().zip(&counts).map(|(e, c): (&f64, &f64)| (c - e).powi(2) / e);
        let chi_squared: f64 = terms.sum();
        // 47 degrees of freedom: 95 is passed once in 20 thousand tries; the seed is fixed.
        assert!(chi_squared < 95.0, "{chi_squared}");
    }

    #[test]
    fn a_lone_bright_pixel_is_found() {
        let environment = environment(512, 256, |x, y| match (x, y) {
            (300, 40) => Vec3::splat(1e6),
            _ => Vec3::splat(0.01),
        });
        let toward = environment.center(300, 40);
        assert_eq!(environment.radiance(toward).round(), Vec3::splat(1e6));
        let near = (0..1000).filter(|i| {
            let direction = environment.sample(scrambled_pair(*i, 2));
            direction.dot(toward) > (2.0 * std::f32::consts::PI / 256.0).cos()
        });
        assert!(990 < near.count());
        // With nothing else, all that is drawn has light or lies beside it.
        let only =
            self::environment(64, 32, |x, y| Vec3::Z * f32::from(u8::from((x, y) == (0, 9))));
        let n = 4096;
        let (mut sum, mut squares) = (0.0, 0.0);
        for i in 0..n {
            let direction = only.sample(scrambled_pair(i, 2));
            let (radiance, density) = only.radiance_and_density(direction);
            let value = f64::from(radiance.z / density) / (4.0 * PI);
            (sum, squares) = (sum + value, squares + value * value);
        }
        let (mean, square) = (sum / f64::from(n), squares / f64::from(n));
        assert!((mean / f64::from(only.average().z) - 1.0).abs() < 0.02, "{mean}");
        // By the weights 1, 6, 1 of both axes: (0.5833 / 0.75 + 2 * 0.04167 / 0.125)^2 = 2.086.
        assert!((square / (mean * mean) - 2.086).abs() < 0.1, "{}", square / (mean * mean));
    }

    #[test]
    fn a_uniform_picture_is_drawn_evenly() {
        for value in [0.0, 0.5] {
            let environment = environment(96, 48, |_, _| Vec3::splat(value));
            assert!(environment.average().abs_diff_eq(Vec3::splat(value), 1e-6));
            let (directions, _) = sphere(5000);
            for direction in directions.chain([Vec3::Z, Vec3::NEG_Z]) {
                let density = f64::from(environment.density(direction));
                assert!((density * 4.0 * PI - 1.0).abs() < 1e-4, "{direction}: {density}");
                assert!(environment.radiance(direction).abs_diff_eq(Vec3::splat(value), 1e-6));
            }
        }
    }

    #[test]
    fn the_middle_column_looks_north_and_rotation_turns_it_clockwise() {
        let north = |x, _| if x == 16 || x == 15 { Vec3::ONE } else { Vec3::ZERO };
        let light = |up, rotation_deg, direction: Vec3| {
            turned(32, 16, up, rotation_deg, north).radiance(direction).x
        };
        assert_eq!(light(Vec3::Z, 0.0, Vec3::Y), 1.0);
        assert_eq!(light(Vec3::Z, 0.0, Vec3::X) + light(Vec3::Z, 0.0, Vec3::NEG_Y), 0.0);
        assert!(0.99 < light(Vec3::Z, 90.0, Vec3::X));
        assert!(0.99 < light(Vec3::Z, -90.0, Vec3::NEG_X));
        assert_eq!(light(Vec3::Y, 0.0, Vec3::NEG_Z), 1.0);
        assert!(0.99 < light(Vec3::Y, 90.0, Vec3::X));
        for rotation_deg in [0.0, 30.0, 200.0] {
            let sun = super::super::Sun::toward(rotation_deg, 20.0, Vec3::Y);
            assert!(0.99 < light(Vec3::Y, rotation_deg, sun));
        }
        // East is to the right of north, and the first row is up.
        let east = environment(32, 16, |x, y| Vec3::new(x as f32, y as f32, 0.0));
        assert_eq!(east.radiance(Vec3::X), Vec3::new(23.5, 7.5, 0.0));
        assert_eq!(east.radiance(Vec3::Z).y, 0.0);
        assert_eq!(east.radiance(Vec3::NEG_Z).y, 15.0);
    }

    #[test]
    fn an_environment_that_is_turned_later_is_the_same() {
        let (up, rotation_deg) = (Vec3::new(0.2, -0.5, 1.0), 77.0);
        let pixel = |x: usize, y: usize| Vec3::new(x as f32, y as f32, 1.0);
        let upright = turned(8, 4, Vec3::Z, 0.0, pixel);
        let facing = upright.facing(up, rotation_deg).unwrap();
        assert_eq!(facing, turned(8, 4, up, rotation_deg, pixel));
        assert!(upright.facing(Vec3::ZERO, 0.0).is_err());
    }

    #[test]
    fn pictures_of_the_panorama_camera_fit() {
        let camera = super::super::Camera {
            position: DVec3::ZERO,
            focal_point: DVec3::Y,
            view_up: DVec3::Z,
            projection: super::super::Projection::Panorama,
        };
        let view = camera.view(DVec3::ZERO, 40, 20);
        let environment = environment(40, 20, |x, y| Vec3::new(x as f32, y as f32, 1.0));
        for (x, y) in [(0, 0), (3, 5), (20, 10), (39, 19)] {
            let direction = view.ray(x as f32 + 0.5, y as f32 + 0.5).direction;
            let seen = environment.radiance(direction);
            assert!(seen.abs_diff_eq(Vec3::new(x as f32, y as f32, 1.0), 1e-3), "{x} {y}: {seen}");
        }
    }

    #[test]
    fn centres_of_pixels_have_their_values_and_the_seam_is_closed() {
        let value = |x, y| (hash((x * 10 + y) as u64) % 1000) as f32;
        let environment = environment(12, 6, |x, y| Vec3::splat(value(x, y)));
        for (x, y) in (0..72).map(|i| (i % 12, i / 12)) {
            let seen = environment.radiance(environment.center(x, y)).x;
            assert!((seen - value(x, y)).abs() < 0.01, "{x} {y}: {seen}");
        }
        // South, between the last column and the first.
        let rows = [0, 11].map(|x| 0.5 * (value(x, 2) + value(x, 3)));
        for side in [-1e-7, 1e-7] {
            let seen = environment.radiance(Vec3::new(side, -1.0, 0.0)).x;
            assert!((seen - 0.5 * (rows[0] + rows[1])).abs() < 0.01, "{seen}");
        }
    }

    #[test]
    fn what_is_no_light_is_repaired_or_refused() {
        let new = |pixels: Vec<Vec3>| Environment::new(2, 1, pixels, Vec3::Z, 0.0);
        let bad = Vec3::new(f32::NAN, -1.0, f32::NEG_INFINITY);
        let repaired = new(vec![bad, Vec3::new(f32::INFINITY, 1e5, -0.0)]).unwrap();
        assert_eq!(repaired.n_repaired(), 2);
        assert_eq!(&repaired.pixels[..], [Vec3::ZERO, Vec3::new(1e5, 1e5, 0.0)]);
        let cut = new(vec![Vec3::MAX, Vec3::ONE]).unwrap();
        assert!(cut.average().is_finite() && cut.n_repaired() == 1);
        let half = new(vec![Vec3::INFINITY, Vec3::ONE]).unwrap();
        assert_eq!(half.pixels[0], Vec3::splat(LARGEST_HALF));
        assert!(new(vec![bad, bad]).unwrap_err().to_string().contains("none that is light"));
        assert!(new(vec![Vec3::INFINITY; 2]).is_err());
        let error = new(vec![Vec3::ONE; 3]).unwrap_err().to_string();
        assert!(error.contains("3 pixels for 2 x 1"), "{error}");
        assert!(Environment::new(0, 0, vec![], Vec3::Z, 0.0).is_err());
        assert!(Environment::new(1, 1, vec![Vec3::ONE], Vec3::ZERO, 0.0).is_err());
        assert!(Environment::new(1, 1, vec![Vec3::ONE], Vec3::Z, f32::NAN).is_err());
    }

    #[test]
    fn gain_scales_the_light_and_not_the_density() {
        let mut environment = motley(8, 4);
        let (average, radiance) = (environment.average(), environment.radiance(Vec3::X));
        let drawn = environment.sample((0.3, 0.6));
        environment.gain(4.0);
        environment.gain(0.5);
        assert_eq!(environment.average(), 2.0 * average);
        assert_eq!(environment.radiance(Vec3::X), 2.0 * radiance);
        assert_eq!(environment.sample((0.3, 0.6)), drawn);
        environment.gain(f32::NAN);
        assert_eq!(environment.average(), Vec3::ZERO);
    }

    impl Environment {
        fn density(&self, direction: Vec3) -> f32 {
            self.radiance_and_density(direction).1
        }

        /// Mean over the sphere of the radiance interpolated between pixels.
        fn average(&self) -> Vec3 {
            let Self { width, height, .. } = *self;
            let step = PI / height as f64;
            // The integral of the sine times the hat of one row; the first and last row share what is left
            // of the integral of the sine alone, as they go on to the poles.
            let hat = |y: usize| (step * (y as f64 + 0.5)).sin() * 2.0 * (1.0 - step.cos()) / step;
            let inner: f64 = (1..height.saturating_sub(1)).map(hat).sum();
            let outer = if height == 1 { 2.0 } else { 0.5 * (2.0 - inner) };
            let weight = |y: usize| if y == 0 || y + 1 == height { outer } else { hat(y) };
            let row = |row: &[Vec3]| row.iter().map(|pixel| pixel.as_dvec3()).sum::<DVec3>();
            let rows = self.pixels.chunks_exact(width).enumerate();
            let sum: DVec3 = rows.map(|(y, pixels)| weight(y) * row(pixels)).sum();
            self.strength * (sum / (2.0 * width as f64)).as_vec3()
        }

        /// Toward the centre of a pixel, by the angles.
        fn center(&self, x: usize, y: usize) -> Vec3 {
            let azimuth = TAU * ((x as f64 + 0.5) / self.width as f64 - 0.5);
            let polar = PI * (y as f64 + 0.5) / self.height as f64;
            let [right, middle, up] = self.axes.map(|axis| axis.as_dvec3());
            let level = azimuth.sin() * right + azimuth.cos() * middle;
            (polar.sin() * level + polar.cos() * up).as_vec3()
        }
    }
}

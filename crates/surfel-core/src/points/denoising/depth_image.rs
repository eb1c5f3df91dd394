//! Depth images: the points of a depth camera, moved along their rays onto the surface that the pixels around describe.
//!
//! Stereo and structured light measure disparities, to which the inverse of the depth is proportional, with an error that
//! hardly depends on the depth. Planes of space are planes over the image, too. So far walls, whose depths jump by centimetres
//! between pixels, are smoothed as near ones are. Here a disparity is the inverse of a depth.
//!
//! Each pixel gets the plane through those around it whose disparities are near that plane (a biweight estimator). Its window
//! grows as long as one plane explains the pixels in it. Wide windows look at pixels farther apart, each of which stands for
//! its own smaller window (as in the transform à trous of Holschneider et al. 1989).

use super::depth_sensor::DepthSensor;
use super::disparity_plane::{DisparityFit, DisparityPlane, DisparitySample, ImageWindow};
use crate::error::Result;
use crate::math::{Random, Vec3, median};
use crate::points::neighbors::KdTree;
use crate::progress::Progress;
use rayon::prelude::*;

/// The windows around a pixel, one after another.
const WINDOWS: [ImageWindow; 5] = [
    ImageWindow { radius: 2, stride: 1, max_distance: 2.5, max_error: f32::INFINITY },
    ImageWindow { radius: 4, stride: 1, max_distance: 2.0, max_error: 0.7 },
    ImageWindow { radius: 8, stride: 2, max_distance: 1.6, max_error: 0.5 },
    ImageWindow { radius: 16, stride: 4, max_distance: 1.2, max_error: 0.42 },
    ImageWindow { radius: 32, stride: 8, max_distance: 0.9, max_error: 0.32 },
];
/// Fraction of [`ImageWindow::max_error`] up to which the plane of the smaller window has no weight.
const FULLY_EXPLAINED: f32 = 0.6;
/// Maximum distance of a stray disparity from the surface that most pixels around it describe.
const MAX_STRAY: f32 = 5.0;
/// Standard deviation of disparities in their unit. That of rounded disparities is about a third of their step.
const NOISE_PER_UNIT: f32 = 0.3;
/// Number of points that the size of pixels is measured at.
const N_SAMPLES: usize = 8192;
/// Number of groups of pixels by their disparity whose noise is measured, and least number of pixels of a group.
const N_GROUPS: usize = 16;
const MIN_GROUP_SIZE: usize = 256;
/// Maximum ratio of the unit of a group to the median: rough things fill a group of their own.
const MAX_UNIT_RATIO: f32 = 8.0;
/// Maximum number of pixels for each point.
const MAX_PIXELS_PER_POINT: usize = 16;
/// Minimum fraction of the measured pixels whose next one along a row or a column was measured, too. Scattered points, which
/// form no image, have 0.2.
const MIN_PAIRED: f32 = 0.6;
/// Minimum ratio of a smoothed disparity to the measured one: of far points the noise may be as large as the disparity.
const MIN_DISPARITY_RATIO: f32 = 0.5;
/// Ratio of the standard deviation of a normal distribution to the median distance from its mean.
const DEVIATION_PER_MEDIAN: f32 = 1.4826;

/// The disparities of a depth camera.
struct DepthImage {
    width: usize,
    height: usize,
    /// Tangents of the angles from the view to the first column and the first row.
    first: [f32; 2],
    /// Difference of the tangents from one pixel to the next.
    pixel_size: f32,
    units: Units,
    /// Row by row; none where nothing was measured.
    samples: Vec<Option<DisparitySample>>,
}

/// Units of disparities, which grow with the noise: at least the step between disparities, and three times their standard
/// deviation.
#[derive(Default)]
struct Units {
    /// Disparities in ascending order, each with the unit there.
    groups: Vec<(f32, f32)>,
}

/// Points that were moved onto their surface.
pub struct MovedPoints {
    /// The position of each point.
    pub positions: Vec<Vec3>,
    /// Standard deviation of the points from the surface before, in spacings.
    pub noise: f32,
}

/// Returns the points of a depth camera moved onto their surface, or none if they form no image. The noise is that of the
/// depths, in spacings of the pixels at that depth.
///
/// # Errors
///
/// Returns [`Error::Cancelled`](crate::Error::Cancelled) if `progress` is cancelled.
pub fn smooth_depths(
    positions: &[Vec3],
    sensor: &DepthSensor,
    progress: &dyn Progress,
) -> Result<Option<MovedPoints>> {
    let projected: Vec<Option<Vec3>> =
        positions.par_iter().map(|point| sensor.project(*point)).collect();
    let Some(image) = DepthImage::new(&projected, sensor, progress)? else { return Ok(None) };
    let planes = image.planes(progress)?;
    let move_point = |(position, projected): (&mut Vec3, &Option<Vec3>)| {
        let projected = (*projected)?;
        let disparity = image.smoothed(&planes, projected)?;
        *position = sensor.position + (*position - sensor.position) * (projected.z / disparity);
        Some((1.0 - projected.z / disparity).abs() / image.pixel_size)
    };
    let mut positions = positions.to_vec();
    let moves: Vec<f32> = positions.par_iter_mut().zip(&projected).filter_map(move_point).collect();
    let noise = median(moves).map(|distance| DEVIATION_PER_MEDIAN * distance);
    Ok(noise.map(|noise| MovedPoints { positions, noise }))
}

impl DepthImage {
    /// Makes an image of points by their tangents and disparities. Of several in a pixel the first one counts.
    fn new(
        projected: &[Option<Vec3>],
        sensor: &DepthSensor,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let seen: Vec<Vec3> = projected.iter().copied().flatten().collect();
        let Some(pixel_size) = pixel_size(&seen, progress)? else { return Ok(None) };
        let (low, high) =
            seen.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
                (low.min(*p), high.max(*p))
            });
        let [width, height] = [high.x - low.x, high.y - low.y]
            .map(|extent| (extent / pixel_size) as usize)
            .map(|n| n.saturating_add(2));
        if MAX_PIXELS_PER_POINT * seen.len() < width.saturating_mul(height) {
            return Ok(None);
        }
        let mut image = Self {
            width,
            height,
            first: [low.x, low.y],
            pixel_size,
            units: Units::default(),
            samples: vec![None; width * height],
        };
        for point in &seen {
            let sample = image.sample(*point);
            let slot = image.pixel(&sample);
            image.samples[slot].get_or_insert(sample);
        }
        if !image.is_dense() {
            return Ok(None);
        }
        image.units = Units::of_image(&image, sensor);
        Ok((!image.units.groups.is_empty()).then_some(image))
    }

    /// Returns true if the neighbours of most pixels were measured as well.
    fn is_dense(&self) -> bool {
        let is_measured = |pixel: usize| self.samples.get(pixel).is_some_and(Option::is_some);
        let measured = (0..self.samples.len()).filter(|pixel| is_measured(*pixel));
        let [n_measured, n_along_rows, n_along_columns] =
            measured.fold([0u32; 3], |[n, x, y], pixel| {
                let [next, below] =
                    [pixel + 1, pixel + self.width].map(|it| u32::from(is_measured(it)));
                [n + 1, x + next, y + below]
            });
        let min_pairs = MIN_PAIRED * n_measured as f32;
        min_pairs <= n_along_rows as f32 && min_pairs <= n_along_columns as f32
    }

    fn sample(&self, projected: Vec3) -> DisparitySample {
        let [x, y] = [projected.x - self.first[0], projected.y - self.first[1]]
            .map(|at| at / self.pixel_size);
        DisparitySample { x, y, disparity: projected.z }
    }

    /// Returns the index of the pixel of a sample.
    fn pixel(&self, sample: &DisparitySample) -> usize {
        sample.y.round() as usize * self.width + sample.x.round() as usize
    }

    /// Returns the disparity of the surface at a point, or none where it is not known or that of another surface.
    fn smoothed(&self, planes: &[DisparityPlane], projected: Vec3) -> Option<f32> {
        let point = self.sample(projected);
        let pixel = self.pixel(&point);
        let (sample, plane) = (self.samples[pixel]?, planes[pixel]);
        let disparity = plane.at(point.x - sample.x, point.y - sample.y);
        let is_known = plane.is_known
            && MIN_DISPARITY_RATIO * point.disparity < disparity
            && (disparity - point.disparity).abs() <= MAX_STRAY * self.units.at(disparity);
        is_known.then_some(disparity)
    }

    /// Returns the surface at each pixel.
    fn planes(&self, progress: &dyn Progress) -> Result<Vec<DisparityPlane>> {
        let unfitted = |sample: &Option<DisparitySample>| {
            let disparity = sample.map_or(0.0, |sample| sample.disparity);
            DisparityPlane { disparity, ..DisparityPlane::default() }
        };
        let mut planes: Vec<DisparityPlane> = self.samples.iter().map(unfitted).collect();
        progress.begin("depth image", (WINDOWS.len() * self.height) as u64);
        for window in &WINDOWS {
            let widened = |pixel: usize| self.widened(window, &planes, pixel);
            let row = |y: usize| {
                progress.check()?;
                progress.advance(1);
                Ok((y * self.width..(y + 1) * self.width).map(widened).collect())
            };
            let rows: Vec<Vec<DisparityPlane>> =
                (0..self.height).into_par_iter().map(row).collect::<Result<_>>()?;
            planes = rows.into_iter().flatten().collect();
        }
        Ok(planes)
    }

    /// Returns the plane of a pixel after it was fitted to a window, as far as it explains the pixels there.
    fn widened(
        &self,
        window: &ImageWindow,
        planes: &[DisparityPlane],
        pixel: usize,
    ) -> DisparityPlane {
        let own = planes[pixel];
        let Some(center) = self.samples[pixel] else { return own };
        let pixels = self.window(window, planes, pixel, &center);
        let unit = self.units.at(own.disparity);
        let mut fit = DisparityFit::new(&pixels, window, unit, own);
        if !own.is_known && !fit.is_supported(pixels.len()) {
            // A stray disparity starts from that of most others.
            let disparities = pixels.iter().map(|sample| sample.disparity);
            let disparity = median(disparities).unwrap_or(own.disparity);
            fit = DisparityFit::new(&pixels, window, unit, DisparityPlane { disparity, ..own });
            if MAX_STRAY * unit < (fit.plane.disparity - own.disparity).abs() {
                return own;
            }
        }
        let weight = match window.max_error {
            f32::INFINITY => 1.0,
            limit => (1.0 - fit.error / (limit * unit)) / (1.0 - FULLY_EXPLAINED),
        };
        if !fit.is_supported(pixels.len()) || weight <= 0.0 {
            return own;
        }
        let weight = weight.min(1.0);
        let mix = |a: f32, b: f32| a + weight * (b - a);
        let [x, y] = [0, 1].map(|axis| mix(own.slope[axis], fit.plane.slope[axis]));
        let disparity = mix(own.disparity, fit.plane.disparity);
        DisparityPlane { disparity, slope: [x, y], is_known: true }
    }

    /// Returns the surface at the pixels in a window around a pixel, relative to its sample.
    fn window(
        &self,
        window: &ImageWindow,
        planes: &[DisparityPlane],
        pixel: usize,
        center: &DisparitySample,
    ) -> Vec<DisparitySample> {
        let [row, column] = [pixel / self.width, pixel % self.width].map(|at| at as isize);
        let inside = |center: isize, size: usize| {
            let steps = -window.radius / window.stride..=window.radius / window.stride;
            let at = steps.map(move |i| (center + i * window.stride) as usize);
            at.filter(move |at| *at < size)
        };
        let mut found = Vec::with_capacity(96);
        for y in inside(row, self.height) {
            for x in inside(column, self.width) {
                let other = y * self.width + x;
                if let Some(sample) = self.samples[other] {
                    found.push(DisparitySample {
                        x: sample.x - center.x,
                        y: sample.y - center.y,
                        disparity: planes[other].disparity,
                    });
                }
            }
        }
        found
    }
}

impl Units {
    /// Measures the units of an image by the distances of pixels from the lines through those beside them.
    fn of_image(image: &DepthImage, sensor: &DepthSensor) -> Self {
        let bend = |three: &[Option<DisparitySample>]| {
            let [before, own, after] = [three[0]?, three[1]?, three[2]?].map(|it| it.disparity);
            Some((own, (before - 2.0 * own + after).abs()))
        };
        let rows = image.samples.chunks(image.width);
        let mut bends: Vec<(f32, f32)> =
            rows.flat_map(|row| row.windows(3)).filter_map(bend).collect();
        bends.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let size = bends.len().div_ceil(N_GROUPS).max(MIN_GROUP_SIZE);
        let unit = |group: &[(f32, f32)]| {
            let disparity = group[group.len() / 2].0;
            // A second difference has 1 + 4 + 1 times the variance.
            let bend = median(group.iter().map(|(_, bend)| *bend)).unwrap_or_default();
            let noise = DEVIATION_PER_MEDIAN / 6f32.sqrt() * bend;
            (disparity, sensor.disparity_step(disparity).max(noise / NOISE_PER_UNIT))
        };
        let mut groups: Vec<(f32, f32)> = bends.chunks(size).map(unit).collect();
        let typical = median(groups.iter().map(|(_, unit)| *unit)).unwrap_or_default();
        groups.iter_mut().for_each(|(_, unit)| *unit = unit.min(MAX_UNIT_RATIO * typical));
        Self { groups }
    }

    /// Returns the unit at a disparity, between those of the groups around it.
    fn at(&self, disparity: f32) -> f32 {
        let above = self.groups.partition_point(|(own, _)| *own < disparity);
        let last = self.groups.len().saturating_sub(1);
        let group = |i: usize| self.groups.get(i.min(last)).copied().unwrap_or_default();
        let ((low, low_unit), (high, high_unit)) = (group(above.saturating_sub(1)), group(above));
        let fraction = ((disparity - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        low_unit + fraction * (high_unit - low_unit)
    }
}

/// Returns the median tangent of the angle between a point and the nearest other one.
fn pixel_size(projected: &[Vec3], progress: &dyn Progress) -> Result<Option<f32>> {
    let flat: Vec<Vec3> = projected.iter().map(|point| point.truncate().extend(0.0)).collect();
    let tree = KdTree::new(&flat, progress)?;
    let mut random = Random::new(0, 0);
    let mut sample = || random.below(flat.len().max(1) as u64) as u32;
    let points: Vec<u32> = (0..flat.len().min(N_SAMPLES)).map(|_| sample()).collect();
    let nearest = |point: &u32| {
        let nearest = tree.nearest(flat[*point as usize], 1, Some(*point));
        nearest.first().map(|nearest| nearest.distance_squared.sqrt())
    };
    let distances: Vec<f32> = points.par_iter().filter_map(nearest).collect();
    Ok(median(distances).filter(|distance| 0.0 < *distance))
}

#[cfg(test)]
mod tests {
    //! Images of known walls, with rounded disparities.

    use super::*;
    use crate::points::PointCloud;
    use crate::progress::NoProgress;

    const N_SIDE: usize = 200;
    /// Number of steps of the disparity of a depth of 1.
    const N_STEPS: f32 = 300.0;

    /// Returns the points that a camera at zero sees along Z. `inverse_depth` is that of the scene by the tangents of a pixel;
    /// `error` adds to its disparity, in steps.
    fn seen(inverse_depth: impl Fn(f32, f32) -> f32, error: impl Fn(usize) -> f32) -> Vec<Vec3> {
        let point = |pixel: usize| {
            let [x, y] = [pixel % N_SIDE, pixel / N_SIDE].map(|at| at as f32 / N_SIDE as f32 - 0.5);
            let disparity = (N_STEPS * inverse_depth(x, y) + error(pixel)).round();
            N_STEPS / disparity * Vec3::new(x, y, 1.0)
        };
        (0..N_SIDE * N_SIDE).map(point).collect()
    }

    /// Returns the points after they were smoothed, and the noise.
    fn smoothed(points: &[Vec3]) -> (Vec<Vec3>, f32) {
        let cloud = PointCloud::from_positions(points.to_vec());
        let sensor = DepthSensor::find(&cloud).unwrap();
        let moved = smooth_depths(points, &sensor, &NoProgress).unwrap().unwrap();
        (moved.positions, moved.noise)
    }

    /// Returns the distances of the disparities from those of the scene, in steps, in ascending order.
    fn errors(points: &[Vec3], inverse_depth: impl Fn(f32, f32) -> f32) -> Vec<f32> {
        let error = |p: &Vec3| N_STEPS * (1.0 / p.z - inverse_depth(p.x / p.z, p.y / p.z)).abs();
        let mut errors: Vec<f32> = points.iter().map(error).collect();
        errors.sort_unstable_by(f32::total_cmp);
        errors
    }

    fn slanted_wall(x: f32, y: f32) -> f32 {
        0.3 + 0.1 * x - 0.13 * y
    }

    #[test]
    fn terraces_of_a_slanted_wall_become_even() {
        let terraces = seen(slanted_wall, |_| 0.0);
        let (moved, noise) = smoothed(&terraces);
        let rounding = errors(&terraces, slanted_wall);
        assert!(0.45 < rounding[rounding.len() * 95 / 100]);
        let left = errors(&moved, slanted_wall);
        assert!(left[left.len() * 95 / 100] < 0.08, "{}", left[left.len() * 95 / 100]);
        // A step is 3.3 * 3.3 / 300 wide at the mean depth of 3.3, and a pixel 3.3 / 200.
        assert!((0.3..1.2).contains(&noise), "{noise}");
        for (before, after) in terraces.iter().zip(&moved) {
            assert!(before.normalize().dot(after.normalize()) > 0.999_999, "its ray is left");
        }
    }

    #[test]
    fn near_and_far_parts_are_smoothed_whatever_their_noise() {
        // Time of flight: a noise of 3 mm at depths of 1 to 4 m, rounded to millimetres.
        let slanted = |x: f32, y: f32| 0.6 + 0.5 * x - 0.2 * y;
        let mut random = Random::new(3, 0);
        let mut measured = |point: &Vec3| {
            let depth = 1.0 / slanted(point.x / point.z, point.y / point.z);
            let depth = depth + 0.003 * random.next_gaussian() as f32;
            (1000.0 * depth).round() / 1000.0 * (point / point.z)
        };
        let points: Vec<Vec3> = seen(slanted_wall, |_| 0.0).iter().map(&mut measured).collect();
        let (moved, _) = smoothed(&points);
        for (low, high) in [(1.0, 1.5), (1.5, 2.0), (2.0, 4.0)] {
            let of_range = points.iter().zip(&moved).filter(|(p, _)| (low..high).contains(&p.z));
            let error = |p: &Vec3| (p.z - 1.0 / slanted(p.x / p.z, p.y / p.z)).abs();
            let errors = of_range.map(|(before, after)| (error(before), error(after)));
            let (before, after) =
                errors.fold((0.0, 0.0), |(b, a), (before, after)| (b + before, a + after));
            assert!(after < 0.2 * before, "{low}: {after} of {before}");
        }
    }

    #[test]
    fn walls_in_front_of_each_other_stay_apart() {
        let walls = |x: f32, y: f32| if x < 0.021 { 0.45 } else { slanted_wall(x, y) };
        let (moved, _) = smoothed(&seen(walls, |_| 0.0));
        let left = errors(&moved, walls);
        assert!(left[left.len() - 1] < 1.0, "{}", left[left.len() - 1]);
        assert!(left[left.len() * 95 / 100] < 0.08, "{}", left[left.len() * 95 / 100]);
    }

    #[test]
    fn stray_points_move_onto_their_wall_and_parts_of_another_surface_stay() {
        let error = |pixel: usize| match (pixel % 997, pixel % 613) {
            (0, _) => 4.0,
            (_, 0) => 30.0,
            _ => 0.0,
        };
        let points = seen(slanted_wall, error);
        let left = errors(&smoothed(&points).0, slanted_wall);
        let n_far = points.iter().enumerate().filter(|(pixel, _)| error(*pixel) == 30.0).count();
        assert!(left[left.len() - n_far - 1] < 1.0, "{}", left[left.len() - n_far - 1]);
        assert!(25.0 < left[left.len() - n_far]);
    }

    #[test]
    fn scattered_points_form_no_image() {
        // A part of the points, moved within their pixels and more.
        let mut random = Random::new(5, 0);
        let mut next = || (random.next_f32() - 0.5) / 20.0;
        let mut points = seen(slanted_wall, |_| 0.0);
        points.iter_mut().for_each(|point| *point += point.z * Vec3::new(next(), next(), 0.0));
        let sensor = DepthSensor::find(&PointCloud::from_positions(points.clone())).unwrap();
        assert!(smooth_depths(&points, &sensor, &NoProgress).unwrap().is_none());
    }

    #[test]
    fn a_point_beside_the_camera_does_not_keep_others_from_moving() {
        let mut points = seen(slanted_wall, |_| 0.0);
        points.extend([Vec3::new(5.0, 0.0, 1e-3), Vec3::X, Vec3::ZERO]);
        let (moved, _) = smoothed(&points);
        assert_eq!(moved[moved.len() - 3..], points[points.len() - 3..]);
        assert!(moved[0] != points[0]);
    }

    #[test]
    fn points_that_fill_no_image_stay() {
        let mut points = seen(slanted_wall, |_| 0.0);
        let sensor = DepthSensor::find(&PointCloud::from_positions(points.clone())).unwrap();
        points.retain(|point| (point.x / point.z - point.y / point.z).abs() < 1e-3);
        assert!(smooth_depths(&points, &sensor, &NoProgress).unwrap().is_none());
    }
}
